"""Intervals of rates, from runs, from trials, and from both."""

from itertools import product

import numpy
import pytest
from scipy import integrate, special, stats
from sklearn.gaussian_process.kernels import Matern

from foldcar.analysis.betting import betting_interval
from foldcar.analysis.binomial_normal import binomial_normal
from foldcar.analysis.intervals import clopper_pearson_interval, jeffreys_interval, wilson_interval
from foldcar.analysis.pooled_bias import (
    ALONE,
    CONSTANT,
    LENGTHS,
    LOG_ODDS,
    SLOPE,
    SMOOTH,
    _checked,
    _Fit,
    _kernels,
    pooled_rates,
)
from foldcar.analysis.prediction_powered import power_tuned_mean, rectified_rate
from foldcar.errors import FoldcarError

VALUES = [0.1, 0.9, 0.7, 0.4, 1, 0.8, 0.6, 0.95, 0.3, 0.75]
TRIALS = numpy.array([1, 1, 1, 0, 1, 0, 0, 1, 1, 0])
PAIRED = numpy.array([1, 1, 1, 0, 1, 1, 0, 1, 0, 0])
OTHERS = numpy.repeat([1, 0], [30, 10])


def test_no_success_of_ten_has_the_closed_forms() -> None:
    # The rate at which 10 failures have a probability of 2.5 %; the one that Beta(1/2, 10 1/2) exceeds in 2.5 %.
    assert clopper_pearson_interval(0, 10) == pytest.approx((0, 1 - 0.025**0.1))
    low, high = jeffreys_interval(0, 10)
    above, _ = integrate.quad(lambda p: stats.beta.pdf(p, 0.5, 10.5), high, 1)
    assert low == 0 and above == pytest.approx(0.025)


@pytest.mark.parametrize("interval", [wilson_interval, jeffreys_interval, clopper_pearson_interval])
def test_intervals_rise_with_successes_stay_within_0_to_1_and_mirror(interval: object) -> None:
    ends = numpy.array([interval(k, 12) for k in range(13)])  # type: ignore[operator]

    assert numpy.all(numpy.diff(ends, axis=0) > 0)
    assert ends.min() == pytest.approx(0) and ends.max() == pytest.approx(1) and ends.min() >= 0 and ends.max() <= 1
    assert ends[::-1, ::-1] == pytest.approx(1 - ends)


@pytest.mark.parametrize(("successes", "runs"), [(0, 0), (3, 2), (-1, 5), (float("nan"), 5)])
def test_counts_that_cannot_be_are_refused(successes: float, runs: float) -> None:
    with pytest.raises(FoldcarError):
        jeffreys_interval(successes, runs)


def test_bets_win_what_the_authors_program_says() -> None:
    # confseq 0.0.11: betting_mart with the mean of 64 constant bets, solved for a capital of 40 by scipy's brentq.
    assert betting_interval(VALUES) == pytest.approx((0.3454340975, 0.8682804879), abs=1e-8)


def test_bets_do_not_depend_on_order_or_unit_and_say_all_without_values() -> None:
    low, high = betting_interval(VALUES)
    scaled = betting_interval([20 * value - 5 for value in reversed(VALUES)], low=-5, high=15)

    assert scaled == pytest.approx((20 * low - 5, 20 * high - 5), abs=1e-9)
    assert betting_interval([], low=-5, high=15) == (-5, 15)
    assert betting_interval(VALUES, 0.5)[0] > low
    with pytest.raises(FoldcarError, match="0 to 1"):
        betting_interval([0.5, 1.2])


def test_power_tuned_mean_is_that_of_the_authors_program() -> None:
    # ppi-python 0.2.3, ppi_mean_pointestimate.
    assert power_tuned_mean(TRIALS, PAIRED, OTHERS) == pytest.approx(0.68166667)


def test_rectified_rate_is_the_posterior_of_the_two_by_two_table() -> None:
    random = numpy.random.default_rng(1)
    every = numpy.concatenate([PAIRED, OTHERS])
    # Of 6 trials where simulation passed 5 passed, of the other 4 one.
    a, b = random.beta(1.5, 3.5, 400_000), random.beta(5.5, 1.5, 400_000)
    f = random.normal(every.mean(), every.std(ddof=1) / numpy.sqrt(len(every)), 400_000)

    rate = rectified_rate(TRIALS, PAIRED, OTHERS)

    assert (rate.low, rate.high) == pytest.approx(tuple(numpy.quantile(a + (b - a) * f, [0.025, 0.975])), abs=0.004)
    assert rate.value == pytest.approx(0.68166667)


def test_simulation_that_agrees_narrows_and_one_that_says_nothing_does_not() -> None:
    def width(paired: numpy.ndarray, others: numpy.ndarray) -> float:
        return 2 * rectified_rate(numpy.tile(TRIALS, 4), numpy.tile(paired, 4), others).half_width

    low, high = jeffreys_interval(24, 40)
    others = numpy.repeat([1, 0], [300, 200])

    assert width(TRIALS, others) < 0.5 * (high - low)
    # Simulation passes in half of the environments of either kind: no correlation.
    assert width(numpy.array([1, 0, 1, 1, 0, 0, 1, 1, 0, 0]), others) == pytest.approx(high - low, rel=0.05)


def test_rectified_rate_of_little_data_says_what_it_rests_on() -> None:
    assert rectified_rate([], [], [0, 1]).low == 0 and rectified_rate([], [], [0, 1]).high == 1
    alone = rectified_rate([1, 1], [0, 1], [])
    assert (alone.low, alone.high) == jeffreys_interval(2, 2) and "alone" in alone.method
    assert "alone" in rectified_rate([0], [1], [0, 1]).method
    failed = rectified_rate([0] * 10, [0] * 5 + [1] * 5, [1] * 90)
    assert 0 <= failed.low <= failed.value <= failed.high < 0.5
    for bad in (([1], [1, 0], [1]), ([0.5], [1], [1]), ([1], [2], [1])):
        with pytest.raises(FoldcarError):
            rectified_rate(*bad)


def test_differences_covary_as_the_model_says() -> None:
    """A constant, a slope on simulation's log-odds, scikit-learn's Matérn over shares of the range, each one's own."""
    x, errors = numpy.array([[60.0, 1.0], [100.0, 1.0], [120.0, 5.0]]), [0.1, 0.2, 0.3]
    log_odds = numpy.array([-1.0, 0.5, 2.0])
    shares = numpy.array([[0, 0], [40 / 60, 0], [1, 1]])

    kernels = _kernels(x, log_odds, numpy.array(errors))

    grid = product(LENGTHS, SMOOTH, ALONE)
    for (length, smooth, alone), kernel in zip(grid, kernels, strict=True):
        expected = CONSTANT**2 + SLOPE**2 * numpy.outer(log_odds, log_odds) + smooth**2 * Matern(length, nu=2.5)(shares)
        assert kernel == pytest.approx(expected + numpy.diag(errors) + alone**2 * numpy.eye(3))


def test_pooled_posterior_is_that_of_importance_sampling() -> None:
    x, passed, counted = numpy.array([[60.0], [100.0], [120.0]]), numpy.array([1, 7, 0]), numpy.array([10, 9, 0])
    x, k, n, log_odds, errors = _checked(x, passed, counted, [0.2, 0.9, 0.8], 100)
    random = numpy.random.default_rng(1)
    kernels = _kernels(x, log_odds, errors)
    draws = numpy.concatenate([random.multivariate_normal(log_odds, kernel, 20_000) for kernel in kernels])
    likelihood = numpy.exp(stats.binom.logpmf(k, n, 1 / (1 + numpy.exp(-draws))).sum(axis=1))

    fit = _Fit.to(kernels, log_odds, k, n)

    # How probable the trials are under each kernel, all alike beforehand.
    evidence = likelihood.reshape(len(kernels), -1).mean(axis=1)
    assert fit.weights == pytest.approx(evidence / evidence.sum(), rel=0.06)
    for design in range(3):
        order = numpy.argsort(draws[:, design])
        masses = likelihood[order].cumsum() / likelihood.sum()
        found = fit.posterior(design).cumsum()
        for part in (0.025, 0.5, 0.975):
            expected = draws[order, design][numpy.searchsorted(masses, part)]
            assert numpy.interp(part, found / found[-1], LOG_ODDS) == pytest.approx(expected, abs=0.12)


def test_neighbours_narrow_a_design_and_a_design_without_trials_gets_a_wide_rate() -> None:
    x = numpy.arange(65, 250, 10.0)[:, None]
    counted = numpy.full(len(x), 10)
    counted[-1] = 0
    passed = numpy.minimum(numpy.full(len(x), 7), counted)

    rates = pooled_rates(x, passed, counted, numpy.full(len(x), 0.9))
    low, high = jeffreys_interval(7, 10)

    assert all(2 * rate.half_width < 0.6 * (high - low) for rate in rates[:-1])
    assert rates[-1].half_width > rates[-2].half_width and "no trials of this design" in rates[-1].method


def test_pooling_leaves_lone_designs_to_jeffreys_and_many_trials_alone() -> None:
    lone = pooled_rates([[65.0], [95.0]], [7, 0], [10, 0], [1.0, 0.5])
    assert (lone[0].low, lone[0].high) == jeffreys_interval(7, 10)
    assert (lone[1].low, lone[1].high) == (0, 1) and "nothing is known" in lone[1].method

    many = pooled_rates([[65.0], [95.0], [95.0]], [20_000, 70_000, 0], [100_000] * 3, [0.0, 1.0, 1.0])
    assert [rate.value for rate in many] == pytest.approx([0.2, 0.7, 0.0], abs=0.01)
    assert pooled_rates(numpy.zeros((0, 1)), [], [], []) == []
    with pytest.raises(FoldcarError, match="simulated"):
        pooled_rates([[65.0], [95.0]], [1, 1], [2, 2], [0.5])


@pytest.mark.parametrize(("passed", "counted"), [(0, 0), (0, 1), (1, 1), (1, 2), (40, 1000)])
def test_the_likelihood_of_few_or_many_counts_is_that_of_plain_quadrature(passed: int, counted: int) -> None:
    mean, sd = 0.8, 1.3
    of_log_odds = integrate.quad(
        lambda x: special.expit(x) ** passed * special.expit(-x) ** (counted - passed) * stats.norm.pdf(x, mean, sd),
        mean - 10 * sd, mean + 10 * sd, points=[special.logit((passed + 0.5) / (counted + 1))], epsabs=0, limit=500,
    )[0]  # fmt: skip

    _, shares = binomial_normal(*(numpy.array([value], dtype=float) for value in (mean, sd, passed, counted)))

    assert special.logsumexp(shares) == pytest.approx(numpy.log(of_log_odds), abs=0.01)
