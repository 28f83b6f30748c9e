"""Intervals of rates, from runs, from trials, and from both; the difference of two simulations."""

import numpy
import pytest
from scipy import stats

from foldcar.analysis.engine_bias import pooled_difference
from foldcar.analysis.rate import (
    Rate,
    anytime_interval,
    clopper_pearson_interval,
    limited_mean,
    wilson_interval,
)
from foldcar.errors import FoldcarError


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
    fixed, stopped = (Rate.counted(30, 40, "40 runs", stopped) for stopped in (False, True))

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


def test_the_difference_of_two_simulations_is_that_of_plain_quadrature() -> None:
    """Of a new design: N(m, s^2), m standard normal, s half-normal, given log-odds with half a run added."""
    here = numpy.array([[390, 400], [1, 3], [1, 3], [1, 3], [3, 5]])
    there = numpy.array([[300, 400], [2, 3], [2, 3], [2, 3], [0, 0]])

    def log_odds(counts: numpy.ndarray) -> tuple[numpy.ndarray, numpy.ndarray]:
        good, bad = counts[:, 0] + 0.5, counts[:, 1] - counts[:, 0] + 0.5
        return numpy.log(good / bad), 1 / good + 1 / bad

    # The last design has no runs there.
    (a, a_variance), (b, b_variance) = log_odds(here[:4]), log_odds(there[:4])
    m, s = numpy.linspace(-6, 6, 601)[:, None], numpy.linspace(0.005, 6, 600)[None, :]
    density = stats.norm.pdf(m) * stats.norm.pdf(s)
    for difference, noise in zip(a - b, a_variance + b_variance, strict=True):
        density = density * stats.norm.pdf(difference, m, numpy.sqrt(noise + s**2))
    density /= density.sum()
    mean = (density * m).sum()

    found = pooled_difference(here[:, 0], here[:, 1], there[:, 0], there[:, 1])

    assert found[0] == pytest.approx(mean, abs=0.005)
    assert found[1] == pytest.approx((density * ((m - mean) ** 2 + s**2)).sum(), rel=0.005)
    # Without any design in both, what was assumed before: 1 of the mean, 1 of the spread.
    assert pooled_difference([3], [4], [0], [0]) == pytest.approx((0, 2), abs=0.06)
