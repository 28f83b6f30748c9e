"""Intervals of rates, from runs, from trials, and from both."""

import numpy
import pytest

from foldcar.errors import FoldcarError
from foldcar.statistics.rate import (
    Rate,
    anytime_interval,
    clopper_pearson_interval,
    limited_mean,
    wilson_interval,
)


def test_no_success_of_ten_has_the_closed_form() -> None:
    # The rate at which 10 failures have a probability of 2.5 %.
    assert clopper_pearson_interval(0, 10) == pytest.approx((0, 1 - 0.025**0.1))


@pytest.mark.parametrize("interval", [wilson_interval, clopper_pearson_interval])
def test_intervals_rise_with_successes_stay_within_0_to_1_and_mirror(interval: object) -> None:
    ends = numpy.array([interval(k, 12) for k in range(13)])  # type: ignore[operator]

    assert numpy.all(numpy.diff(ends, axis=0) > 0)
    assert ends.min() == pytest.approx(0) and ends.max() == pytest.approx(1) and ends.min() >= 0 and ends.max() <= 1
    assert ends[::-1, ::-1] == pytest.approx(1 - ends)


def test_a_rate_has_the_interval_of_how_its_runs_were_stopped() -> None:
    fixed, stopped = (Rate.from_counts(30, 40, "40 runs", stopped) for stopped in (False, True))

    assert (fixed.value, fixed.low, fixed.high) == (0.75, *wilson_interval(30, 40))
    assert (stopped.low, stopped.high) == tuple(map(float, anytime_interval(30, 40)))
    assert (fixed.method, stopped.method) == ("Wilson interval of 40 runs", "anytime-valid interval of 40 runs")


@pytest.mark.parametrize(("successes", "runs"), [(0, 0), (3, 2), (-1, 5)])
def test_counts_that_cannot_be_are_refused(successes: int, runs: int) -> None:
    with pytest.raises(FoldcarError):
        wilson_interval(successes, runs)


@pytest.mark.parametrize(("crossing", "never"), [(60, 40), (100, 0), (2, 8), (0, 10)])
def test_mean_time_has_the_interval_of_the_bayesian_bootstrap(crossing: int, never: int) -> None:
    random = numpy.random.default_rng(1007)
    crossed, limit_s, runs = random.gamma(4.0, 1.0, crossing), 60.0, crossing + never
    times = numpy.array([*crossed, *[limit_s] * never])
    # Half a run that crosses at once, half a run that never does.
    weights = random.standard_gamma([*[1.0] * runs, 0.5, 0.5], (8000, runs + 2))
    means = weights @ [*times, 0.0, limit_s] / weights.sum(axis=1)
    ends = numpy.quantile(means, [0.025, 0.975])

    mean, low, high = limited_mean(crossing, runs, crossed.sum(), (crossed**2).sum(), limit_s)

    assert mean == pytest.approx(times.mean())
    assert (low, high) == pytest.approx((min(ends[0], mean), max(ends[1], mean)), abs=0.04 * numpy.ptp(ends))
    with pytest.raises(FoldcarError, match="limit"):
        limited_mean(1, 2, 61.0, 61.0**2, limit_s)


# Newcombe (1998), "Two-sided confidence intervals for the single proportion", table I, method 3.
@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_interval_is_the_published_one(successes: int, runs: int, low: float, high: float) -> None:
    assert wilson_interval(successes, runs) == pytest.approx((low, high), abs=5e-5)
