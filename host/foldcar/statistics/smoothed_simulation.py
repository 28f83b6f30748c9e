"""Simulation's success smoothed over designs, before trials say anything: its log-odds with their covariance.

The counts of single designs err by chance, most where nearly all or no runs pass: 98, 99, 100 of 100 are log-odds of 3.7,
4.2, 5.3. So a design's log-odds s are a constant, a smooth function of the parameters and a part of its own,

    s ~ N(0, K),   K = CONSTANT² + strength² Matérn(lengths) + own² I,   passed ~ Binomial(counted, logistic(s)).

The posterior of each candidate of lengths, strength and own is Laplace's approximation (Rasmussen and Williams 2006,
algorithms 3.1 and 3.2); candidates are weighted by their evidence. Runs of different designs in one environment depend on
each other: where they are known, the covariance is the sandwich S - S W S + S M S (Mueller 2013, doi:10.3982/ECTA9097), S
the posterior's covariance, W the curvature of the likelihood, M the sum over environments of the outer product of the
gradients of their log-likelihood.
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
    lengths_to_try,
    shares_of,
    spread_places,
    unit_range,
)

# Standard deviation, in log-odds, of what is one design's own in simulation.
OWN = (0.0, 0.3, 1.0)
# Fewer designs are not smoothed.
MIN_DESIGNS = 4
# Fewer environments do not tell how runs depend on each other.
MIN_ENVIRONMENTS = 5
# More designs than these follow from them: the work grows with the cube of their number.
MAX_DESIGNS = 150
# Directions in which log-odds are uncertain together: at most so many, of at least this variance.
MAX_DIRECTIONS, MIN_VARIANCE = 60, 1e-4
NEWTON_STEPS, TOLERANCE = 50, 1e-9


@dataclass(frozen=True)
class SmoothedSimulation:
    """Log-odds of simulation's success: ``mean`` (d,), and a covariance ``columns`` columns^T + diag(``rest``).

    ``columns`` (d, r) are directions in which designs are uncertain together, ``rest`` (d,) each one's own variance.
    """

    mean: NDArray[Any]
    columns: NDArray[Any]
    rest: NDArray[Any]

    def of(self, designs: NDArray[Any]) -> "SmoothedSimulation":
        """The same of the designs at these places only."""
        return SmoothedSimulation(self.mean[designs], self.columns[designs], self.rest[designs])

    @property
    def variance(self) -> NDArray[Any]:
        """The variance (d,) of each design's log-odds."""
        return numpy.asarray((self.columns**2).sum(axis=1) + self.rest)

    def rates(self, confidence: float = 0.95) -> NDArray[Any]:
        """The rate of each design with its credible interval (d, 3): rate, low, high, 0 to 1."""
        from scipy.special import ndtri

        reach = ndtri((1 + confidence) / 2) * numpy.sqrt(self.variance)
        ends = numpy.column_stack([self.mean, self.mean - reach, self.mean + reach])
        return numpy.asarray(1 / (1 + numpy.exp(-ends)))


def smoothed_simulation(
    parameters: NDArray[Any], runs: NDArray[Any], environments: NDArray[Any] | None = None
) -> SmoothedSimulation:
    """Of designs with ``parameters`` (d, k) and ``runs`` (d, 2): passed and all, at least one.

    ``environments`` (d, e) are 1 where a design's run in an environment passed, 0 where not, NaN without a run.
    Of more than MAX_DESIGNS designs some that are spread over the range are smoothed, by the most probable candidate. The
    others follow from these and from their own runs.
    """
    passed, counted = runs.T
    if len(parameters) < MIN_DESIGNS or not parameters.size or not (numpy.ptp(parameters, axis=0) > 0).all():
        # Half a run is added to both outcomes (Haldane 1956), so that log-odds are finite where all or no runs passed.
        success, failure = passed + 0.5, counted - passed + 0.5
        errors = 1 / success + 1 / failure
        return SmoothedSimulation(numpy.log(success / failure), numpy.zeros((len(errors), 0)), errors)
    scaled = unit_range(parameters)
    chosen = spread_places(scaled, MAX_DESIGNS) if len(scaled) > MAX_DESIGNS else numpy.arange(len(scaled))
    seen = None if environments is None else environments[chosen]
    priors = [
        _Prior(scaled, lengths, strength, own)
        for lengths, strength, own in product(lengths_to_try(parameters, passed, counted), STRENGTHS, OWN)
    ]
    candidates = [_posterior(prior.covariance(chosen), passed[chosen], counted[chosen], seen) for prior in priors]
    weights = shares_of([candidate.evidence for candidate in candidates])
    if len(chosen) < len(scaled):
        best = int(weights.argmax())
        return _extended(priors[best], candidates[best], chosen, passed, counted)
    mean = weights @ numpy.array([candidate.mode for candidate in candidates])
    spread = numpy.zeros((len(mean), len(mean)))
    for weight, candidate in zip(weights.tolist(), candidates, strict=True):
        away = candidate.mode - mean
        spread += weight * (candidate.covariance + numpy.outer(away, away))
    return SmoothedSimulation(mean, *_directions(spread))


@dataclass(frozen=True)
class _Prior:
    """One candidate: lengths and strength of the smooth part, standard deviation of each design's own."""

    scaled: NDArray[Any]
    lengths: tuple[float, ...]
    strength: float
    own: float

    def covariance(self, designs: NDArray[Any]) -> NDArray[Any]:
        """Of designs (n,) with each other (n, n)."""
        return self.between(designs, designs) + self.own**2 * numpy.eye(len(designs))

    def between(self, some: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
        """Of designs (n,) with other ones (m,): (n, m)."""
        process = Matern(self.scaled, self.lengths).covariance(self.scaled[some], self.scaled[others])
        return CONSTANT**2 + self.strength**2 * process


@dataclass(frozen=True)
class _Posterior:
    mode: NDArray[Any]
    covariance: NDArray[Any]
    evidence: float


def _extended(
    prior: _Prior, known: _Posterior, chosen: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]
) -> SmoothedSimulation:
    """All designs from the posterior of those at ``chosen``."""
    everything = numpy.arange(len(prior.scaled))
    across = prior.between(everything, chosen)
    shares = numpy.linalg.solve(prior.covariance(chosen), across.T).T
    mean = shares @ known.mode
    columns = shares @ _directions(known.covariance)[0]
    left = CONSTANT**2 + prior.strength**2 + prior.own**2 - (shares * across).sum(axis=1)
    rest = numpy.maximum(left, 1e-6)
    # The runs of the other designs, each for itself.
    own = numpy.setdiff1d(everything, chosen)
    before, variance, s = mean[own], (columns[own] ** 2).sum(axis=1) + rest[own], mean[own].copy()
    for _ in range(NEWTON_STEPS):
        rate = 1 / (1 + numpy.exp(-s))
        slope = passed[own] - counted[own] * rate - (s - before) / variance
        s = s + numpy.clip(slope / (counted[own] * rate * (1 - rate) + 1 / variance), -2, 2)
    rate = 1 / (1 + numpy.exp(-s))
    kept = 1 / (1 + variance * counted[own] * rate * (1 - rate))
    mean[own], rest[own] = s, kept * rest[own]
    columns[own] *= numpy.sqrt(kept)[:, None]
    exact = _directions(known.covariance)
    mean[chosen], columns[chosen], rest[chosen] = known.mode, exact[0], exact[1]
    return SmoothedSimulation(mean, columns, rest)


def _directions(covariance: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return columns (d, r) and variances (d,) whose columns columns^T + diag(variances) is the covariance (d, d)."""
    values, vectors = numpy.linalg.eigh(covariance)
    kept = numpy.flatnonzero(values > max(MIN_VARIANCE, 1e-6 * values[-1]))[::-1][:MAX_DIRECTIONS]
    columns = vectors[:, kept] * numpy.sqrt(values[kept])
    return columns, numpy.maximum(numpy.diag(covariance) - (columns**2).sum(axis=1), 0)


def _posterior(
    prior: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any], environments: NDArray[Any] | None
) -> _Posterior:
    """Mode (d,), covariance (d, d) and log evidence of log-odds with that prior covariance."""
    identity = numpy.eye(len(prior))
    # a = K⁻¹ s, so that s = K a stays in reach of the prior.
    a = numpy.zeros(len(prior))

    def log_density(at: NDArray[Any]) -> float:
        s = prior @ at
        return float(passed @ s - counted @ numpy.logaddexp(0, s) - at @ s / 2)

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
        moved = covariance @ gradients
        covariance = covariance - covariance @ (curvature[:, None] * covariance) + moved @ moved.T
    return _Posterior(s, covariance, evidence)


def _solve(lower: NDArray[Any], values: NDArray[Any]) -> NDArray[Any]:
    from scipy.linalg import cho_solve

    return numpy.asarray(cho_solve((lower, True), values))
