"""A Gaussian process for the log-odds of designs, given how many runs or trials of each passed.

The process is a sum of functions with standard normal factors: those of a Matérn 5/2 covariance at up to 80 spanning
designs (Rasmussen and Williams 2006, section 8.3.1), and what a caller adds, as a constant. So time grows with the number
of designs, not with its cube. The factors' posterior is Laplace's approximation (section 3.4): exact in its mode and
curvature, with the evidence by which candidates of lengths and strength are weighted.

:func:`success_model` is success as a smooth function of design parameters: a constant and such a process.
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

# Designs that span the process.
SPANNING = 80
NEWTON_STEPS = 50
TOLERANCE = 1e-9
# Candidates: length as a part of the range, standard deviation of the log-odds. Of more than two parameters not every
# combination of lengths is fitted, but those on the way to the best one; the longest says that a parameter has no effect.
LENGTHS = {1: (0.1, 0.2, 0.4, 0.8), 2: (0.15, 0.35, 0.8)}
MANY_LENGTHS = (0.15, 0.35, 0.8, 2.5)
STRENGTHS = (1.5, 5.0)
# Candidates of less weight are left out.
MIN_WEIGHT = 0.01
# Standard deviation of the constant.
CONSTANT = 4.0


@dataclass(frozen=True)
class Matern:
    """A process of deviation 1 over parameters that are scaled to 0 to 1; ``spanning`` (p, k), lengths (k,) or one."""

    spanning: NDArray[Any]
    lengths: ArrayLike

    def functions(self, scaled: NDArray[Any]) -> NDArray[Any]:
        """Functions (m, p) at parameters (m, k): with standard normal factors their sum is the process.

        What the spanning designs leave open between them is missing: 1 less the sum of squares.
        """
        return numpy.asarray(self.covariance(scaled, self.spanning) @ self._roots)

    @cached_property
    def _roots(self) -> NDArray[Any]:
        values, vectors = numpy.linalg.eigh(self.covariance(self.spanning, self.spanning))
        return numpy.asarray(vectors / numpy.sqrt(numpy.maximum(values, 1e-9 * values[-1])))

    def covariance(self, one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
        """The covariance (m, n) of the process at two lists of parameters."""
        steps = (one[:, None] - other[None, :]) / numpy.asarray(self.lengths)
        r = numpy.sqrt(5 * (steps**2).sum(axis=-1))
        return numpy.asarray((1 + r + r**2 / 3) * numpy.exp(-r))


@dataclass(frozen=True)
class Factors:
    """The posterior of functions' factors: mode (..., p), a root (..., p, p) of their covariance, log evidence (...).

    The evidence leaves out the binomial coefficients, which all candidates share.
    """

    mode: NDArray[Any]
    root: NDArray[Any]
    evidence: Any


def spread_designs(scaled: NDArray[Any], most: int = SPANNING) -> NDArray[Any]:
    """At most ``most`` of the designs (d, k), each the one that is furthest from those before it."""
    designs = numpy.unique(scaled, axis=0)
    return numpy.asarray(designs[spread_places(designs, most)])


def spread_places(designs: NDArray[Any], most: int) -> NDArray[Any]:
    """Places of at most ``most`` designs (d, k), each the one that is furthest from those before it."""
    chosen = [0]
    distances = numpy.full(len(designs), numpy.inf)
    while len(chosen) < min(most, len(designs)):
        distances = numpy.minimum(distances, ((designs - designs[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distances.argmax()))
    return numpy.array(chosen)


def unit_range(parameters: NDArray[Any]) -> NDArray[Any]:
    """The parameters (designs, k), each scaled to 0 to 1 over its range; 0 where it does not vary."""
    low, span = parameters.min(axis=0), numpy.ptp(parameters, axis=0)
    return numpy.asarray((parameters - low) / numpy.where(span > 0, span, 1.0))


# Of log-odds (..., d) the log likelihood of each design, its slope and its curvature, at most 0.
Likelihood = Callable[[NDArray[Any]], tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]


def binomial(passed: NDArray[Any], counted: NDArray[Any]) -> Likelihood:
    """The likelihood of independent runs: ``passed`` of ``counted`` (d,)."""

    def likelihood(log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        rate = 1 / (1 + numpy.exp(-log_odds))
        value = passed * log_odds - counted * numpy.logaddexp(0, log_odds)
        return value, passed - counted * rate, -counted * rate * (1 - rate)

    return likelihood


def laplace(functions: NDArray[Any], prior: NDArray[Any], likelihood: Likelihood) -> Factors:
    """The factors of functions (..., d, p), given the likelihood of log-odds that are ``prior`` (d,) plus the process.

    All candidates along the first axes at once.
    """
    factors = numpy.zeros((*functions.shape[:-2], functions.shape[-1]))

    def log_odds(at: NDArray[Any]) -> NDArray[Any]:
        return numpy.asarray(prior + (functions @ at[..., None])[..., 0])

    def log_density(at: NDArray[Any]) -> NDArray[Any]:
        return numpy.asarray(likelihood(log_odds(at))[0].sum(axis=-1) - (at**2).sum(axis=-1) / 2)

    def slope_and_curvature(at: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        _, slope, curvature = likelihood(log_odds(at))
        across = functions.swapaxes(-1, -2)
        curved = across @ (functions * -curvature[..., None]) + numpy.eye(at.shape[-1])
        return (across @ slope[..., None])[..., 0] - at, curved

    value = log_density(factors)
    for _ in range(NEWTON_STEPS):
        slope, curvature = slope_and_curvature(factors)
        step = numpy.linalg.solve(curvature, slope[..., None])[..., 0]
        size = numpy.ones((*value.shape, 1))
        # A full step may overshoot where the likelihood is flat.
        while (over := ((new := log_density(factors + size * step)) < value - TOLERANCE) & (size[..., 0] > 1e-4)).any():
            size[over] /= 2
        factors, gain, value = factors + size * step, new - value, new
        if (numpy.abs(gain) < TOLERANCE).all():
            break
    # The covariance is the inverse of the curvature, L L': its root is L'^-1.
    lower = numpy.linalg.cholesky(slope_and_curvature(factors)[1])
    evidence = value - numpy.log(numpy.diagonal(lower, axis1=-2, axis2=-1)).sum(axis=-1)
    return Factors(factors, numpy.linalg.inv(lower).swapaxes(-1, -2), evidence)


def shares_of(evidence: ArrayLike) -> NDArray[Any]:
    """The candidates' weights, which add up to 1, from their log evidence: all alike beforehand."""
    logs = numpy.asarray(evidence, dtype=float)
    weights = numpy.exp(logs - logs.max())
    return numpy.asarray(weights / weights.sum())


@dataclass(frozen=True)
class Candidate:
    """A process of deviation ``strength`` with its weight, 0 to 1, and the posterior of its factors."""

    process: Matern
    strength: float
    weight: float
    factors: Factors


@dataclass(frozen=True)
class SuccessModel:
    """The candidates that the counts support; ``low`` (k,) and ``span`` (k,) are the range of the parameters."""

    candidates: tuple[Candidate, ...]
    low: NDArray[Any]
    span: NDArray[Any]

    def rates(self, parameters: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """The rate and its credible band (rate, low, high), each (m,) and 0 to 1, at parameters (m, k).

        Outside the range of the designs that were simulated there is no model.
        """
        from scipy.special import ndtri

        check_confidence(confidence)
        scaled = self.scaled(parameters, range(len(self.low)))
        first, second = numpy.zeros(len(scaled)), numpy.zeros(len(scaled))
        for candidate in self.candidates:
            here = functions_of(candidate.process, candidate.strength, scaled)
            middle = here @ candidate.factors.mode
            # What the spanning designs leave open between them is added to the variance.
            left = numpy.maximum(candidate.strength**2 - (here[:, 1:] ** 2).sum(axis=1), 0)
            first += candidate.weight * middle
            second += candidate.weight * (middle**2 + ((here @ candidate.factors.root) ** 2).sum(axis=1) + left)
        reach = ndtri((1 + confidence) / 2) * numpy.sqrt(numpy.maximum(second - first**2, 0))
        rate, low, high = (1 / (1 + numpy.exp(-value)) for value in (first, first - reach, first + reach))
        return rate, low, high

    def scaled(self, values: ArrayLike, places: Sequence[int]) -> NDArray[Any]:
        """Values (m, k) of the parameters at ``places``, from 0 to 1 over the range. FoldcarError outside it."""
        x, at = numpy.asarray(values, dtype=float), list(places)
        if x.ndim != 2 or x.shape[1] != len(at):
            raise FoldcarError(f"this success model has {len(at)} parameters of each design")
        result: NDArray[Any] = (x - self.low[at]) / self.span[at]
        if not numpy.all((result > -1e-9) & (result < 1 + 1e-9)):
            raise FoldcarError("a success model has rates only within the range of the designs that it was fitted to")
        return result


def success_model(parameters: ArrayLike, passed: ArrayLike, counted: ArrayLike) -> SuccessModel:
    """Fit to designs with parameters (d, k): ``passed`` of ``counted`` runs (d,) succeeded. Raises FoldcarError."""
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
    spanning = spread_designs(scaled)

    @cache
    def fitted(lengths: tuple[float, ...], strength: float) -> tuple[Matern, Factors]:
        process = Matern(spanning, lengths)
        return process, laplace(functions_of(process, strength, scaled), numpy.zeros(len(n)), binomial(k, n))

    tried = list(_tried(x.shape[1], lambda lengths, strength: fitted(lengths, strength)[1].evidence))
    weights = shares_of([fitted(*candidate)[1].evidence for candidate in tried])
    weights = numpy.where(weights >= MIN_WEIGHT, weights, 0.0)
    weights /= weights.sum()
    found = []
    for (lengths, strength), weight in zip(tried, weights.tolist(), strict=True):
        if weight:
            process, factors = fitted(lengths, strength)
            found.append(Candidate(process, strength, weight, factors))
    return SuccessModel(tuple(found), low, span)


def lengths_to_try(parameters: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]) -> list[tuple[float, ...]]:
    """The lengths that :func:`success_model` would weight for these designs (d, k) and counts (d,)."""
    count = parameters.shape[1]
    if count in LENGTHS:
        return list(product(LENGTHS[count], repeat=count))
    model = success_model(parameters, passed, counted)
    return list(
        dict.fromkeys(tuple(numpy.atleast_1d(candidate.process.lengths).tolist()) for candidate in model.candidates)
    )


def _tried(
    parameters: int, evidence: Callable[[tuple[float, ...], float], float]
) -> Collection[tuple[tuple[float, ...], float]]:
    """Lengths and strengths to weight: all of one or two parameters, of more those tried on the way to the best."""
    if parameters in LENGTHS:
        return list(product(product(LENGTHS[parameters], repeat=parameters), STRENGTHS))
    best: tuple[tuple[float, ...], float] = ((MANY_LENGTHS[2],) * parameters, STRENGTHS[0])
    tried, before = {best: None}, None
    while best != before:
        before = best
        for at in range(parameters):
            lengths, strength = best
            some = [((*lengths[:at], length, *lengths[at + 1 :]), strength) for length in MANY_LENGTHS]
            tried.update(dict.fromkeys(some))
            best = max(some, key=lambda one: evidence(*one))
        some = [(best[0], strength) for strength in STRENGTHS]
        tried.update(dict.fromkeys(some))
        best = max(some, key=lambda one: evidence(*one))
    return tried


def functions_of(process: Matern, strength: float, scaled: NDArray[Any]) -> NDArray[Any]:
    """The constant and the process' functions (m, p + 1)."""
    return numpy.hstack([numpy.full((len(scaled), 1), CONSTANT), strength * process.functions(scaled)])
