"""Numbers and designs in words."""

import pytest

from foldcar.statistics.words import duration_text, percent, percent_below, percent_number, points_text, threshold_text


@pytest.mark.parametrize(
    ("share", "digits", "sentence", "cell"),
    [
        (0.0, 0, "0 %", "0"), (1 / 200, 0, "<1 %", "<1"), (1 / 10_000, 1, "<0.1 %", "<0.1"),
        (0.006, 0, "1 %", "1"), (0.5, 0, "50 %", "50"), (199 / 200, 0, ">99 %", ">99"),
        (0.9999, 1, ">99.9 %", ">99.9"), (1.0, 0, "100 %", "100"),
    ],
)  # fmt: skip
def test_only_nothing_is_0_per_cent_and_only_all_is_100(share: float, digits: int, sentence: str, cell: str) -> None:
    assert (percent(share, digits), percent_number(share, digits)) == (sentence, cell)


def test_a_threshold_is_not_rounded() -> None:
    assert [threshold_text(threshold) for threshold in (0.75, 0.745, 0.999, 0.004, 0.07)] == [
        "75 %", "74.5 %", "99.9 %", "0.4 %", "7 %",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("share", "threshold", "text"),
    [
        (0.6, 0.75, "60 %"), (149 / 199, 0.75, "74.9 %"), (249 / 250, 0.999, "99.6 %"), (0.74999, 0.75, "74.999 %"),
        (1 / 250, 0.75, "<1 %"),
    ],
)  # fmt: skip
def test_a_rate_below_a_threshold_is_shown_below_it(share: float, threshold: float, text: str) -> None:
    assert percent_below(share, threshold) == text


def test_one_point_is_singular() -> None:
    assert [points_text(difference) for difference in (0.004, 0.012, -0.01, 0.3)] == [
        "0 points", "1 point", "1 point", "30 points",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0.4 s"), (12.4, "12 s"), (99.4, "99 s"), (99.6, "1.7 min"), (5990, "1.7 h"), (3600 * 47.6, "2.0 days")],
)
def test_a_duration_has_two_digits_and_no_exponent(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text
