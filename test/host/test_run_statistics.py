"""Comparisons of designs, times to cross, convergence and the smooth model of success."""

import math

import numpy
import pytest
from scipy import integrate, stats

from foldcar.analysis.convergence import advice, chance_of_crossing, convergence, more_for_half_width
from foldcar.analysis.engine_bias import pooled_difference
from foldcar.analysis.intervals import jeffreys_interval
from foldcar.analysis.paired import paired_means, paired_rates
from foldcar.analysis.success_model import CONSTANT, Basis, Fit, SuccessModel, _predictive, success_model
from foldcar.analysis.times import limited_mean, times_to_cross
from foldcar.errors import FoldcarError


def test_paired_rates_are_those_of_the_textbook() -> None:
    # Agresti, Categorical Data Analysis (2002), section 10.1.1: approval by 1600 people, asked twice.
    first, second = (numpy.repeat(column, [794, 150, 86, 570]) for column in ([1, 1, 0, 0], [1, 0, 1, 0]))

    found = paired_rates(first, second)

    assert (found.only_first, found.only_second) == (150, 86)
    assert (found.low, found.high) == pytest.approx((0.02, 0.06), abs=0.005)
    assert found.p_value == pytest.approx(2 * sum(math.comb(236, i) for i in range(87)) / 2**236)


def test_designs_that_never_differ_are_not_proven_alike() -> None:
    found = paired_rates([1, 0, 1, 1], [1, 0, 1, 1])

    assert found.difference == 0 and found.p_value == 1 and found.low < -0.2 and found.high > 0.2
    for bad in (([], []), ([1], [1, 0]), ([2], [0])):
        with pytest.raises(FoldcarError):
            paired_rates(*bad)


def test_difference_of_means_is_that_of_sleep_data() -> None:
    # Student 1908, hours of sleep gained by two drugs: R's t.test(paired) gives 0.70 to 2.46.
    first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
    second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]

    assert paired_means(second, first) == pytest.approx((1.58, 0.7001142, 2.4598858), abs=1e-6)
    with pytest.raises(FoldcarError, match="say nothing"):
        paired_means([1, 2], [0, 1])


def test_times_are_those_of_freireichs_leukaemia_patients() -> None:
    # Freireich et al. 1963, patients on 6-MP: weeks of remission, 12 of 21 censored; the estimate is in every textbook.
    weeks = [6, 6, 6, 7, 10, 13, 16, 22, 23, 6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35]
    found = times_to_cross(weeks, [True] * 9 + [False] * 12, 35)
    published = {6: 0.857, 7: 0.807, 10: 0.753, 13: 0.690, 16: 0.627, 22: 0.538, 23: 0.448}

    for week, fraction in published.items():
        assert found.not_crossed[found.times_s == week] == pytest.approx([fraction], abs=5e-4)
    assert found.median_s == 23
    # R's survival package: restricted mean 23.29, standard error 2.83.
    assert found.restricted_mean_s == pytest.approx(23.29, abs=0.005)
    low, high = found.restricted_mean_interval_s
    assert (high - low) / 2 == pytest.approx(1.96 * 2.83, rel=0.1)


def test_runs_that_cross_at_once_or_never_have_jeffreys_interval() -> None:
    low, high = jeffreys_interval(6, 10)

    found = times_to_cross([0.0] * 6 + [20.0] * 4, [True] * 6 + [False] * 4, 20)

    assert found.restricted_mean_s == pytest.approx(8)
    assert found.restricted_mean_interval_s == pytest.approx((20 * (1 - high), 20 * (1 - low)), abs=0.2)


def test_times_of_many_runs_are_the_t_interval_and_without_a_crossing_say_so() -> None:
    times = numpy.random.default_rng(3).uniform(2, 9, 400)
    mean = stats.ttest_1samp(times, 0).confidence_interval()
    none = times_to_cross([20.0, 20.0], [False, False], 20)

    many = times_to_cross(times, [True] * 400, 20)

    assert many.restricted_mean_s == pytest.approx(times.mean())
    assert many.restricted_mean_interval_s == pytest.approx((mean.low, mean.high), abs=0.05)
    assert none.median_s is None and none.restricted_mean_s == 20 and none.restricted_mean_interval_s[0] < 10
    assert none.low[-1] == 0 and none.high[-1] == 1
    with pytest.raises(FoldcarError, match="limit"):
        times_to_cross([21.0], [True], 20)


@pytest.mark.parametrize(("crossing", "never"), [(60, 40), (100, 0), (2, 8), (0, 10)])
def test_mean_time_from_sums_has_the_interval_of_the_bootstrap(crossing: int, never: int) -> None:
    times = numpy.random.default_rng(1007).gamma(4.0, 1.0, crossing)
    limit_s, runs = 60.0, crossing + never
    drawn = times_to_cross([*times, *[limit_s] * never], [True] * crossing + [False] * never, limit_s)

    mean, low, high = limited_mean(crossing, runs, times.sum(), (times**2).sum(), limit_s)

    assert mean == pytest.approx(drawn.restricted_mean_s)
    width = numpy.ptp(drawn.restricted_mean_interval_s)
    assert (low, high) == pytest.approx(drawn.restricted_mean_interval_s, abs=0.04 * width)
    with pytest.raises(FoldcarError, match="limit"):
        limited_mean(1, 2, 61.0, 61.0**2, limit_s)


def test_convergence_ends_at_the_interval_of_all_runs() -> None:
    results = numpy.random.default_rng(4).random(60) < 0.3
    found = convergence(results)

    assert len(found.environments) == 60
    assert (found.low[-1], found.high[-1]) == pytest.approx(jeffreys_interval(int(results.sum()), 60))
    assert found.low[0] == 0 or found.high[0] == 1


def test_advice_is_the_least_number_of_environments() -> None:
    def half_width(runs: int) -> float:
        low, high = jeffreys_interval(0.7 * runs, runs)
        return (high - low) / 2

    more = more_for_half_width(70, 100, 0.05)

    assert half_width(100 + more) <= 0.05 < half_width(100 + more - 1)
    assert more_for_half_width(70, 100, 0.2) == 0
    start = "70 of 100 passed, 61 to 78 %:"
    assert advice(70, 100, 0.05) == f"{start} about {more} more environments for a half-width of 5 points."
    assert advice(70, 100, 0.2) == f"{start} the half-width is at most 20 points."
    assert "hardly change" in advice(70, 100, 0.05, 0.5) and "not decided" in advice(70, 100, 0.05, 0.75)


def test_chance_of_crossing_is_the_integral_over_the_posterior() -> None:
    # 7 of 10 so far; the rate of 30 is below 60 % if fewer than 11 of 20 more pass.
    expected, _ = integrate.quad(lambda p: stats.binom.cdf(10, 20, p) * stats.beta.pdf(p, 7.5, 3.5), 0, 1)

    assert chance_of_crossing(7, 10, 0.6, 20) == pytest.approx(expected, rel=1e-6)
    assert chance_of_crossing(0, 100, 0.5, 10) == 0


def test_functions_of_spanning_designs_make_up_the_matern_covariance() -> None:
    x = numpy.linspace(0, 1, 11)[:, None]
    functions = Basis(x, (0.3,), 2.0).at(x)[:, 1:]
    r = math.sqrt(5) * numpy.abs(x - x.T) / 0.3

    assert functions @ functions.T == pytest.approx(4 * (1 + r + r**2 / 3) * numpy.exp(-r))


def test_the_band_before_any_run_is_the_priors_also_between_spanning_designs() -> None:
    """A constant and a process of deviation 2: 1.96 sqrt(CONSTANT^2 + 4) log-odds to each side, everywhere."""
    basis = Basis(numpy.array([[0.0], [0.5], [1.0]]), (0.3,), 2.0)
    prior = Fit(basis, 1.0, numpy.zeros(4), numpy.eye(4))
    half = 1.9599640 * math.sqrt(CONSTANT**2 + 4)

    rate, low, high = SuccessModel((prior,), 0.0, numpy.array([65.0]), numpy.array([180.0])).rates([[65], [100], [200]])

    assert rate == pytest.approx(0.5)
    assert numpy.log(high / (1 - high)) == pytest.approx(half) and numpy.log(low / (1 - low)) == pytest.approx(-half)


def test_held_out_designs_of_few_and_of_many_runs_are_scored_by_the_integral() -> None:
    """Log-odds 0.5 with deviation 0.7, and 1 with 1.4, of two designs that do not depend on each other."""
    basis, mean, root = numpy.eye(2), numpy.array([0.5, 1.0]), numpy.diag([0.7, 1.4])
    e = numpy.linspace(-10, 10, 20001)
    for passed, counted in (((3, 9), (10, 10)), ((100, 60), (100, 100)), ((300, 990), (1000, 1000))):
        exact = 0.0
        for k, n, middle, sd in zip(passed, counted, (0.5, 1.0), (0.7, 1.4), strict=True):
            x = middle + sd * e
            logs = k * x - n * numpy.logaddexp(0, x) + stats.norm.logpdf(e)
            exact += logs.max() + math.log(numpy.exp(logs - logs.max()).sum() * (e[1] - e[0]))
        k, n = numpy.array(passed, float), numpy.array(counted, float)
        assert _predictive(basis, mean, root, k, n) == pytest.approx(exact, abs=0.01)


def test_success_model_finds_a_smooth_truth_of_two_parameters() -> None:
    random = numpy.random.default_rng(5)
    grid = numpy.array([(a, b) for a in numpy.linspace(65, 245, 8) for b in numpy.linspace(20, 60, 6)])
    truth = 1 / (1 + numpy.exp(-(3 * numpy.sin(grid[:, 0] / 60) + (grid[:, 1] - 40) / 15)))
    counted = numpy.full(len(grid), 50)

    passed = random.binomial(counted, truth)
    rate, low, high = success_model(grid, passed, counted).rates(grid)

    assert numpy.mean((low <= truth) & (truth <= high)) > 0.85
    # Neighbours help: closer to the truth than each design's own share.
    assert numpy.abs(rate - truth).mean() < 0.8 * numpy.abs(passed / counted - truth).mean()


def test_success_model_of_all_passed_stays_below_one_and_knows_its_range() -> None:
    x = numpy.arange(65.0, 165, 10)[:, None]
    model = success_model(x, numpy.full(10, 5), numpy.full(10, 5))
    rate, low, high = model.rates(x)

    assert numpy.all((low > 0.5) & (low < rate) & (rate < high) & (high < 1))
    with pytest.raises(FoldcarError, match="range"):
        model.rates([[300.0]])
    with pytest.raises(FoldcarError, match="at least 4"):
        success_model([[65.0], [95.0]], [1, 2], [3, 3])


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
    # What varies of the mean with the spread is a part of it that would not be missed by less.
    conditional = (density * m).sum(axis=0) / density.sum(axis=0)
    assert (density.sum(axis=0) * (conditional - mean) ** 2).sum() > 0.02 * found[1]
    # Without any design in both, what was assumed before: 1 of the mean, 1 of the spread.
    assert pooled_difference([3], [4], [0], [0]) == pytest.approx((0, 2), abs=0.06)
