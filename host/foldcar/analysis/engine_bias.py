"""Success rates in one simulation by those in another one.

:func:`predicted_rates` orders runs and is no part of any statement on rates. The difference of log-odds (this simulation
less the other) is normal over designs, with unknown mean and spread, inferred from designs that both have run. Rates are
masses (RATES,) on a grid that is even in the arcsine: there the prior of Jeffreys is uniform. Some of it is mixed into
each prediction, so that own runs soon overrule a wrong one.

:func:`corrected_rates` estimates rates in a slow simulation by few runs of each design in it, and many in a fast one that
has run in the same environments, too: their difference is smoothed over designs.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.gaussian_process import LENGTHS, MANY_LENGTHS, Matern, shares_of, success_model, unit_range
from foldcar.errors import FoldcarError

# The grid of rates, and the ends of its cells.
RATES = numpy.sin(numpy.pi / 2 * (numpy.arange(64) + 0.5) / 64) ** 2
_ENDS = numpy.sin(numpy.pi / 2 * numpy.arange(1, 64) / 64) ** 2
_LOGIT_ENDS = numpy.log(_ENDS / (1 - _ENDS))
# The share of Jeffreys' prior in a prediction.
UNPREDICTED = 0.02
# Before any run (log-odds): standard deviation of the mean difference; scale of the spread's half-normal distribution.
MEAN_SCALE, SPREAD_SCALE = 1.0, 1.0
_SPREADS = numpy.linspace(0.05, 4, 80)
# Of the mean difference of rates over designs, and of its smooth part, candidates: standard deviations.
MEAN_DIFFERENCE, SMOOTH_DIFFERENCES = 0.15, (0.03, 0.1, 0.2)
# The least variance of a difference of two runs.
LEAST_VARIANCE = 1e-3


def corrected_rates(
    parameters: ArrayLike, fast_passed: ArrayLike, fast_runs: ArrayLike, differences: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return rates in the slow simulation and their credible band (rate, low, high), each (designs,) and 0 to 1.

    The rates are those in the environments of the fast simulation: ``fast_passed`` of ``fast_runs`` (designs,) of designs
    with ``parameters`` (designs, k). ``differences`` (designs, environments): 1 where a design passes in the slow
    simulation only, -1 where it passes in the fast one only, 0 where both agree, NaN where one of the two runs is
    missing. FoldcarError if there are too few designs.

    The mean differences d of designs are normal with covariance K + S. K is a constant and a Matern process. S is the
    noise of few environments: a part of each design's own and one that all designs share, as they meet the same
    environments. The rate is the smoothed fast one plus K (K + S)^-1 d.

    Example: ``rate, low, high = corrected_rates(widths, passed, [100] * 37, slow[:, :10] - fast[:, :10])``
    """
    from scipy.special import ndtri

    scaled = unit_range(numpy.asarray(parameters, dtype=float))
    rate, low, high = success_model(parameters, fast_passed, fast_runs).rates(parameters, confidence)
    table = numpy.asarray(differences, dtype=float)
    counted = numpy.isfinite(table).sum(axis=1)
    known = counted > 0
    if counted.max(initial=0) < 2:
        raise FoldcarError("a correction needs designs with runs in both simulations in two environments or more")
    table, counted = table[known], counted[known]
    means = numpy.nanmean(table, axis=1)
    left = numpy.where(numpy.isfinite(table), table - means[:, None], 0.0)
    environments = table.shape[1]
    own = max((left**2).sum() / max(counted.sum() - len(counted), 1), LEAST_VARIANCE)
    shared = max((left.mean(axis=0) ** 2).sum() / max(environments - 1, 1) - own / len(means), 0.0)
    noise = numpy.diag(own / counted) + shared / environments
    evidence, middles, squares = [], [], []
    for length in LENGTHS.get(scaled.shape[1], MANY_LENGTHS):
        smooth = Matern(scaled, length).covariance(scaled, scaled)
        for strength in SMOOTH_DIFFERENCES:
            prior = MEAN_DIFFERENCE**2 + strength**2 * smooth
            across = prior[:, known]
            covariance = prior[numpy.ix_(known, known)] + noise
            gain = numpy.linalg.solve(covariance, across.T).T
            middle = gain @ means
            evidence.append(-0.5 * (means @ numpy.linalg.solve(covariance, means) + numpy.linalg.slogdet(covariance)[1]))
            middles.append(middle)
            squares.append(middle**2 + numpy.diag(prior) - (gain * across).sum(axis=1))
    weights, reach = shares_of(evidence), ndtri((1 + confidence) / 2)
    difference = weights @ numpy.array(middles)
    variance = weights @ numpy.array(squares) - difference**2 + ((high - low) / (2 * reach)) ** 2
    half = reach * numpy.sqrt(variance)
    corrected = rate + difference
    return tuple(numpy.clip(ends, 0, 1) for ends in (corrected, corrected - half, corrected + half))


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
    k, n = (numpy.asarray(one, float)[:, None] for one in (passed, runs))
    log = numpy.log(prior) + xlogy(k, RATES) + xlog1py(n - k, -RATES)
    mass = numpy.exp(log - log.max(axis=1, keepdims=True))
    return numpy.asarray(mass / mass.sum(axis=1, keepdims=True))


def _log_odds(passed: ArrayLike, runs: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    """Log-odds and their variances with half a run added to either outcome (Haldane 1956, Anscombe 1956)."""
    good = numpy.asarray(passed, float) + 0.5
    bad = numpy.asarray(runs, float) - numpy.asarray(passed, float) + 0.5
    return numpy.log(good / bad), 1 / good + 1 / bad
