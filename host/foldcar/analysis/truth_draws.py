"""Possible true success rates of all designs together, given simulation and the trials so far.

The model is that of :mod:`foldcar.analysis.pooled_bias`, which states the rate of each design: the difference of trials
and simulation in log-odds is a Gaussian process whose strength and smoothness are averaged by the evidence. Here the
posterior is Laplace's approximation (Rasmussen and Williams 2006, section 3.4), drawn for all designs jointly, so that
it says what a trial at one design tells of another. For choices; rates are stated by pooled_bias.
"""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.pooled_bias import ALONE, CONSTANT, LENGTHS, SLOPE, SMOOTH
from foldcar.errors import FoldcarError

NEWTON_STEPS = 50
TOLERANCE = 1e-9


def truth_draws(
    parameters: ArrayLike, runs: ArrayLike, trials: ArrayLike, draws: int = 1000, seed: int = 0
) -> NDArray[Any]:
    """Draws (about ``draws``, designs) of the true rates, 0 to 1, the same for the same ``seed``.

    ``parameters`` (designs, k); ``runs`` and ``trials`` (designs, 2): passed and all; each design has at least one run.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    if x.ndim != 2 or f.shape != (len(x), 2) or y.shape != (len(x), 2) or not (f[:, 1] >= 1).all():
        raise FoldcarError("truth draws need parameters (designs, k), and runs (at least 1) and trials (designs, 2)")
    successes, failures = f[:, 0] + 0.5, f[:, 1] - f[:, 0] + 0.5
    mean, errors = numpy.log(successes / failures), 1 / successes + 1 / failures
    seen = y[:, 1] > 0
    distances = numpy.sqrt(((unit_range(x)[:, None] - unit_range(x)[None, :]) ** 2).sum(axis=2))
    common = CONSTANT**2 + SLOPE**2 * numpy.outer(mean, mean) + numpy.diag(errors)
    random = numpy.random.default_rng(seed)
    kernels = [common + _smooth(distances, *point) for point in itertools.product(SMOOTH, LENGTHS, ALONE)]
    fits = [_Fit.to(kernel[numpy.ix_(seen, seen)], mean[seen], y[seen]) for kernel in kernels]
    logs = numpy.array([fit.evidence for fit in fits])
    weights = numpy.exp(logs - logs.max())
    numbers = numpy.round(draws * weights / weights.sum()).astype(int)
    found = [
        _drawn(kernel, mean, seen, fit, number, random)
        for kernel, fit, number in zip(kernels, fits, numbers, strict=True)
        if number
    ]
    latent = numpy.concatenate(found)
    rates: NDArray[Any] = 1 / (1 + numpy.exp(-latent))
    return rates


def unit_range(parameters: NDArray[Any]) -> NDArray[Any]:
    """The parameters (designs, k), each scaled to 0 to 1 over its range; 0 where it does not vary."""
    low, span = parameters.min(axis=0), numpy.ptp(parameters, axis=0)
    found: NDArray[Any] = (parameters - low) / numpy.where(span > 0, span, 1.0)
    return found


def _smooth(distances: NDArray[Any], deviation: float, length: float, alone: float) -> NDArray[Any]:
    """The covariance of the smooth part (Matérn 5/2) and of each design's own one."""
    r = numpy.sqrt(5) * distances / length
    found: NDArray[Any] = deviation**2 * (1 + r + r**2 / 3) * numpy.exp(-r) + alone**2 * numpy.eye(len(r))
    return found


@dataclass(frozen=True)
class _Fit:
    """Laplace's approximation at the driven designs: the mode less the prior mean, the curvature, the log evidence."""

    shift: NDArray[Any]
    weight: NDArray[Any]
    evidence: float

    @classmethod
    def to(cls, kernel: NDArray[Any], prior: NDArray[Any], trials: NDArray[Any]) -> "_Fit":
        """The fit to ``trials`` (designs, 2), passed and all; none may be driven."""
        passed, counted = trials[:, 0], trials[:, 1]
        precision = numpy.linalg.inv(kernel)
        latent, weight = prior.copy(), numpy.ones_like(prior)
        for _ in range(NEWTON_STEPS):
            rate = 1 / (1 + numpy.exp(-latent))
            weight = (counted * rate * (1 - rate)).clip(1e-9)
            gradient = passed - counted * rate - precision @ (latent - prior)
            step = numpy.linalg.solve(precision + numpy.diag(weight), gradient)
            largest = float(numpy.abs(step).max(initial=0.0))
            # A full step may overshoot where the likelihood is flat.
            latent = latent + step * min(1.0, 2.0 / max(largest, TOLERANCE))
            if largest < TOLERANCE:
                break
        shift = latent - prior
        likelihood = float((passed * latent - counted * numpy.logaddexp(0, latent)).sum())
        root = numpy.sqrt(weight)
        _, volume = numpy.linalg.slogdet(numpy.eye(len(prior)) + root[:, None] * kernel * root[None, :])
        return cls(shift, weight, likelihood - float(shift @ precision @ shift) / 2 - float(volume) / 2)


def _drawn(
    kernel: NDArray[Any],
    mean: NDArray[Any],
    seen: NDArray[Any],
    fit: _Fit,
    number: int,
    random: numpy.random.Generator,
) -> NDArray[Any]:
    """Draws (number, designs) of all log-odds given the fit at the ``seen`` designs."""
    inner, across = kernel[numpy.ix_(seen, seen)], kernel[:, seen]
    middle = mean + across @ numpy.linalg.solve(inner, fit.shift)
    covariance = kernel - across @ numpy.linalg.solve(inner + numpy.diag(1 / fit.weight), across.T)
    values, vectors = numpy.linalg.eigh(covariance)
    root = vectors * numpy.sqrt(values.clip(0))
    found: NDArray[Any] = middle + random.standard_normal((number, len(mean))) @ root.T
    return found
