"""The posterior of a calibration against plain quadrature: cars, draws."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.special import expit, logsumexp
from scipy.stats import binom, norm

from foldcar.inference.calibration.posterior import DISCREPANCY, outcomes, sample_posterior


def grid() -> tuple[Any, Any, Any, Any]:
    """Score, discrepancy's sd and the log-likelihood of 2/10 and 9/10 at logits 1 + 2 z and 2, by plain quadrature."""
    z, t, e = (np.linspace(-5, 5, n) for n in (201, 81, 301))
    tau = np.asarray(DISCREPANCY.value(t))
    weight = norm.pdf(e) / norm.pdf(e).sum()
    first, second = 1 + 2 * z[:, None, None] + tau[:, None] * e, 2 + tau[:, None] * e
    likelihood = (binom.pmf(2, 10, expit(first)) @ weight) * (binom.pmf(9, 10, expit(second)) @ weight)
    prior = norm.pdf(z)[:, None] * norm.pdf(t)
    return z, tau, likelihood, prior / prior.sum()


def test_the_posterior_is_that_of_plain_quadrature() -> None:
    z, tau, likelihood, prior = grid()
    exact = likelihood * prior
    evidence = exact.sum()
    mean = (exact.sum(axis=1) * z).sum() / evidence
    sd = math.sqrt((exact.sum(axis=1) * z**2).sum() / evidence - mean**2)
    counts = np.array([2.0, 9.0]), np.array([10.0, 10.0])

    def likelihood(scores: Any, tau: Any) -> Any:
        logits = np.column_stack([1 + 2 * scores[:, 0], np.full(len(scores), 2.0)])
        return outcomes(logits, *counts, np.arange(2), tau[:, None, None] ** 2 * np.eye(2)).evidence

    found = sample_posterior(likelihood, 1, seed=3)

    assert found.scores.mean() == pytest.approx(mean, abs=5 * sd / math.sqrt(500))
    assert found.scores.std() == pytest.approx(sd, rel=0.15)
    assert found.discrepancy.mean() == pytest.approx((exact.sum(axis=0) * tau).sum() / evidence, rel=0.1)
    again = sample_posterior(likelihood, 1, seed=3)
    assert np.array_equal(found.scores, again.scores)


@pytest.mark.parametrize(("passed", "counted"), [(0, 10), (7, 10), (890, 1000)])
def test_the_likelihood_of_few_and_of_many_trials_is_the_integral_over_the_offset(passed: int, counted: int) -> None:
    logit, tau = (one.ravel() for one in np.meshgrid(np.linspace(-2, 3, 6), [0.0, 0.2, 0.7, 1.5], indexing="ij"))
    k, n = np.full(1, float(passed)), np.full(1, float(counted))
    e = np.linspace(-40, 40, 20001)

    found = outcomes(logit[:, None], k, n, np.zeros(1, dtype=int), tau[:, None, None] ** 2)
    mean, variance = found.new_car(tau[:, None] ** 2, tau**2)

    ways = binom.logpmf(passed, counted, 0.5) + counted * math.log(2)
    for index, (centre, sd) in enumerate(zip(logit, tau, strict=True)):
        masses = binom.logpmf(passed, counted, expit(centre + sd * e)) + norm.logpdf(e)
        exact = logsumexp(masses) + np.log(e[1] - e[0])
        # Laplace's method: a few hundredths where no trial, or every trial, passed.
        assert found.evidence[index] + ways == pytest.approx(exact, abs=0.06)
        # Another car that shares all of the offset has what is known of it.
        weights = np.exp(masses - logsumexp(masses))
        middle = weights @ (sd * e)
        spread = math.sqrt(weights @ (sd * e - middle) ** 2)
        assert mean[index] == pytest.approx(middle, abs=0.3 * spread + 1e-9)
        assert math.sqrt(variance[index]) == pytest.approx(spread, rel=0.15, abs=1e-9)


def test_two_cars_of_a_design_share_what_is_not_their_own() -> None:
    """0 of 4 and 4 of 4 with a shared offset and parts of their own: evidence and what a third car has, by quadrature."""
    shared, own = 0.8, 1.1
    covariance = np.full((1, 2, 2), shared**2) + own**2 * np.eye(2)
    counts = np.array([0.0, 3.0]), np.array([4.0, 4.0])

    found = outcomes(np.array([[0.4, 0.4]]), *counts, np.arange(2), covariance)
    mean, variance = found.new_car(np.full((1, 2), shared**2), np.array([shared**2]))

    z = np.linspace(-7, 7, 281)
    weight = norm.pdf(z) / norm.pdf(z).sum()
    rates = expit(0.4 + shared * z[:, None] + own * z)
    of_shared = np.prod([(rates**k * (1 - rates) ** (n - k)) @ weight for k, n in zip(*counts, strict=True)], axis=0)
    assert found.evidence[0] == pytest.approx(math.log(of_shared @ weight), abs=0.08)
    masses = of_shared * weight / (of_shared @ weight)
    middle = shared * masses @ z
    assert mean[0] == pytest.approx(middle, abs=0.06)
    assert math.sqrt(variance[0]) == pytest.approx(math.sqrt(masses @ (shared * z - middle) ** 2), rel=0.05)


def test_draws_of_many_sharp_parameters_are_told_apart() -> None:
    """Each of six parameters has a design of its own; moves of the prior's size would leave copies of a few draws."""
    counts = np.full(6, 800.0), np.full(6, 1000.0), np.arange(6)

    def likelihood(scores: Any, tau: Any) -> Any:
        return outcomes(3 * scores, *counts, tau[:, None, None] ** 2 * np.eye(6)).evidence

    found = sample_posterior(likelihood, 6, seed=1, particles=400)

    assert len(np.unique(found.scores[:, 0])) > 0.9 * 400
    # Built cars pass 80 %; the discrepancy leaves tau / 3 of each score open, which the prior makes smaller.
    share = 1 / (1 + (found.discrepancy / 3) ** 2)
    assert found.scores.mean(axis=0) == pytest.approx((share * math.log(4) / 3).mean(), abs=0.04)
    sd = np.sqrt((share * found.discrepancy**2).mean()) / 3
    assert found.scores.std(axis=0) == pytest.approx(np.full(6, sd), rel=0.2)
