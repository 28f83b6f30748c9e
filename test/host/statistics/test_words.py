"""Numbers and designs in words."""

import pytest

from foldcar.statistics.words import (
    duration_text,
    estimate_text,
    percent,
    percent_below,
    percent_number,
    points,
    points_text,
    signed,
    threshold_text,
)


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
    thresholds = (0.75, 0.745, 0.999, 0.004, 0.07, 0.1, 0.99999999, 1e-9)
    assert [threshold_text(threshold) for threshold in thresholds] == [
        "75 %", "74.5 %", "99.9 %", "0.4 %", "7 %", "10 %", "99.999999 %", "0.0000001 %",
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


def test_what_rounds_to_0_has_no_sign() -> None:
    assert [signed(value, 1) for value in (-1.44, -0.04, 0.0, 0.04, 0.06)] == ["-1.4", "0.0", "0.0", "0.0", "+0.1"]
    assert [points(difference) for difference in (-0.3, -0.004, 0.004, 0.3)] == ["-30", "0", "0", "+30"]


def test_an_estimate_that_is_0_beside_its_interval_is_shown_as_0() -> None:
    assert estimate_text(1.16e-5, -0.00734, 0.00741) == "0 (-0.00734 to 0.00741)"
    assert estimate_text(-2.3e-7, -0.00734, 0.00741) == "0 (-0.00734 to 0.00741)"
    assert estimate_text(0.00606, -0.0112, 0.0321) == "0.00606 (-0.0112 to 0.0321)"
    assert estimate_text(1.0, 0.58, 1.7) == "1 (0.58 to 1.7)"


def test_the_ends_of_an_interval_are_as_exact_as_its_estimate() -> None:
    """With two digits, these intervals would end at the value itself, or at the 1 that they contain."""
    assert estimate_text(1.126, 1.0132, 1.1717) == "1.13 (1.01 to 1.17)"
    assert estimate_text(0.98, 0.9356, 1.0304) == "0.98 (0.936 to 1.03)"
    assert estimate_text(1.03, 0.9773, 1.0774) == "1.03 (0.977 to 1.08)"
