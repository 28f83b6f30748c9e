"""Numbers and designs in words."""

import pytest

from foldcar.statistics.words import duration_text, percent, percent_number


@pytest.mark.parametrize(
    ("share", "digits", "sentence", "cell"),
    [
        (0.0, 0, "0 %", "0"), (1 / 200, 0, "below 1 %", "<1"), (1 / 10_000, 1, "below 0.1 %", "<0.1"),
        (0.006, 0, "1 %", "1"), (0.5, 0, "50 %", "50"), (199 / 200, 0, "above 99 %", ">99"),
        (0.9999, 1, "above 99.9 %", ">99.9"), (1.0, 0, "100 %", "100"),
    ],
)  # fmt: skip
def test_only_nothing_is_0_per_cent_and_only_all_is_100(share: float, digits: int, sentence: str, cell: str) -> None:
    assert (percent(share, digits), percent_number(share, digits)) == (sentence, cell)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0.4 s"), (12.4, "12 s"), (99.4, "99 s"), (99.6, "1.7 min"), (5990, "1.7 h"), (3600 * 47.6, "2.0 days")],
)
def test_a_duration_has_two_digits_and_no_exponent(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text
