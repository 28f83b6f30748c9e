"""Smooth success and pooled rates: the one Gaussian process against scikit-learn's and against importance sampling."""

import math
from typing import Any

import numpy
import pytest
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
