"""Success rates in one simulation, predicted from another one: they only order runs, no statement on rates rests on them.

The difference of log-odds (this simulation
less the other) is normal over designs, with unknown mean and spread, inferred from designs that both have run. Rates are
masses (RATES,) on a grid that is even in the arcsine: there the prior of Jeffreys is uniform. Some of it is mixed into
each prediction, so that own runs soon overrule a wrong one.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

# The grid of rates, and the ends of its cells.
RATES = numpy.sin(numpy.pi / 2 * (numpy.arange(64) + 0.5) / 64) ** 2
_ENDS = numpy.sin(numpy.pi / 2 * numpy.arange(1, 64) / 64) ** 2
_LOGIT_ENDS = numpy.log(_ENDS / (1 - _ENDS))
# The share of Jeffreys' prior in a prediction.
UNPREDICTED = 0.02
# Before any run (log-odds): standard deviation of the mean difference; scale of the spread's half-normal distribution.
MEAN_SCALE, SPREAD_SCALE = 1.0, 1.0
_SPREADS = numpy.linspace(0.05, 4, 80)


def pooled_difference(
    passed: ArrayLike, runs: ArrayLike, other_passed: ArrayLike, other_runs: ArrayLike
) -> tuple[float, float]:
    """Mean and variance of the difference of log-odds over designs, from counts (designs,) in both simulations."""
    here, here_variance = _log_odds(passed, runs)
    there, there_variance = _log_odds(other_passed, other_runs)
    both = (numpy.asarray(runs) > 0) & (numpy.asarray(other_runs) > 0)
    difference, noise = (here - there)[both], (here_variance + there_variance)[both]
    # The posterior of the spread on its grid, the mean integrated out.
    variance = noise + _SPREADS[:, None] ** 2
    precision = (1 / variance).sum(axis=1) + MEAN_SCALE**-2
    mean = (difference / variance).sum(axis=1) / precision
    log = -0.5 * (numpy.log(variance) + difference**2 / variance).sum(axis=1) + 0.5 * (mean**2 * precision)
    log -= 0.5 * (numpy.log(precision) + (_SPREADS / SPREAD_SCALE) ** 2)
    weight = numpy.exp(log - log.max())
    weight /= weight.sum()
    found = float(weight @ mean)
    return found, float(weight @ (_SPREADS**2 + 1 / precision + (mean - found) ** 2))


def predicted_rates(passed: ArrayLike, runs: ArrayLike, other_passed: ArrayLike, other_runs: ArrayLike) -> NDArray[Any]:
    """Masses (designs, RATES) of each design's rate, from its runs and from those of all designs in both simulations."""
    from scipy.special import ndtr, xlog1py, xlogy

    mean, spread = pooled_difference(passed, runs, other_passed, other_runs)
    there, noise = _log_odds(other_passed, other_runs)
    ends = ndtr((_LOGIT_ENDS - (there + mean)[:, None]) / numpy.sqrt(noise + spread)[:, None])
    cells = numpy.diff(ends, axis=1, prepend=0.0, append=1.0)
    known = (numpy.asarray(other_runs) > 0)[:, None]
    uniform = 1 / len(RATES)
    prior = numpy.where(known, (1 - UNPREDICTED) * cells + UNPREDICTED * uniform, uniform)
    k, n = (numpy.asarray(number, float)[:, None] for number in (passed, runs))
    log = numpy.log(prior) + xlogy(k, RATES) + xlog1py(n - k, -RATES)
    mass = numpy.exp(log - log.max(axis=1, keepdims=True))
    return numpy.asarray(mass / mass.sum(axis=1, keepdims=True))


def _log_odds(passed: ArrayLike, runs: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    """Log-odds and their variances with half a run added to either outcome (Haldane 1956, Anscombe 1956)."""
    good = numpy.asarray(passed, float) + 0.5
    bad = numpy.asarray(runs, float) - numpy.asarray(passed, float) + 0.5
    return numpy.log(good / bad), 1 / good + 1 / bad
