"""Success as a smooth function of one or two design parameters, with credible bands, from counts of each design.

The log-odds are a Gaussian process with a Matérn 5/2 covariance in each parameter. Candidates of lengths and strength are
weighted by the likelihood of designs that are held out (pseudo-BMA: Yao et al. 2018, doi:10.1214/17-BA1091). The process
is computed by its leading harmonics (Solin and Särkkä 2020, doi:10.1007/s11222-019-09886-w) and Laplace's approximation:
time grows with the number of designs, not its cube.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from foldcar.analysis.intervals import check_confidence
from foldcar.errors import FoldcarError

# Harmonics of each parameter, for one and for two parameters, on an interval wider than the parameters' range.
HARMONICS = {1: 32, 2: 12}
MARGIN = 1.4
# Candidates: length as a part of the range, standard deviation of the log-odds.
LENGTHS = (0.1, 0.2, 0.4, 0.8)
STRENGTHS = (1.5, 5.0)
# Candidates of less weight are left out.
LEAST_WEIGHT = 0.01
# Of the constant.
CONSTANT = 4.0
FOLDS = 4


@dataclass(frozen=True)
class Fit:
    """One candidate: its lengths and strength, its weight 0 to 1, and the weights of its basis (p,) and their root (p, p)."""

    lengths: tuple[float, ...]
    strength: float
    weight: float
    mean: NDArray[Any]
    root: NDArray[Any]


@dataclass(frozen=True)
class SuccessModel:
    """The candidates that held-out designs support; ``low`` (k,) and ``span`` (k,) are the range of the parameters.

    ``held_out`` is the mean log-likelihood of a held-out run under the best candidate.
    """

    fits: tuple[Fit, ...]
    held_out: float
    low: NDArray[Any]
    span: NDArray[Any]

    def rates(self, parameters: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """The rate and its credible band (rate, low, high), each (m,) and 0 to 1, at parameters (m, k).

        Outside the range of the designs that were simulated there is no model.
        """
        from scipy.stats import norm

        check_confidence(confidence)
        x = numpy.asarray(parameters, dtype=float)
        if x.ndim != 2 or x.shape[1] != len(self.low):
            raise FoldcarError(f"this success model has {len(self.low)} parameters of each design")
        scaled = (x - self.low) / self.span
        if not numpy.all((scaled > -1e-9) & (scaled < 1 + 1e-9)):
            raise FoldcarError("a success model has rates only within the range of the designs that it was fitted to")
        basis = _basis(scaled)
        first, second = numpy.zeros(len(x)), numpy.zeros(len(x))
        for fit in self.fits:
            here = basis * _scales(len(self.low), fit.lengths, fit.strength)
            middle = here @ fit.mean
            first += fit.weight * middle
            second += fit.weight * (middle**2 + ((here @ fit.root) ** 2).sum(axis=1))
        reach = norm.ppf((1 + confidence) / 2) * numpy.sqrt(numpy.maximum(second - first**2, 0))
        rate, low, high = (1 / (1 + numpy.exp(-value)) for value in (first, first - reach, first + reach))
        return rate, low, high


def success_model(parameters: ArrayLike, passed: ArrayLike, counted: ArrayLike, seed: int = 1007) -> SuccessModel:
    """Fit to designs with parameters (d, k), k 1 or 2, of which ``passed`` of ``counted`` runs (d,) succeeded."""
    x, k, n = (numpy.asarray(values, dtype=float) for values in (parameters, passed, counted))
    if x.ndim != 2 or x.shape[1] not in HARMONICS:
        raise FoldcarError("a success model needs a table of designs with one or two parameters")
    if k.shape != (len(x),) or n.shape != (len(x),) or not numpy.all((k >= 0) & (k <= n)):
        raise FoldcarError(f"a success model needs 0 ≤ passed ≤ counted for each of the {len(x)} designs")
    low, span = x[n > 0].min(axis=0, initial=numpy.inf), numpy.ptp(x[n > 0], axis=0) if (n > 0).any() else numpy.zeros(1)
    if numpy.count_nonzero(n) < 4 or not numpy.all(span > 0):
        raise FoldcarError(
            f"a success model needs runs of at least 4 designs that differ in each parameter; {numpy.count_nonzero(n)} "
            "designs have runs"
        )
    with_runs = n > 0
    basis, k, n = _basis((x[with_runs] - low) / span), k[with_runs], n[with_runs]
    # Matrices this small take up to 25 times as long when BLAS shares them among threads.
    with threadpool_limits(1):
        fits, held_out = _fits(basis, k, n, x.shape[1], seed)
    return SuccessModel(fits, held_out / float(n.sum()), low, span)


def _fits(
    basis: NDArray[Any], k: NDArray[Any], n: NDArray[Any], dimensions: int, seed: int
) -> tuple[tuple[Fit, ...], float]:
    """The candidates of weight, and the best log-likelihood of held-out designs."""
    fold = numpy.random.default_rng(seed).permutation(len(n)) % min(FOLDS, len(n))
    candidates = list(product(product(LENGTHS, repeat=dimensions), STRENGTHS))
    scores = []
    for lengths, strength in candidates:
        scaled = basis * _scales(dimensions, lengths, strength)
        score = 0.0
        for out in range(fold.max() + 1):
            mean, root = _laplace(scaled[fold != out], k[fold != out], n[fold != out])
            score += _predictive(scaled[fold == out], mean, root, k[fold == out], n[fold == out])
        scores.append(score)
    weights = numpy.exp(numpy.array(scores) - max(scores))
    weights = numpy.where(weights >= LEAST_WEIGHT * weights.sum(), weights, 0.0)
    weights /= weights.sum()
    fits = tuple(
        Fit(*candidate, float(weight), *_laplace(basis * _scales(dimensions, *candidate), k, n))
        for candidate, weight in zip(candidates, weights, strict=True)
        if weight
    )
    return fits, max(scores)


def _frequencies(count: int) -> NDArray[Any]:
    return numpy.pi * numpy.arange(1, count + 1) / (2 * MARGIN * 0.5)


def _basis(scaled: NDArray[Any]) -> NDArray[Any]:
    """The constant and the harmonics (m, p) at parameters scaled to 0 to 1."""
    half = MARGIN * 0.5
    waves = [
        numpy.sin(_frequencies(HARMONICS[scaled.shape[1]]) * (column[:, None] - 0.5 + half)) / numpy.sqrt(half)
        for column in scaled.T
    ]
    harmonics = waves[0] if len(waves) == 1 else (waves[0][:, :, None] * waves[1][:, None, :]).reshape(len(scaled), -1)
    return numpy.hstack([numpy.ones((len(scaled), 1)), harmonics])


def _scales(dimensions: int, lengths: tuple[float, ...], strength: float) -> NDArray[Any]:
    """The prior standard deviations (p,) of the basis: the root of the covariance's spectral density."""
    frequencies = _frequencies(HARMONICS[dimensions])
    # 16/3 is 2 √π Γ(3) / Γ(5/2).
    densities = [16 / 3 * (5 / a**2) ** 2.5 / (5 / a**2 + frequencies**2) ** 3 for a in lengths]
    joint = densities[0] if dimensions == 1 else numpy.outer(densities[0], densities[1]).ravel()
    return numpy.concatenate([[CONSTANT], strength * numpy.sqrt(joint)])


def _laplace(basis: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The mode (p,) of weights with standard normal prior, and a root (p, p) of their covariance."""
    weights = numpy.zeros(basis.shape[1])
    identity = numpy.eye(basis.shape[1])
    value = _objective(basis, weights, passed, counted)
    for _ in range(50):
        rate = 1 / (1 + numpy.exp(-(basis @ weights)))
        curvature = (basis * (counted * rate * (1 - rate))[:, None]).T @ basis + identity
        step = numpy.linalg.solve(curvature, basis.T @ (passed - counted * rate) - weights)
        size = 1.0
        while (new := _objective(basis, weights + size * step, passed, counted)) < value - 1e-9 and size > 1e-4:
            size /= 2
        weights = weights + size * step
        if abs(new - value) < 1e-6:
            break
        value = new
    # The covariance is the inverse of the curvature, L L': its root is L'^-1.
    return weights, numpy.linalg.inv(numpy.linalg.cholesky(curvature)).T


def _objective(basis: NDArray[Any], weights: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]) -> float:
    log_odds = basis @ weights
    return float((passed * log_odds - counted * numpy.logaddexp(0, log_odds)).sum() - weights @ weights / 2)


def _predictive(
    basis: NDArray[Any], mean: NDArray[Any], root: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]
) -> float:
    """The log-likelihood of held-out designs, averaged over the log-odds' posterior."""
    nodes, weights = numpy.polynomial.hermite_e.hermegauss(15)
    log_odds = (basis @ mean)[:, None] + numpy.linalg.norm(basis @ root, axis=1)[:, None] * nodes
    logs = passed[:, None] * log_odds - counted[:, None] * numpy.logaddexp(0, log_odds)
    top = logs.max(axis=1, keepdims=True)
    return float((top[:, 0] + numpy.log(numpy.exp(logs - top) @ weights / weights.sum())).sum())
