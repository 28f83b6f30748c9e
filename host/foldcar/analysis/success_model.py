"""Success as a smooth function of one or two design parameters, with credible bands, from counts of each design.

The log-odds are a Gaussian process with a Matérn 5/2 covariance (Rasmussen and Williams 2006, section 3.4: Laplace's
approximation). Candidates of lengths and strength are weighted by the likelihood of designs that are held out
(pseudo-BMA: Yao et al. 2018, doi:10.1214/17-BA1091). Beyond 80 designs the process is spanned by 80 of them (section
8.3.1), so that time grows with the number of designs, not its cube.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.binomial_normal import binomial_normal
from foldcar.analysis.intervals import check_confidence
from foldcar.errors import FoldcarError

# Designs that span the process.
SPANNING = 80
# Candidates: length as a part of the range, standard deviation of the log-odds.
LENGTHS = {1: (0.1, 0.2, 0.4, 0.8), 2: (0.15, 0.35, 0.8)}
STRENGTHS = (1.5, 5.0)
# Candidates of less weight are left out.
LEAST_WEIGHT = 0.01
# Of the constant.
CONSTANT = 4.0
FOLDS = 4


@dataclass(frozen=True)
class Basis:
    """Functions whose sum with standard normal factors is the process: a constant, those of spanning designs (p, k)."""

    spanning: NDArray[Any]
    lengths: tuple[float, ...]
    strength: float

    def at(self, scaled: NDArray[Any]) -> NDArray[Any]:
        """The functions (m, p + 1) at parameters (m, k) scaled to 0 to 1."""
        functions = self.covariance(scaled, self.spanning) @ self._roots
        return numpy.hstack([numpy.full((len(scaled), 1), CONSTANT), functions])

    @cached_property
    def _roots(self) -> NDArray[Any]:
        values, vectors = numpy.linalg.eigh(self.covariance(self.spanning, self.spanning))
        found: NDArray[Any] = vectors / numpy.sqrt(numpy.maximum(values, 1e-9 * values[-1]))
        return found

    def covariance(self, one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
        """The process' covariance (m, n) of two lists of scaled parameters, without the constant."""
        steps = (one[:, None] - other[None, :]) / numpy.array(self.lengths)
        r = numpy.sqrt(5 * (steps**2).sum(axis=-1))
        found: NDArray[Any] = self.strength**2 * (1 + r + r**2 / 3) * numpy.exp(-r)
        return found


@dataclass(frozen=True)
class Fit:
    """One candidate and its weight, 0 to 1; the mean of its basis' factors (p,) and a root of their covariance (p, p)."""

    basis: "Basis"
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
        first, second = numpy.zeros(len(x)), numpy.zeros(len(x))
        for fit in self.fits:
            here = fit.basis.at(scaled)
            middle = here @ fit.mean
            # What the spanning designs leave open between them is added to the variance.
            left = numpy.maximum(fit.basis.strength**2 - (here[:, 1:] ** 2).sum(axis=1), 0)
            first += fit.weight * middle
            second += fit.weight * (middle**2 + ((here @ fit.root) ** 2).sum(axis=1) + left)
        reach = norm.ppf((1 + confidence) / 2) * numpy.sqrt(numpy.maximum(second - first**2, 0))
        rate, low, high = (1 / (1 + numpy.exp(-value)) for value in (first, first - reach, first + reach))
        return rate, low, high


def success_model(parameters: ArrayLike, passed: ArrayLike, counted: ArrayLike, seed: int = 1007) -> SuccessModel:
    """Fit to designs with parameters (d, k), k 1 or 2, of which ``passed`` of ``counted`` runs (d,) succeeded."""
    x, k, n = (numpy.asarray(values, dtype=float) for values in (parameters, passed, counted))
    if x.ndim != 2 or x.shape[1] not in LENGTHS:
        raise FoldcarError("a success model needs a table of designs with one or two parameters")
    if not numpy.all(numpy.isfinite(x)):
        raise FoldcarError("a success model needs finite parameters of each design")
    if k.shape != (len(x),) or n.shape != (len(x),) or not numpy.all((k >= 0) & (k <= n)):
        raise FoldcarError(f"a success model needs 0 ≤ passed ≤ counted for each of the {len(x)} designs")
    low, span = x[n > 0].min(axis=0, initial=numpy.inf), numpy.ptp(x[n > 0], axis=0) if (n > 0).any() else numpy.zeros(1)
    if numpy.count_nonzero(n) < 4 or not numpy.all(span > 0):
        raise FoldcarError(
            f"a success model needs runs of at least 4 designs that differ in each parameter; {numpy.count_nonzero(n)} "
            "designs have runs"
        )
    with_runs = n > 0
    scaled, k, n = (x[with_runs] - low) / span, k[with_runs], n[with_runs]
    spanning = _spread(scaled)
    fold = numpy.random.default_rng(seed).permutation(len(n)) % min(FOLDS, len(n))
    candidates = [
        Basis(spanning, lengths, strength)
        for lengths in product(LENGTHS[x.shape[1]], repeat=x.shape[1])
        for strength in STRENGTHS
    ]
    scores = []
    for basis in candidates:
        here = basis.at(scaled)
        score = 0.0
        for out in range(int(numpy.max(fold)) + 1):
            mean, root = _laplace(here[fold != out], k[fold != out], n[fold != out])
            score += _predictive(here[fold == out], mean, root, k[fold == out], n[fold == out])
        scores.append(score)
    weights = numpy.exp(numpy.array(scores) - max(scores))
    weights = numpy.where(weights >= LEAST_WEIGHT * weights.sum(), weights, 0.0)
    weights /= weights.sum()
    fits = tuple(
        Fit(basis, float(weight), *_laplace(basis.at(scaled), k, n))
        for basis, weight in zip(candidates, weights, strict=True)
        if weight
    )
    return SuccessModel(fits, max(scores) / float(n.sum()), low, span)


def _spread(scaled: NDArray[Any]) -> NDArray[Any]:
    """At most SPANNING of the designs, each the one that is furthest from those before it."""
    designs = numpy.unique(scaled, axis=0)
    chosen = [0]
    distances = numpy.full(len(designs), numpy.inf)
    while len(chosen) < min(SPANNING, len(designs)):
        distances = numpy.minimum(distances, ((designs - designs[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distances.argmax()))
    return designs[chosen]


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
    from scipy.special import logsumexp

    _, shares = binomial_normal(basis @ mean, numpy.linalg.norm(basis @ root, axis=1), passed, counted)
    return float(logsumexp(shares, axis=-1).sum())
