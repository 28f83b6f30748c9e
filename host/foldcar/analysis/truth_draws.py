"""Possible true success rates of all designs together, given simulation and the trials so far.

The log-odds of a design's true rate are those of its simulated rate, scaled and shifted for all designs alike, plus a
smooth deviation along the parameters (a Gaussian process) and one of the design's own. Trials are binomial. The
posterior is Laplace's approximation (Rasmussen and Williams 2006, section 3.4): joint, so that it says what a trial at
one design tells of another. For choices; rates are stated by intervals that were validated by coverage.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError

# Prior standard deviations in log-odds: of the common shift, of the common slope (mean 1), of the smooth deviation and
# its length as a share of the parameters' range, of a design's own deviation.
SHIFT, SLOPE, SMOOTH, LENGTH, OWN = 1.5, 0.5, 1.0, 0.25, 0.3
# More runs do not make simulation truer: at most so many count towards the log-odds of 0 or all passed.
MOST_RUNS = 100
NEWTON_STEPS = 50
TOLERANCE = 1e-9


def truth_draws(
    parameters: ArrayLike, runs: ArrayLike, trials: ArrayLike, draws: int = 1000, seed: int = 0
) -> NDArray[Any]:
    """Draws (draws, designs) of the true rates, 0 to 1, the same for the same ``seed``.

    ``parameters`` (designs, k); ``runs`` and ``trials`` (designs, 2): passed and all. A design without runs has the mean
    log-odds of simulation.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    if x.ndim != 2 or f.shape != (len(x), 2) or y.shape != (len(x), 2):
        raise FoldcarError("truth draws need parameters (designs, k), and runs and trials (designs, 2)")
    mean, covariance = _prior(unit_range(x), _log_odds(f))
    seen = y[:, 1] > 0
    if seen.any():
        mean, covariance = _posterior(mean, covariance, seen, y[seen])
    random = numpy.random.default_rng(seed)
    values, vectors = numpy.linalg.eigh(covariance)
    root = vectors * numpy.sqrt(values.clip(0))
    latent = mean + random.standard_normal((draws, len(x))) @ root.T
    return 1 / (1 + numpy.exp(-latent))


def unit_range(parameters: NDArray[Any]) -> NDArray[Any]:
    """The parameters (designs, k), each scaled to 0 to 1 over its range; 0 where it does not vary."""
    low, span = parameters.min(axis=0), numpy.ptp(parameters, axis=0)
    return (parameters - low) / numpy.where(span > 0, span, 1.0)


def _log_odds(runs: NDArray[Any]) -> NDArray[Any]:
    share = numpy.where(runs[:, 1] > 0, runs[:, 0] / runs[:, 1].clip(1), 0.5)
    number = runs[:, 1].clip(0, MOST_RUNS)
    smoothed = (share * number + 0.5) / (number + 1)
    found = numpy.log(smoothed / (1 - smoothed))
    known = runs[:, 1] > 0
    found[~known] = found[known].mean() if known.any() else 0.0
    return numpy.asarray(found)


def _prior(unit: NDArray[Any], log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    squares = ((unit[:, None, :] - unit[None, :, :]) ** 2).sum(axis=2)
    smooth = SMOOTH**2 * numpy.exp(-squares / (2 * LENGTH**2))
    common = SHIFT**2 + SLOPE**2 * numpy.outer(log_odds, log_odds)
    return log_odds, common + smooth + OWN**2 * numpy.eye(len(unit))


def _posterior(
    mean: NDArray[Any], covariance: NDArray[Any], seen: NDArray[Any], trials: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Mean and covariance of all log-odds given the trials (passed, all) of the ``seen`` designs."""
    inner = covariance[numpy.ix_(seen, seen)]
    precision = numpy.linalg.inv(inner)
    prior = mean[seen]
    latent = prior.copy()
    weight = numpy.ones_like(latent)
    for _ in range(NEWTON_STEPS):
        rate = 1 / (1 + numpy.exp(-latent))
        weight = trials[:, 1] * rate * (1 - rate)
        gradient = trials[:, 0] - trials[:, 1] * rate - precision @ (latent - prior)
        step = numpy.linalg.solve(precision + numpy.diag(weight), gradient)
        # A full step may overshoot where the likelihood is flat.
        step *= min(1.0, 2.0 / max(float(numpy.abs(step).max()), TOLERANCE))
        latent = latent + step
        if float(numpy.abs(step).max()) < TOLERANCE:
            break
    across = covariance[:, seen]
    found = mean + across @ precision @ (latent - prior)
    noise = numpy.diag(1 / weight.clip(1e-9))
    return found, covariance - across @ numpy.linalg.solve(inner + noise, across.T)
