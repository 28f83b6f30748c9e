"""A Gaussian process for the log-odds of designs, given how many runs or trials of each passed.

The process is a sum of basis functions with standard normal factors: those of a Matérn 5/2 covariance at up to 80
inducing designs (Rasmussen and Williams 2006, section 8.3.1), and functions that a caller adds, such as a constant. So
time grows with the number of designs, not with its cube. The factors' posterior is Laplace's approximation (section 3.4).
Its evidence weights candidate lengths and strengths of the process.

:func:`success_model` fits success as a smooth function of design parameters: a constant and such a process.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError
from foldcar.statistics.rate import check_confidence

# Largest number of inducing designs.
INDUCING_DESIGNS = 80
NEWTON_STEPS = 50
TOLERANCE = 1e-9
# A Newton step is not halved below this fraction.
MIN_STEP_SIZE = 1e-4
# The lengths and standard deviations that are tried. A length is a fraction of the range of a parameter; a standard
# deviation is one of the log-odds. With one or two parameters, LENGTHS has the lengths for this number of parameters, and
# all combinations are fitted. With more, only the combinations on the way to the best one are fitted.
LENGTHS = {1: (0.1, 0.2, 0.4, 0.8), 2: (0.15, 0.35, 0.8)}
LONG = 0.8
# At this length a parameter has no effect.
WITHOUT_EFFECT = 2.5
MANY_LENGTHS = (0.15, 0.35, LONG, WITHOUT_EFFECT)
STRENGTHS = (1.5, 5.0)
# Candidates of lower weight are dropped.
MIN_WEIGHT = 0.01
# A model is not fitted to fewer designs with runs.
MIN_DESIGNS = 4
# Rounding error of parameters that are scaled to 0 to 1.
ROUNDING = 1e-9
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
        differences = (first[:, None] - second[None, :]) / numpy.asarray(self.lengths)
        # The root of 5 times the distance in lengths.
        r = numpy.sqrt(5 * (differences**2).sum(axis=-1))
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
    # The squared distance of each design to the nearest chosen one.
    nearest = numpy.full(len(designs), numpy.inf)
    while len(chosen) < min(max_number, len(designs)):
        squared_distances = ((designs - designs[chosen[-1]]) ** 2).sum(axis=1)
        nearest = numpy.minimum(nearest, squared_distances)
        chosen.append(int(nearest.argmax()))
    return numpy.array(chosen)


class LogLikelihood(NamedTuple):
    """Each design's log likelihood (..., d), its slope and its curvature, which is at most 0, over the log-odds."""

    value: NDArray[Any]
    slope: NDArray[Any]
    curvature: NDArray[Any]


# Maps log-odds (..., d) to the log likelihood of the observations.
Likelihood = Callable[[NDArray[Any]], LogLikelihood]


def binomial(passed: NDArray[Any], counted: NDArray[Any]) -> Likelihood:
    """Return the likelihood function of log-odds if ``passed`` (d,) of ``counted`` (d,) independent runs passed."""

    def likelihood(log_odds: NDArray[Any]) -> LogLikelihood:
        rate = logistic(log_odds)
        value = passed * log_odds - counted * numpy.logaddexp(0, log_odds)
        return LogLikelihood(value, slope=passed - counted * rate, curvature=-counted * rate * (1 - rate))

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
        log_likelihood = likelihood(log_odds(factors)).value.sum(axis=-1)
        return numpy.asarray(log_likelihood - (factors**2).sum(axis=-1) / 2)

    def slope_and_precision(factors: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the slope (..., p) of the log density, and its negative second derivative (..., p, p)."""
        log_likelihood = likelihood(log_odds(factors))
        transposed = functions.swapaxes(-1, -2)
        slope = (transposed @ log_likelihood.slope[..., None])[..., 0] - factors
        precision = transposed @ (functions * -log_likelihood.curvature[..., None]) + numpy.eye(factors.shape[-1])
        return slope, precision

    value = log_density(factors)
    for _ in range(NEWTON_STEPS):
        slope, precision = slope_and_precision(factors)
        step = numpy.linalg.solve(precision, slope[..., None])[..., 0]
        size = numpy.ones((*value.shape, 1))
        # A full step may overshoot where the likelihood is flat: halve it for those candidates whose density falls.
        new_value = log_density(factors + size * step)
        while (overshot := (new_value < value - TOLERANCE) & (size[..., 0] > MIN_STEP_SIZE)).any():
            size[overshot] /= 2
            new_value = log_density(factors + size * step)
        gain = new_value - value
        factors, value = factors + size * step, new_value
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

    def residual_variance(self, functions: NDArray[Any]) -> NDArray[Any]:
        """Return the variance (m,) of the process that its basis ``functions`` (m, p + 1) do not represent.

        They represent it exactly at the inducing designs only. The first function is the constant, not the process.
        """
        represented_variance = (functions[:, 1:] ** 2).sum(axis=1)
        return numpy.asarray(numpy.maximum(self.strength**2 - represented_variance, 0))


@dataclass(frozen=True)
class SuccessModel:
    """Success as a smooth function of parameters: ``candidates`` with weights, over the range ``low``, ``span`` (k,)."""

    candidates: tuple[Candidate, ...]
    low: NDArray[Any]
    span: NDArray[Any]

    def rates(self, parameters: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the success rates of m designs with parameters (m, k), and their credible bands: (rate, low, high).

        Each is an array (m,) of values from 0 to 1. Raises FoldcarError if a design is outside the range of the designs
        that were simulated.
        """
        from scipy.special import ndtri

        check_confidence(confidence)
        scaled = self.scaled(parameters, range(len(self.low)))
        # Each candidate has normally distributed log-odds. Their mixture is treated as a normal distribution that has the
        # same mean and variance.
        mean = numpy.zeros(len(scaled))
        mean_square = numpy.zeros(len(scaled))
        for candidate in self.candidates:
            functions = basis_functions(candidate.process, candidate.strength, scaled)
            candidate_mean = functions @ candidate.factors.mode
            represented_variance = ((functions @ candidate.factors.root) ** 2).sum(axis=1)
            candidate_variance = represented_variance + candidate.residual_variance(functions)
            mean += candidate.weight * candidate_mean
            mean_square += candidate.weight * (candidate_mean**2 + candidate_variance)
        sd = numpy.sqrt(numpy.maximum(mean_square - mean**2, 0))
        half_width = ndtri((1 + confidence) / 2) * sd
        return logistic(mean), logistic(mean - half_width), logistic(mean + half_width)

    def scaled(self, values: ArrayLike, indices: Sequence[int]) -> NDArray[Any]:
        """Scale values (m, k) of the parameters at ``indices`` to 0 to 1. Raises FoldcarError outside their range."""
        table, columns = numpy.asarray(values, dtype=float), list(indices)
        if table.ndim != 2 or table.shape[1] != len(columns):
            raise FoldcarError(f"this success model has {len(columns)} parameters of each design")
        scaled: NDArray[Any] = (table - self.low[columns]) / self.span[columns]
        if not numpy.all((scaled > -ROUNDING) & (scaled < 1 + ROUNDING)):
            raise FoldcarError("a success model has rates only within the range of the designs that it was fitted to")
        return scaled


def logistic(log_odds: NDArray[Any]) -> NDArray[Any]:
    """Return the rates of log-odds."""
    return numpy.asarray(1 / (1 + numpy.exp(-log_odds)))


def success_model(parameters: ArrayLike, passed: ArrayLike, counted: ArrayLike) -> SuccessModel:
    """Fit a Gaussian process to the success rates of designs with ``parameters`` (d, k).

    ``passed`` (d,) of the ``counted`` (d,) runs of each design passed. The process has a length for each parameter, over
    which success changes, and a strength, by how much it changes. Several settings of these are fitted. The result is the
    average of the fits, weighted by how probable each setting makes the runs. Raises FoldcarError if fewer than 4 designs
    have runs, or if a parameter does not vary.
    """
    designs = numpy.asarray(parameters, dtype=float)
    passed_runs = numpy.asarray(passed, dtype=float)
    counted_runs = numpy.asarray(counted, dtype=float)
    _check_counts_of_designs(designs, passed_runs, counted_runs)
    has_runs = counted_runs > 0
    designs, passed_runs, counted_runs = designs[has_runs], passed_runs[has_runs], counted_runs[has_runs]
    low, span = designs.min(axis=0), numpy.ptp(designs, axis=0)
    scaled = (designs - low) / span
    inducing = farthest_first_designs(scaled)

    @cache
    def fitted(setting: Setting) -> tuple[Matern, Factors]:
        """Fit the model with one setting."""
        process = Matern(inducing, setting.lengths)
        functions = basis_functions(process, setting.strength, scaled)
        return process, laplace(functions, numpy.zeros(len(scaled)), binomial(passed_runs, counted_runs))

    def evidence(setting: Setting) -> float:
        """Return the log evidence of a setting: how probable it makes the runs."""
        _, factors = fitted(setting)
        return float(factors.evidence)

    settings = _settings(scaled.shape[1], evidence)
    weights = evidence_weights([evidence(setting) for setting in settings])
    weights[weights < MIN_WEIGHT] = 0.0
    weights /= weights.sum()
    candidates = []
    for setting, weight in zip(settings, weights.tolist(), strict=True):
        if weight > 0:
            process, factors = fitted(setting)
            candidates.append(Candidate(process, setting.strength, weight, factors))
    return SuccessModel(tuple(candidates), low, span)


def _check_counts_of_designs(designs: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]) -> None:
    """Raise FoldcarError if :func:`success_model` cannot be fitted to these designs and numbers of runs."""
    if designs.ndim != 2 or not designs.shape[1] or not numpy.all(numpy.isfinite(designs)):
        raise FoldcarError("a success model needs a table of designs with at least one parameter, all finite")
    number = len(designs)
    has_shapes = passed.shape == (number,) and counted.shape == (number,)
    if not has_shapes or not numpy.all((passed >= 0) & (passed <= counted)):
        raise FoldcarError(f"a success model needs 0 ≤ passed ≤ counted for each of the {number} designs")
    with_runs = designs[counted > 0]
    if len(with_runs) < MIN_DESIGNS or not numpy.all(numpy.ptp(with_runs, axis=0) > 0):
        raise FoldcarError(
            f"a success model needs runs of at least {MIN_DESIGNS} designs that differ in each parameter; "
            f"{len(with_runs)} designs have runs"
        )


class Setting(NamedTuple):
    """What a candidate process has: a length for each parameter, and the standard deviation of the log-odds."""

    lengths: tuple[float, ...]
    strength: float

    def with_length(self, parameter: int, length: float) -> "Setting":
        """Return this setting with another length for one parameter."""
        lengths = list(self.lengths)
        lengths[parameter] = length
        return Setting(tuple(lengths), self.strength)


def _settings(parameters: int, evidence: Callable[[Setting], float]) -> list[Setting]:
    """Return the settings with which to fit a model of so many ``parameters``.

    For one or two parameters these are all combinations of lengths and strengths. For more parameters there are too many
    combinations, so a search chooses some; ``evidence`` returns the log evidence of a setting.
    """
    if parameters in LENGTHS:
        all_lengths = product(LENGTHS[parameters], repeat=parameters)
        return [Setting(lengths, strength) for lengths, strength in product(all_lengths, STRENGTHS)]
    return _searched_settings(parameters, evidence)


def _searched_settings(parameters: int, evidence: Callable[[Setting], float]) -> list[Setting]:
    """Search the setting of a Gaussian process with the highest ``evidence``. Return all settings that were tried.

    A setting has a correlation length for each of so many ``parameters`` of the designs, and the process's standard
    deviation, its *strength*. The search changes one of these numbers at a time. It ends when a round over all numbers
    has changed nothing.
    """
    best = Setting((LONG,) * parameters, STRENGTHS[0])
    # A dictionary keeps the order and has each setting once.
    tried = {best: None}

    def best_of(alternatives: list[Setting]) -> Setting:
        tried.update(dict.fromkeys(alternatives))
        return max(alternatives, key=evidence)

    previous = None
    while best != previous:
        previous = best
        for parameter in range(parameters):
            best = best_of([best.with_length(parameter, length) for length in MANY_LENGTHS])
        best = best_of([best._replace(strength=strength) for strength in STRENGTHS])
    return list(tried)


def basis_functions(process: Matern, strength: float, scaled: NDArray[Any]) -> NDArray[Any]:
    """Return the constant and the basis functions of the process (m, p + 1)."""
    return numpy.hstack([numpy.full((len(scaled), 1), CONSTANT), strength * process.functions(scaled)])
