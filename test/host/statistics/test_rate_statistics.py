"""Intervals of rates, from runs, from trials, and from both; the difference of two simulations."""

import numpy
import pytest
from scipy import stats

from foldcar.errors import FoldcarError
from foldcar.statistics.rate import (
    Rate,
    anytime_interval,
    clopper_pearson_interval,
    limited_mean,
    wilson_interval,
)
from foldcar.statistics.rate_correction import corrected_rates


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


@pytest.mark.parametrize("rough", [0.0, 0.5])
def test_few_slow_runs_correct_many_fast_ones(rough: float) -> None:
    """Cars pass where their log-odds exceed the difficulty of an environment, which is the same in both simulations."""
    random, widths, errors, covered = numpy.random.default_rng(4), numpy.linspace(0, 1, 19)[:, None], [], []
    for _ in range(80):
        fast = 2 - 14 * (widths - random.uniform(0.3, 0.7)) ** 2
        slow = fast + random.normal(0, 0.7) + random.normal(0, 0.7) * (widths - 0.5) + random.normal(0, rough, (19, 1))
        difficulty, scatter = random.logistic(0, 1.5, 100), random.normal(0, 0.5, (2, 19, 100))
        passed_fast, passed_slow = (scatter + numpy.stack([fast, slow]) > difficulty).astype(float)
        true = stats.norm.cdf((slow - random.logistic(0, 1.5, 20_000)) / 0.5).mean(axis=1)
        few = passed_slow[:, :10]
        simple = passed_fast.mean(axis=1)
        passed_slow[:, 10:] = numpy.nan

        rate, low, high = corrected_rates(widths, passed_fast, passed_slow)

        covered.append(((low <= true) & (true <= high)).mean())
        others = (few.mean(axis=1), simple, simple + (few - passed_fast[:, :10]).mean(axis=1))
        errors.append([abs(estimate - true).mean() for estimate in (rate, *others)])
    corrected, *others = numpy.mean(errors, axis=0)
    assert corrected < 0.85 * min(others)
    assert 0.93 < numpy.mean(covered) < 0.99


def test_a_constant_difference_is_found_at_designs_without_dear_runs_too() -> None:
    widths, fast = numpy.arange(12.0)[:, None], numpy.tile([0.0, 1.0], (12, 100))
    fast[3] = numpy.nan
    same, low, high = corrected_rates(widths, fast, fast)
    slow = fast.copy()
    slow[:, 1::10] = 0
    slow[6] = numpy.nan
    lower, *band = corrected_rates(widths, fast, slow)

    present = numpy.arange(12) != 3
    assert numpy.isnan([same[3], low[3], high[3]]).all()
    assert same[present] == pytest.approx(numpy.full(11, 0.5), abs=0.01)
    assert numpy.all((low < 0.5) & (high > 0.5) | ~present)
    assert lower[present] == pytest.approx(numpy.full(11, 0.4), abs=0.02)
    assert (band[1] - band[0])[6] > (band[1] - band[0])[5]
    for wrong, message in ((numpy.full((12, 200), numpy.nan), "in two environments"), (slow[:, :5], "that are alike")):
        with pytest.raises(FoldcarError, match=message):
            corrected_rates(widths, fast, wrong)
