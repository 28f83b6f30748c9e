"""Success rates in one simulation by those in another one.

:func:`corrected_rates` estimates rates in a slow simulation by many runs in a fast one and few in both.

:func:`predicted_rates` only orders runs; no statement on rates rests on it. The difference of log-odds (this simulation
less the other) is normal over designs, with unknown mean and spread, inferred from designs that both have run. Rates are
masses (RATES,) on a grid that is even in the arcsine: there the prior of Jeffreys is uniform. Some of it is mixed into
each prediction, so that own runs soon overrule a wrong one.
"""

from itertools import product
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.gaussian_process import LENGTHS, MANY_LENGTHS, Matern, shares_of, unit_range
from foldcar.analysis.rate import check_confidence
from foldcar.analysis.smoothed_simulation import smoothed_simulation
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

# Standard deviations of the difference of rates: of its mean over designs; candidates for its smooth part and for the
# part of each design alone.
MEAN_DIFFERENCE, SMOOTH_DIFFERENCES, OWN_DIFFERENCES = 0.15, (0.1, 0.2), (0.05, 0.1)
# A design's variance of differences starts from the mean over designs, which counts as so many runs.
POOLED_RUNS = 10
MIN_VARIANCE = 1e-3


def corrected_rates(
    parameters: ArrayLike, passed_cheap: ArrayLike, passed_dear: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return success rates in the dear simulation with their credible bands (rate, low, high), each (designs,), 0 to 1.

    ``passed_cheap`` and ``passed_dear`` (designs, environments) are 1 where a run passed, 0 where it did not, NaN where
    the simulation has no run; a column is the same environment in both. ``parameters`` (designs, k) are those of the
    designs. A design without a run in the cheap simulation has NaN. FoldcarError if fewer than two environments have runs
    in both simulations.

    The rate is the cheap one, smoothed over designs, plus the difference of both. The mean differences d of designs,
    over the environments with runs in both, are normal with covariance K + S. K is that of the true differences: a
    constant, a Matern process over designs, a part of each design alone; candidates are weighted by their evidence. S is
    the noise of few environments: a part of each design alone, and one of all designs, which meet the same environments.
    The difference is K (K + S)^-1 d.

    Example: ``rate, low, high = corrected_rates(widths[:, None], multibody, mujoco)``
    """
    from scipy.special import ndtri

    check_confidence(confidence)
    every = numpy.asarray(parameters, dtype=float)
    cheap, dear = (numpy.asarray(table, dtype=float) for table in (passed_cheap, passed_dear))
    if cheap.ndim != 2 or cheap.shape != dear.shape or every.shape[:1] != cheap.shape[:1]:
        raise FoldcarError("a correction needs two tables of designs and environments that are alike, and parameters")
    present = numpy.isfinite(cheap).any(axis=1)
    cheap, dear, x = cheap[present], dear[present], every[present]
    counted = numpy.isfinite(cheap).sum(axis=1)
    simulated = smoothed_simulation(x, numpy.column_stack([numpy.nansum(cheap, axis=1), counted]), cheap)
    before, low, high = simulated.rates(confidence).T
    difference, variance = _differences(x, dear - cheap)
    reach = ndtri((1 + confidence) / 2)
    half = reach * numpy.sqrt(variance + ((high - low) / (2 * reach)) ** 2)
    rate = before + difference
    answer = numpy.full((3, len(present)), numpy.nan)
    answer[:, present] = numpy.clip([rate, rate - half, rate + half], 0, 1)
    return answer[0], answer[1], answer[2]


def _differences(x: NDArray[Any], table: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Mean and variance (designs,) of the true mean differences, by a table (designs, environments) with NaN."""
    table = table[:, numpy.isfinite(table).any(axis=0)]
    if table.shape[1] < 2:
        raise FoldcarError("a correction needs runs in both simulations in two environments or more")
    known = numpy.isfinite(table).any(axis=1)
    counted = numpy.isfinite(table[known]).sum(axis=1)
    means = numpy.nanmean(table[known], axis=1)
    residuals = numpy.where(numpy.isfinite(table[known]), table[known] - means[:, None], 0.0)
    squares = (residuals**2).sum(axis=1)
    pooled = max(squares.sum() / max(counted.sum() - len(counted), 1), MIN_VARIANCE)
    own = (squares + POOLED_RUNS * pooled) / (numpy.maximum(counted - 1, 0) + POOLED_RUNS)
    environments = table.shape[1]
    shared = max((residuals.mean(axis=0) ** 2).sum() / (environments - 1) - pooled / len(means), 0.0)
    noise = numpy.diag(own / counted) + shared / environments
    scaled, evidence, middles, variances = unit_range(x), [], [], []
    for length in LENGTHS.get(x.shape[1], MANY_LENGTHS):
        smooth = Matern(scaled, length).covariance(scaled, scaled)
        for strength, alone in product(SMOOTH_DIFFERENCES, OWN_DIFFERENCES):
            prior = MEAN_DIFFERENCE**2 + strength**2 * smooth + alone**2 * numpy.eye(len(x))
            covariance = prior[numpy.ix_(known, known)] + noise
            gain = numpy.linalg.solve(covariance, prior[known]).T
            fit = numpy.linalg.solve(covariance, means)
            evidence.append(-0.5 * (means @ fit + numpy.linalg.slogdet(covariance)[1]))
            middles.append(gain @ means)
            variances.append(numpy.diag(prior) - (gain * prior[:, known]).sum(axis=1))
    weights = shares_of(evidence)
    mean = weights @ numpy.array(middles)
    return mean, weights @ (numpy.array(variances) + (numpy.array(middles) - mean) ** 2)


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
