"""Simulation's success smoothed over designs, without trials: log-odds with their covariance.

The log-odds of single designs are noisy, most where nearly all or no runs pass: 98, 99, 100 of 100 are log-odds of 3.7,
4.2, 5.3. So a design's log-odds s are a constant, a smooth function of the parameters and a part of its own,

    s ~ N(0, K),   K = CONSTANT² + strength² Matérn(lengths) + own² I,   passed ~ Binomial(counted, logistic(s)).

The posterior of each candidate (lengths, strength, own) is Laplace's approximation (Rasmussen and Williams 2006,
algorithms 3.1 and 3.2). Candidates are weighted by their evidence. Runs of different designs in one environment are not
independent. If the environments are given, the covariance is therefore the sandwich S - S W S + S M S (Mueller 2013,
doi:10.3982/ECTA9097). S is the posterior's covariance. W is the curvature of the likelihood. M is the sum over
environments of the outer product of the gradients of their log-likelihood.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.statistics.gaussian_process import (
    CONSTANT,
    STRENGTHS,
    Matern,
    evidence_weights,
    farthest_first_indices,
    lengths_to_try,
    unit_range,
)

# Candidates for the standard deviation, in log-odds, of the part of each design alone.
OWN = (0.0, 0.3, 1.0)
# Fewer designs than this are not smoothed.
MIN_DESIGNS = 4
# With fewer environments the dependence of runs cannot be estimated.
MIN_ENVIRONMENTS = 5
# Largest number of designs that are fitted; the others are predicted from them. The work grows with its cube.
MAX_DESIGNS = 150
# Principal directions of the covariance that are kept: the largest number, and the least variance of one.
MAX_DIRECTIONS, MIN_VARIANCE = 60, 1e-4
NEWTON_STEPS, TOLERANCE = 50, 1e-9


@dataclass(frozen=True)
class SmoothedSimulation:
    """Log-odds of simulated success: ``mean`` (d,), and the covariance ``columns`` columns^T + diag(``rest``).

    ``columns`` (d, r) are principal directions, shared by designs; ``rest`` (d,) is each design's own variance.
    """

    mean: NDArray[Any]
    columns: NDArray[Any]
    rest: NDArray[Any]

    def subset(self, designs: NDArray[Any]) -> "SmoothedSimulation":
        """Return the part for the designs with these indices."""
        return SmoothedSimulation(self.mean[designs], self.columns[designs], self.rest[designs])

    @property
    def variance(self) -> NDArray[Any]:
        """The variance (d,) of each design's log-odds."""
        return numpy.asarray((self.columns**2).sum(axis=1) + self.rest)

    def rates(self, confidence: float = 0.95) -> NDArray[Any]:
        """Return the rate of each design with its credible interval (d, 3): rate, low, high, 0 to 1."""
        from scipy.special import ndtri

        half_width = ndtri((1 + confidence) / 2) * numpy.sqrt(self.variance)
        log_odds = numpy.column_stack([self.mean, self.mean - half_width, self.mean + half_width])
        return numpy.asarray(1 / (1 + numpy.exp(-log_odds)))


def smoothed_simulation(
    parameters: NDArray[Any], runs: NDArray[Any], environments: NDArray[Any] | None = None
) -> SmoothedSimulation:
    """Smooth the simulated success of designs over their parameters, as the file's head describes.

    ``parameters`` are (d, k), ``runs`` (d, 2): numbers passed and in all, at least one. ``environments`` (d, e) are 1
    where a design's run in an environment passed, 0 where it failed, NaN without a run. Of more than MAX_DESIGNS designs,
    MAX_DESIGNS spread over the range are fitted. The others follow from the most probable candidate and their own runs.
    """
    passed, counted = runs.T
    if len(parameters) < MIN_DESIGNS or not parameters.size or not (numpy.ptp(parameters, axis=0) > 0).all():
        # Half a run is added to both outcomes (Haldane 1956), so that log-odds are finite if all or no runs passed.
        success, failure = passed + 0.5, counted - passed + 0.5
        variances = 1 / success + 1 / failure
        return SmoothedSimulation(numpy.log(success / failure), numpy.zeros((len(variances), 0)), variances)
    scaled = unit_range(parameters)
    chosen = farthest_first_indices(scaled, MAX_DESIGNS) if len(scaled) > MAX_DESIGNS else numpy.arange(len(scaled))
    chosen_environments = None if environments is None else environments[chosen]
    priors = [
        _Prior(scaled, lengths, strength, own)
        for lengths, strength, own in product(lengths_to_try(parameters, passed, counted), STRENGTHS, OWN)
    ]
    candidates = [
        _posterior(prior.covariance(chosen), passed[chosen], counted[chosen], chosen_environments) for prior in priors
    ]
    weights = evidence_weights([candidate.evidence for candidate in candidates])
    if len(chosen) < len(scaled):
        best = int(weights.argmax())
        return _extrapolated(priors[best], candidates[best], chosen, passed, counted)
    mean = weights @ numpy.array([candidate.mode for candidate in candidates])
    spread = numpy.zeros((len(mean), len(mean)))
    for weight, candidate in zip(weights.tolist(), candidates, strict=True):
        offset = candidate.mode - mean
        spread += weight * (candidate.covariance + numpy.outer(offset, offset))
    return SmoothedSimulation(mean, *_directions(spread))


@dataclass(frozen=True)
class _Prior:
    """A candidate prior: lengths and strength of the smooth part, standard deviation of each design's ``own`` part.

    ``scaled`` (d, k) are the parameters of all designs, 0 to 1.
    """

    scaled: NDArray[Any]
    lengths: tuple[float, ...]
    strength: float
    own: float

    def covariance(self, designs: NDArray[Any]) -> NDArray[Any]:
        """Return the covariance (n, n) of designs with indices (n,)."""
        return self.between(designs, designs) + self.own**2 * numpy.eye(len(designs))

    def between(self, first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
        """Return the covariance (n, m) between designs with indices (n,) and (m,), without their own parts."""
        process = Matern(self.scaled, self.lengths).covariance(self.scaled[first], self.scaled[second])
        return CONSTANT**2 + self.strength**2 * process


@dataclass(frozen=True)
class _Posterior:
    """Laplace's approximation for designs' log-odds: mode (d,), covariance (d, d), log evidence."""

    mode: NDArray[Any]
    covariance: NDArray[Any]
    evidence: float


def _extrapolated(
    prior: _Prior, posterior: _Posterior, chosen: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]
) -> SmoothedSimulation:
    """Predict all designs from the posterior of those with the indices ``chosen``, and from their own runs.

    First by regression on the chosen designs (kriging); then each other design is conditioned on its own runs.
    """
    all_designs = numpy.arange(len(prior.scaled))
    # Prior covariances (designs, chosen designs).
    across = prior.between(all_designs, chosen)
    weights = numpy.linalg.solve(prior.covariance(chosen), across.T).T
    mean = weights @ posterior.mode
    columns = weights @ _directions(posterior.covariance)[0]
    residual = CONSTANT**2 + prior.strength**2 + prior.own**2 - (weights * across).sum(axis=1)
    rest = numpy.maximum(residual, 1e-6)
    # Condition each of the other designs on its own runs, by Newton's method with steps of at most 2.
    others = numpy.setdiff1d(all_designs, chosen)
    prior_mean, variance, log_odds = (
        mean[others],
        (columns[others] ** 2).sum(axis=1) + rest[others],
        mean[others].copy(),
    )
    for _ in range(NEWTON_STEPS):
        rate = 1 / (1 + numpy.exp(-log_odds))
        slope = passed[others] - counted[others] * rate - (log_odds - prior_mean) / variance
        log_odds = log_odds + numpy.clip(slope / (counted[others] * rate * (1 - rate) + 1 / variance), -2, 2)
    rate = 1 / (1 + numpy.exp(-log_odds))
    # The factor by which its own runs reduce a design's variance.
    shrinkage = 1 / (1 + variance * counted[others] * rate * (1 - rate))
    mean[others], rest[others] = log_odds, shrinkage * rest[others]
    columns[others] *= numpy.sqrt(shrinkage)[:, None]
    mean[chosen] = posterior.mode
    columns[chosen], rest[chosen] = _directions(posterior.covariance)
    return SmoothedSimulation(mean, columns, rest)


def _directions(covariance: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Split a covariance (d, d) into principal ``columns`` (d, r) and remaining variances (d,).

    columns columns^T + diag(variances) is about the covariance, with its exact diagonal.
    """
    values, vectors = numpy.linalg.eigh(covariance)
    kept = numpy.flatnonzero(values > max(MIN_VARIANCE, 1e-6 * values[-1]))[::-1][:MAX_DIRECTIONS]
    columns = vectors[:, kept] * numpy.sqrt(values[kept])
    return columns, numpy.maximum(numpy.diag(covariance) - (columns**2).sum(axis=1), 0)


def _posterior(
    prior: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any], environments: NDArray[Any] | None
) -> _Posterior:
    """Approximate the posterior of log-odds s with prior covariance K = ``prior`` (d, d) by Laplace's method.

    Rasmussen and Williams 2006, algorithm 3.1, in its symbols: a = K⁻¹ s, so that K needs no inverse. If
    ``environments`` (d, e) are given, the covariance is the sandwich of the file's head.
    """
    identity = numpy.eye(len(prior))
    a = numpy.zeros(len(prior))

    def log_density(a: NDArray[Any]) -> float:
        s = prior @ a
        return float(passed @ s - counted @ numpy.logaddexp(0, s) - a @ s / 2)

    value = log_density(a)
    for _ in range(NEWTON_STEPS):
        s = prior @ a
        rate = 1 / (1 + numpy.exp(-s))
        curvature = counted * rate * (1 - rate)
        root = numpy.sqrt(curvature)
        lower = numpy.linalg.cholesky(identity + root[:, None] * prior * root)
        b = curvature * s + passed - counted * rate
        step = b - root * _solve(lower, root * (prior @ b)) - a
        size = 1.0
        # Halve a step that overshoots.
        while (new := log_density(a + size * step)) < value - TOLERANCE and size > 1e-4:
            size /= 2
        a, gain, value = a + size * step, new - value, new
        if abs(gain) < TOLERANCE:
            break
    s = prior @ a
    rate = 1 / (1 + numpy.exp(-s))
    curvature = counted * rate * (1 - rate)
    root = numpy.sqrt(curvature)
    lower = numpy.linalg.cholesky(identity + root[:, None] * prior * root)
    covariance = prior - prior @ (root[:, None] * _solve(lower, root[:, None] * prior))
    evidence = value - float(numpy.log(numpy.diagonal(lower)).sum())
    if environments is not None and environments.shape[1] >= MIN_ENVIRONMENTS:
        gradients = numpy.where(numpy.isnan(environments), 0.0, environments - rate[:, None])
        gradients = gradients - gradients.mean(axis=1, keepdims=True)
        changes = covariance @ gradients
        covariance = covariance - covariance @ (curvature[:, None] * covariance) + changes @ changes.T
    return _Posterior(s, covariance, evidence)


def _solve(lower: NDArray[Any], values: NDArray[Any]) -> NDArray[Any]:
    """Return (L L')⁻¹ ``values`` for the Cholesky factor L = ``lower``."""
    from scipy.linalg import cho_solve

    return numpy.asarray(cho_solve((lower, True), values))
