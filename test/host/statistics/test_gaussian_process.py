"""Smooth success and pooled rates: the one Gaussian process against scikit-learn's and against importance sampling."""

import math
from itertools import product
from typing import Any

import numpy
import pytest
from foldcar.statistics.built_cars import PRIOR, RANGES, SPREADS, BuiltCars
from foldcar.statistics.built_cars import SLOPE as CAR_SLOPE
from foldcar.statistics.pooled_bias import ALONE, LENGTHS, SLOPE, SMOOTH, pooled_bias
from foldcar.statistics.pooled_bias import CONSTANT as COMMON
from foldcar.statistics.smoothed_simulation import smoothed_simulation
from scipy import stats
from sklearn.gaussian_process import GaussianProcessClassifier
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from foldcar.errors import FoldcarError
from foldcar.statistics import gaussian_process
from foldcar.statistics.gaussian_process import (
    CONSTANT,
    Candidate,
    Factors,
    SuccessModel,
    binomial,
    laplace,
    success_model,
)


def expit(log_odds: Any) -> Any:
    return 1 / (1 + numpy.exp(-log_odds))


def test_mode_and_evidence_are_those_of_scikit_learns_classifier() -> None:
    """Which knows trials one by one: a design with 3 of 5 passed is there five times."""
    x = numpy.array([[0.0, 0.3], [0.2, 0.9], [0.5, 0.5], [1.0, 0.0]])
    passed, counted = numpy.array([3, 0, 4, 1]), numpy.array([5, 4, 4, 1])
    design_of_run = numpy.repeat(numpy.arange(4), counted)
    outcomes = numpy.concatenate([numpy.arange(n) < k for k, n in zip(passed, counted, strict=True)]).astype(int)
    kernel = ConstantKernel(1.7**2) * Matern([0.3, 0.8], nu=2.5)
    there = GaussianProcessClassifier(kernel, optimizer=None, max_iter_predict=1000).fit(x[design_of_run], outcomes)
    process = gaussian_process.Matern(x, (0.3, 0.8))
    functions = 1.7 * process.functions(x)

    posterior = laplace(functions, numpy.zeros(4), binomial(passed.astype(float), counted.astype(float)))

    assert functions @ functions.T == pytest.approx(kernel(x))
    assert expit(functions @ posterior.mode)[design_of_run] == pytest.approx(there.base_estimator_.pi_, abs=1e-5)
    assert posterior.evidence == pytest.approx(there.log_marginal_likelihood_value_, abs=1e-6)
    # The covariance at the mode is (K^-1 + W)^-1.
    rate = expit(functions @ posterior.mode)
    covariance = numpy.linalg.inv(numpy.linalg.inv(kernel(x)) + numpy.diag(counted * rate * (1 - rate)))
    assert functions @ posterior.root @ posterior.root.T @ functions.T == pytest.approx(covariance, abs=1e-6)


def sampled(x: Any, runs: Any, trials: Any) -> tuple[Any, Any, Any]:
    """Draws of log-odds (kernels, draws, designs) from the prior, the kernels, and the trials' likelihoods.

    These (kernels, ranges, draws) are if the spread of all cars is in one of the ranges, times that range's probability.
    """
    successes, failures = runs[:, 0] + 0.5, runs[:, 1] - runs[:, 0] + 0.5
    log_odds, errors = numpy.log(successes / failures), 1 / successes + 1 / failures
    shares = (x - x.min(axis=0)) / numpy.where(numpy.ptp(x, axis=0) > 0, numpy.ptp(x, axis=0), 1)
    # Three designs are not smoothed; the slope turns around the driven ones.
    away = log_odds - log_odds[trials[:, 1] > 0].mean()
    common = COMMON**2 + SLOPE**2 * numpy.outer(away, away) + numpy.diag(errors)
    kernels = [
        common + smooth**2 * Matern(length, nu=2.5)(shares) + alone**2 * numpy.eye(len(x))
        for length, smooth, alone in product(LENGTHS, SMOOTH, ALONE)
    ]
    random = numpy.random.default_rng(1)
    draws = numpy.array([random.multivariate_normal(log_odds, kernel, 20_000) for kernel in kernels])
    # Trials are of one car of each design, which is one of many.
    grid, z = numpy.linspace(-12, 12, 481)[:, None, None], stats.norm.ppf((numpy.arange(50) + 0.5) / 50)[:, None]
    likelihood = []
    for range_ in RANGES:
        chances, within = numpy.zeros((len(grid), len(trials))), PRIOR[numpy.isin(SPREADS, range_)]
        for spread, weight in zip(range_, within, strict=True):
            rates = expit(math.sqrt(1 + CAR_SLOPE * spread**2) * grid + spread * z)
            chances += weight / within.sum() * stats.binom.pmf(trials[:, 0], trials[:, 1], rates).mean(axis=1)
        by_design = [numpy.interp(draws[..., at], grid[:, 0, 0], chances[:, at]) for at in range(len(trials))]
        likelihood.append(within.sum() * numpy.prod(by_design, axis=0))
    return draws, numpy.stack(likelihood, axis=1), kernels


def test_pooled_rates_and_draws_are_those_of_importance_sampling() -> None:
    x = numpy.array([[60.0, 1.0], [100.0, 1.0], [120.0, 5.0]])
    runs, trials = numpy.array([[20, 100], [90, 100], [80, 100]]), numpy.array([[1, 10], [7, 9], [0, 0]])
    draws, likelihood, kernels = sampled(x, runs, trials)

    bias = pooled_bias(x, runs, trials)

    for candidate, kernel in zip(bias.candidates[:: len(RANGES)], kernels, strict=True):
        assert candidate.common @ candidate.common.T + numpy.diag(candidate.own**2) == pytest.approx(kernel, abs=1e-6)
    # How probable the trials are under each kernel, all alike beforehand, and range of spreads.
    evidence = likelihood.mean(axis=2).ravel()
    assert bias.weights == pytest.approx(evidence / evidence.sum(), rel=0.15)
    flat, masses = draws.reshape(-1, 3), likelihood.sum(axis=1).ravel() / likelihood.sum()
    for design, rate in enumerate(bias.rates()):
        order = numpy.argsort(flat[:, design])
        expected = flat[order, design][numpy.searchsorted(masses[order].cumsum(), [0.025, 0.5, 0.975])]
        ends = numpy.array([rate.low, rate.value, rate.high])
        assert numpy.log(ends / (1 - ends)) == pytest.approx(expected, abs=0.15)
    # Draws are normal about the mode.
    joint = bias.draws(40_000, 3)
    assert joint.mean(axis=0) == pytest.approx(masses @ expit(flat), abs=0.03)
    exact = numpy.cov(expit(flat).T, aweights=masses)
    assert numpy.cov(joint.T) == pytest.approx(exact, abs=0.01)
    assert numpy.array_equal(bias.draws(50, 1), bias.draws(50, 1))


def test_many_designs_are_spanned_and_keep_the_variance_between() -> None:
    x = numpy.arange(300.0)[:, None]
    runs, trials = numpy.full((300, 2), 100), numpy.zeros((300, 2))
    trials[[10, 290]] = 6, 10

    bias = pooled_bias(x, runs, trials)

    simulation = smoothed_simulation(x, runs)
    away = simulation.mean - simulation.mean[[10, 290]].mean()
    every = bias.candidates[:: len(RANGES)]
    for candidate, (length, smooth, alone) in zip(every, product(LENGTHS, SMOOTH, ALONE), strict=True):
        total = (candidate.common**2).sum(axis=1) + candidate.own**2
        assert total == pytest.approx(COMMON**2 + SLOPE**2 * away**2 + simulation.variance + smooth**2 + alone**2)
        # Neighbours two steps away are as close as the process says.
        shared = COMMON**2 + SLOPE**2 * away[100] * away[102] + simulation.columns[100] @ simulation.columns[102]
        near = (candidate.common[100] * candidate.common[102]).sum() - shared
        assert near == pytest.approx(smooth**2 * Matern(length, nu=2.5)([[0.0]], [[2 / 299]])[0, 0], rel=0.01)


def test_smoothed_simulation_is_the_posterior_of_a_dense_process() -> None:
    """Against scikit-learn's Laplace approximation of the likeliest candidate, runs one by one."""
    x = numpy.linspace(0, 1, 12)[:, None]
    counted = numpy.full(12, 20)
    passed = numpy.array([0, 2, 5, 9, 14, 18, 20, 20, 20, 19, 20, 20])
    smoothed = smoothed_simulation(x, numpy.column_stack([passed, counted]).astype(float))
    design_of_run = numpy.repeat(numpy.arange(12), counted)
    ended = numpy.concatenate([numpy.arange(20) < k for k in passed]).astype(int)
    kernels = [
        ConstantKernel(16.0)
        + ConstantKernel(strength**2) * Matern(length, nu=2.5)
        + ConstantKernel(own**2) * Matern(1e-3)
        for length in (0.1, 0.2, 0.4, 0.8)
        for strength in (1.5, 5.0)
        for own in (1e-3, 0.3, 1.0)
    ]
    fitted = [GaussianProcessClassifier(kernel, optimizer=None).fit(x[design_of_run], ended) for kernel in kernels]
    evidence = numpy.array([regressor.log_marginal_likelihood_value_ for regressor in fitted])
    weights = numpy.exp(evidence - evidence.max())
    weights /= weights.sum()
    modes = []
    for regressor in fitted:
        rate = regressor.base_estimator_.pi_[numpy.concatenate([[0], counted.cumsum()[:-1]])]
        modes.append(numpy.log(rate / (1 - rate)))
    assert smoothed.mean == pytest.approx(weights @ numpy.array(modes), abs=0.02)


def test_equal_runs_beside_each_other_mean_equal_success() -> None:
    """98, 99 and 100 of 100 in turn: single runs decide nothing."""
    x = numpy.arange(30.0)[:, None]
    runs = numpy.column_stack([98 + numpy.arange(30) % 3, numpy.full(30, 100)]).astype(float)
    trials = numpy.zeros((30, 2))
    trials[[4, 20]] = [[7, 10], [3, 12]]
    rates = numpy.array([rate.value for rate in pooled_bias(x, runs, trials).rates()])
    undriven = numpy.setdiff1d(numpy.arange(30), [3, 4, 19, 20])
    assert numpy.abs(numpy.diff(rates))[undriven[undriven < 29]].max() < 0.04


def test_many_designs_are_smoothed_from_some_and_their_own_runs() -> None:
    x = numpy.arange(400.0)[:, None]
    true = 3 * numpy.sin(x[:, 0] / 60)
    random = numpy.random.default_rng(2)
    runs = numpy.column_stack([random.binomial(50, expit(true)), numpy.full(400, 50)]).astype(float)
    smoothed = smoothed_simulation(x, runs)
    away = (smoothed.mean - true) / numpy.sqrt(smoothed.variance)
    assert numpy.sqrt(((expit(smoothed.mean) - expit(true)) ** 2).mean()) < 0.03
    assert (numpy.abs(away) < 1.96).mean() > 0.88


def test_environments_that_designs_share_widen_the_covariance() -> None:
    x, random = numpy.arange(12.0)[:, None], numpy.random.default_rng(3)
    # Every environment is easy or hard for all designs alike.
    passed = numpy.repeat((random.random(30) < 0.7)[None], 12, axis=0).astype(float)
    runs = numpy.column_stack([passed.sum(axis=1), numpy.full(12, 30)])
    alone, shared = smoothed_simulation(x, runs), smoothed_simulation(x, runs, passed)
    assert shared.mean == pytest.approx(alone.mean)
    # All designs together know no more than one does: about 30 runs, not 360.
    assert (shared.variance > 2 * alone.variance).all()
    assert shared.variance == pytest.approx(1 / (30 * 0.7 * 0.3), rel=0.5)


def test_pooling_leaves_many_trials_alone() -> None:
    trials = [[20_000, 100_000], [70_000, 100_000], [0, 100_000]]
    alike = [BuiltCars(*numpy.array([[k], [n], [0.0]]), numpy.eye(len(SPREADS))[0]) for k, n in trials]
    many = pooled_bias([[65.0], [95.0], [95.0]], [[0, 100], [100, 100], [100, 100]], trials, alike).rates()
    assert [rate.value for rate in many] == pytest.approx([0.2, 0.7, 0.0], abs=0.01)
    assert pooled_bias(numpy.zeros((0, 1)), numpy.zeros((0, 2)), numpy.zeros((0, 2))).rates() == []
    good = [[1, 2]] * 2
    for runs, counts in (([[1, 2]], good), ([[1, 2], [0, 0]], good), (good, [[3, 2]] * 2), (good, [[-0.5, 2]] * 2)):
        with pytest.raises(FoldcarError, match="pooled rates need"):
            pooled_bias([[65.0], [95.0]], runs, counts)


def test_the_band_before_any_run_is_the_priors_also_between_spanning_designs() -> None:
    """A constant and a process of deviation 2: 1.96 sqrt(CONSTANT^2 + 4) log-odds to each side, everywhere."""
    process = gaussian_process.Matern(numpy.array([[0.0], [0.5], [1.0]]), (0.3,))
    prior = Candidate(process, 2.0, 1.0, Factors(numpy.zeros(4), numpy.eye(4), 0.0))
    half = 1.9599640 * math.sqrt(CONSTANT**2 + 4)

    rate, low, high = SuccessModel((prior,), numpy.array([65.0]), numpy.array([180.0])).rates([[65], [100], [200]])

    assert rate == pytest.approx(0.5)
    assert numpy.log(high / (1 - high)) == pytest.approx(half) and numpy.log(low / (1 - low)) == pytest.approx(-half)


def test_success_model_finds_a_smooth_truth_of_two_parameters() -> None:
    random = numpy.random.default_rng(5)
    grid = numpy.array([(a, b) for a in numpy.linspace(65, 245, 8) for b in numpy.linspace(20, 60, 6)])
    truth = expit(3 * numpy.sin(grid[:, 0] / 60) + (grid[:, 1] - 40) / 15)
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

    assert numpy.all((low > 0.45) & (low < rate) & (rate < high) & (high < 1))
    with pytest.raises(FoldcarError, match="range"):
        model.rates([[300.0]])
    with pytest.raises(FoldcarError, match="at least 4"):
        success_model([[65.0], [95.0]], [1, 2], [3, 3])
