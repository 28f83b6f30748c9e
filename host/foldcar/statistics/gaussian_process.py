"""A Gaussian process for the log-odds of designs, given how many runs or trials of each passed.

The process is a sum of basis functions with standard normal factors: those of a Matérn 5/2 covariance at up to 80
inducing designs (Rasmussen and Williams 2006, section 8.3.1), and functions that a caller adds, such as a constant. So
time grows with the number of designs, not with its cube. The factors' posterior is Laplace's approximation (section 3.4).
Its evidence weights candidate lengths and strengths of the process.

:func:`success_model` fits success as a smooth function of design parameters: a constant and such a process.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError
from foldcar.statistics.rate import check_confidence

# Largest number of inducing designs.
INDUCING_DESIGNS = 80
NEWTON_STEPS = 50
TOLERANCE = 1e-9
# Candidates: length as a fraction of the range, standard deviation of the log-odds. With more than two parameters only
# combinations of lengths on the way to the best one are fitted; the longest stands for a parameter without effect.
LENGTHS = {1: (0.1, 0.2, 0.4, 0.8), 2: (0.15, 0.35, 0.8)}
MANY_LENGTHS = (0.15, 0.35, 0.8, 2.5)
STRENGTHS = (1.5, 5.0)
# Candidates of lower weight are dropped.
MIN_WEIGHT = 0.01
# Standard deviation of the constant.
CONSTANT = 4.0


@dataclass(frozen=True)
class Matern:
    """A Matérn 5/2 process of standard deviation 1 over parameters that are scaled to 0 to 1.

    ``inducing`` (p, k) are the designs whose basis functions approximate it; ``lengths`` are those of its correlation,
    (k,) or a single one for all parameters.
    """

    inducing: NDArray[Any]
    lengths: ArrayLike

    def functions(self, scaled: NDArray[Any]) -> NDArray[Any]:
        """Return the basis functions (m, p) at parameters (m, k): with standard normal factors their sum is the process.

        The variance between the inducing designs is missing: 1 minus the sum of squares.
        """
        return numpy.asarray(self.covariance(scaled, self.inducing) @ self._roots)

    @cached_property
    def _roots(self) -> NDArray[Any]:
        """A root (p, p) of the inverse covariance of the inducing designs; tiny eigenvalues are raised."""
        values, vectors = numpy.linalg.eigh(self.covariance(self.inducing, self.inducing))
        return numpy.asarray(vectors / numpy.sqrt(numpy.maximum(values, 1e-9 * values[-1])))

    def covariance(self, first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
        """Return the covariance (m, n) between the process at designs (m, k) and at designs (n, k)."""
        steps = (first[:, None] - second[None, :]) / numpy.asarray(self.lengths)
        r = numpy.sqrt(5 * (steps**2).sum(axis=-1))
        return numpy.asarray((1 + r + r**2 / 3) * numpy.exp(-r))


@dataclass(frozen=True)
class Factors:
    """The posterior of the factors: mode (..., p), a root (..., p, p) of their covariance, log evidence (...).

    The evidence leaves out the binomial coefficients, which all candidates share.
    """

    mode: NDArray[Any]
    root: NDArray[Any]
    evidence: Any


def farthest_first_designs(scaled: NDArray[Any], max_number: int = INDUCING_DESIGNS) -> NDArray[Any]:
    """Return at most ``max_number`` different designs (n, k) of ``scaled`` (d, k), each farthest from those before it."""
    designs = numpy.unique(scaled, axis=0)
    return numpy.asarray(designs[farthest_first_indices(designs, max_number)])


def farthest_first_indices(designs: NDArray[Any], max_number: int) -> NDArray[Any]:
    """Return the indices of at most ``max_number`` of the designs (d, k), each farthest from those before it."""
    chosen = [0]
    distances = numpy.full(len(designs), numpy.inf)
    while len(chosen) < min(max_number, len(designs)):
        distances = numpy.minimum(distances, ((designs - designs[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distances.argmax()))
    return numpy.array(chosen)


# Maps log-odds (..., d) to each design's log likelihood, its slope and its curvature, which is at most 0.
Likelihood = Callable[[NDArray[Any]], tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]


def binomial(passed: NDArray[Any], counted: NDArray[Any]) -> Likelihood:
    """Return the likelihood function of log-odds if ``passed`` (d,) of ``counted`` (d,) independent runs passed."""

    def likelihood(log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        rate = 1 / (1 + numpy.exp(-log_odds))
        value = passed * log_odds - counted * numpy.logaddexp(0, log_odds)
        return value, passed - counted * rate, -counted * rate * (1 - rate)

    return likelihood


def laplace(functions: NDArray[Any], prior: NDArray[Any], likelihood: Likelihood) -> Factors:
    """Approximate the posterior of standard normal factors by a normal distribution around its mode (Laplace).

    The log-odds are the mean ``prior`` (d,) plus ``functions`` (..., d, p) times the factors (..., p). The mode is found
    by Newton's method, for all candidates along the first axes at once.
    """
    factors = numpy.zeros((*functions.shape[:-2], functions.shape[-1]))

    def log_odds(factors: NDArray[Any]) -> NDArray[Any]:
        return numpy.asarray(prior + (functions @ factors[..., None])[..., 0])

    def log_density(factors: NDArray[Any]) -> NDArray[Any]:
        return numpy.asarray(likelihood(log_odds(factors))[0].sum(axis=-1) - (factors**2).sum(axis=-1) / 2)

    def slope_and_precision(factors: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the slope (..., p) of the log density, and its negative second derivative (..., p, p)."""
        _, slope, curvature = likelihood(log_odds(factors))
        transposed = functions.swapaxes(-1, -2)
        precision = transposed @ (functions * -curvature[..., None]) + numpy.eye(factors.shape[-1])
        return (transposed @ slope[..., None])[..., 0] - factors, precision

    value = log_density(factors)
    for _ in range(NEWTON_STEPS):
        slope, precision = slope_and_precision(factors)
        step = numpy.linalg.solve(precision, slope[..., None])[..., 0]
        size = numpy.ones((*value.shape, 1))
        # A full step may overshoot where the likelihood is flat: halve it for those candidates whose density falls.
        new = log_density(factors + size * step)
        while (overshot := (new < value - TOLERANCE) & (size[..., 0] > 1e-4)).any():
            size[overshot] /= 2
            new = log_density(factors + size * step)
        factors, gain, value = factors + size * step, new - value, new
        if (numpy.abs(gain) < TOLERANCE).all():
            break
    # The covariance is the inverse of the precision L L', so L'^-1 is a root of it. The powers of 2 pi of prior and
    # integral cancel in the evidence.
    lower = numpy.linalg.cholesky(slope_and_precision(factors)[1])
    evidence = value - numpy.log(numpy.diagonal(lower, axis1=-2, axis2=-1)).sum(axis=-1)
    return Factors(factors, numpy.linalg.inv(lower).swapaxes(-1, -2), evidence)


def evidence_weights(evidence: ArrayLike) -> NDArray[Any]:
    """Return the posterior weights of candidates, with sum 1, from their log evidence; all have the same prior."""
    logs = numpy.asarray(evidence, dtype=float)
    weights = numpy.exp(logs - logs.max())
    return numpy.asarray(weights / weights.sum())


@dataclass(frozen=True)
class Candidate:
    """A process with standard deviation ``strength``, its weight, 0 to 1, and the posterior of its factors."""

    process: Matern
    strength: float
    weight: float
    factors: Factors


@dataclass(frozen=True)
class SuccessModel:
    """Success as a smooth function of parameters: ``candidates`` with weights, over the range ``low``, ``span`` (k,)."""

    candidates: tuple[Candidate, ...]
    low: NDArray[Any]
    span: NDArray[Any]

    def rates(self, parameters: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the rate and its credible band (rate, low, high), each (m,) and 0 to 1, at parameters (m, k).

        Raises FoldcarError outside the range of the designs that were simulated.
        """
        from scipy.special import ndtri

        check_confidence(confidence)
        scaled = self.scaled(parameters, range(len(self.low)))
        # The mixture of the candidates' log-odds counts as normal with its mean and variance.
        mean, mean_square = numpy.zeros(len(scaled)), numpy.zeros(len(scaled))
        for candidate in self.candidates:
            functions = basis_functions(candidate.process, candidate.strength, scaled)
            log_odds = functions @ candidate.factors.mode
            # The variance between the inducing designs, which the functions lack; the first function is the constant.
            residual_variance = numpy.maximum(candidate.strength**2 - (functions[:, 1:] ** 2).sum(axis=1), 0)
            variance = ((functions @ candidate.factors.root) ** 2).sum(axis=1) + residual_variance
            mean += candidate.weight * log_odds
            mean_square += candidate.weight * (log_odds**2 + variance)
        half_width = ndtri((1 + confidence) / 2) * numpy.sqrt(numpy.maximum(mean_square - mean**2, 0))
        rate, low, high = (1 / (1 + numpy.exp(-value)) for value in (mean, mean - half_width, mean + half_width))
        return rate, low, high

    def scaled(self, values: ArrayLike, indices: Sequence[int]) -> NDArray[Any]:
        """Scale values (m, k) of the parameters at ``indices`` to 0 to 1. Raises FoldcarError outside their range."""
        x, columns = numpy.asarray(values, dtype=float), list(indices)
        if x.ndim != 2 or x.shape[1] != len(columns):
            raise FoldcarError(f"this success model has {len(columns)} parameters of each design")
        result: NDArray[Any] = (x - self.low[columns]) / self.span[columns]
        if not numpy.all((result > -1e-9) & (result < 1 + 1e-9)):
            raise FoldcarError("a success model has rates only within the range of the designs that it was fitted to")
        return result


def success_model(parameters: ArrayLike, passed: ArrayLike, counted: ArrayLike) -> SuccessModel:
    """Fit a model to designs with ``parameters`` (d, k); ``passed`` (d,) of their ``counted`` (d,) runs passed.

    Candidates, pairs of lengths and strength, are weighted by their evidence. Raises FoldcarError if there are runs of
    fewer than 4 designs or a parameter does not vary.
    """
    x, k, n = (numpy.asarray(values, dtype=float) for values in (parameters, passed, counted))
    if x.ndim != 2 or not x.shape[1] or not numpy.all(numpy.isfinite(x)):
        raise FoldcarError("a success model needs a table of designs with at least one parameter, all finite")
    if k.shape != (len(x),) or n.shape != (len(x),) or not numpy.all((k >= 0) & (k <= n)):
        raise FoldcarError(f"a success model needs 0 ≤ passed ≤ counted for each of the {len(x)} designs")
    x, k, n = x[n > 0], k[n > 0], n[n > 0]
    if len(x) < 4 or not numpy.all(numpy.ptp(x, axis=0) > 0):
        raise FoldcarError(
            f"a success model needs runs of at least 4 designs that differ in each parameter; {len(x)} designs have runs"
        )
    low, span = x.min(axis=0), numpy.ptp(x, axis=0)
    scaled = (x - low) / span
    inducing = farthest_first_designs(scaled)

    @cache
    def fitted(lengths: tuple[float, ...], strength: float) -> tuple[Matern, Factors]:
        process = Matern(inducing, lengths)
        return process, laplace(basis_functions(process, strength, scaled), numpy.zeros(len(n)), binomial(k, n))

    settings = list(_settings(x.shape[1], lambda lengths, strength: fitted(lengths, strength)[1].evidence))
    weights = evidence_weights([fitted(*candidate)[1].evidence for candidate in settings])
    weights = numpy.where(weights >= MIN_WEIGHT, weights, 0.0)
    weights /= weights.sum()
    candidates = []
    for (lengths, strength), weight in zip(settings, weights.tolist(), strict=True):
        if weight:
            process, factors = fitted(lengths, strength)
            candidates.append(Candidate(process, strength, weight, factors))
    return SuccessModel(tuple(candidates), low, span)


def _settings(
    parameters: int, evidence: Callable[[tuple[float, ...], float], float]
) -> Collection[tuple[tuple[float, ...], float]]:
    """Return the candidates to weight, pairs of lengths and strength.

    For one or two parameters these are all combinations; for more, those that a coordinate search for the highest
    ``evidence`` tries.
    """
    if parameters in LENGTHS:
        return list(product(product(LENGTHS[parameters], repeat=parameters), STRENGTHS))
    # The search begins at the longest length that still stands for an effect.
    best: tuple[tuple[float, ...], float] = ((MANY_LENGTHS[2],) * parameters, STRENGTHS[0])
    tried, previous = {best: None}, None
    while best != previous:
        previous = best
        for parameter in range(parameters):
            lengths, strength = best
            alternatives = [
                ((*lengths[:parameter], length, *lengths[parameter + 1 :]), strength) for length in MANY_LENGTHS
            ]
            tried.update(dict.fromkeys(alternatives))
            best = max(alternatives, key=lambda setting: evidence(*setting))
        alternatives = [(best[0], strength) for strength in STRENGTHS]
        tried.update(dict.fromkeys(alternatives))
        best = max(alternatives, key=lambda setting: evidence(*setting))
    return tried


def basis_functions(process: Matern, strength: float, scaled: NDArray[Any]) -> NDArray[Any]:
    """Return the constant and the basis functions of the process (m, p + 1)."""
    return numpy.hstack([numpy.full((len(scaled), 1), CONSTANT), strength * process.functions(scaled)])
