"""Times to cross as survival data: runs that did not cross in time are censored, not left out.

A car that failed never crosses: its time is censored at the limit, whenever it failed. A run that was ended from
outside is censored then.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence, check_counts
from foldcar.errors import FoldcarError

# Draws of the restricted mean, and their seed.
DRAWS = 8000
SEED = 1007
# Midpoints of equal parts of a distribution.
PARTS = (numpy.arange(100) + 0.5) / 100


@dataclass(frozen=True)
class TimesToCross:
    """The Kaplan-Meier estimate, and the mean time up to the limit (restricted mean), in seconds.

    ``not_crossed[i]`` (k,) is the fraction that has not crossed at ``times_s[i]``; ``low`` and ``high`` (k,) are its
    interval. The median is None where fewer than half cross.
    """

    times_s: NDArray[Any]
    not_crossed: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]
    median_s: float | None
    restricted_mean_s: float
    restricted_mean_interval_s: tuple[float, float]
    limit_s: float
    runs: int


def times_to_cross(times_s: ArrayLike, crossed: ArrayLike, limit_s: float, confidence: float = 0.95) -> TimesToCross:
    """Estimate from times (n,) at which runs crossed, or were censored where ``crossed`` (n,) is false.

    Intervals of fractions are log-log ones (Kalbfleisch and Prentice 1980). That of the restricted mean is a Bayesian
    bootstrap (Rubin 1981, doi:10.1214/aos/1176345338) with half a run that crosses at once and half a run that never
    does: where runs cross at once or never, it is Jeffreys' interval. Student's t covers too little at ten runs.
    """
    from scipy.stats import CensoredData, ecdf

    check_confidence(confidence)
    times, done = numpy.asarray(times_s, dtype=float), numpy.asarray(crossed, dtype=bool)
    if times.ndim != 1 or times.shape != done.shape or not len(times):
        raise FoldcarError("times to cross need at least one run, each with its time and whether it crossed")
    if not (limit_s > 0 and numpy.all((times >= 0) & (times <= limit_s))):
        raise FoldcarError(f"times to cross must be 0 to {limit_s:g} s, the limit")
    survival = ecdf(CensoredData.right_censored(times, ~done)).sf
    ends = survival.quantiles
    # Where all or none have crossed the formula has no value, of which scipy warns: nothing is excluded there.
    with warnings.catch_warnings(), numpy.errstate(divide="ignore", invalid="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)
        interval = survival.confidence_interval(confidence, method="log-log")
    low, high = interval.low.probabilities, interval.high.probabilities
    low, high = numpy.where(numpy.isnan(low), 0.0, low), numpy.where(numpy.isnan(high), 1.0, high)
    half = numpy.flatnonzero(survival.probabilities <= 0.5)
    median = float(ends[half[0]]) if len(half) else None
    mean = _restricted_means(times, done, numpy.ones((1, len(times))), limit_s)[0]
    random = numpy.random.default_rng(SEED)
    weights = random.standard_gamma(numpy.concatenate([numpy.ones(len(times)), [0.5, 0.5]]), (DRAWS, len(times) + 2))
    means = _restricted_means(numpy.append(times, [0.0, limit_s]), numpy.append(done, [True, False]), weights, limit_s)
    low_s, high_s = numpy.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2])
    within = (min(float(low_s), mean), max(float(high_s), mean))
    return TimesToCross(ends, survival.probabilities, low, high, median, float(mean), within, limit_s, len(times))


def limited_mean(
    crossed: int, runs: int, sum_s: float, sum_squares_s2: float, limit_s: float, confidence: float = 0.95
) -> tuple[float, float, float]:
    """The restricted mean and its interval (mean, low, high), in seconds, of runs whose other ones never cross.

    From sums over the runs that crossed, of their times and of the squares. It is the interval of :func:`times_to_cross`
    in closed form but for one step: the mean time of crossing has a beta distribution of the same mean and variance.
    """
    from scipy.special import betaincinv

    check_confidence(confidence)
    check_counts(crossed, runs)
    if not (limit_s > 0 and 0 <= sum_s <= crossed * limit_s * (1 + 1e-9) and sum_squares_s2 >= 0):
        raise FoldcarError(f"times to cross must be 0 to {limit_s:g} s, the limit")
    mean = (sum_s + (runs - crossed) * limit_s) / runs
    # By the bootstrap's weights the share that crosses and the mean time of these are independent.
    shares = betaincinv(crossed + 0.5, runs - crossed + 0.5, PARTS)
    centre = sum_s / (crossed + 0.5) / limit_s
    variance = (sum_squares_s2 / (crossed + 0.5) / limit_s**2 - centre**2) / (crossed + 1.5)
    crossing = numpy.zeros(1)
    if variance > 0 and 0 < centre < 1:
        strength = centre * (1 - centre) / variance - 1
        crossing = betaincinv(centre * strength, (1 - centre) * strength, PARTS)
    means = limit_s * (1 - numpy.outer(shares, 1 - crossing))
    low, high = numpy.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2], method="hazen")
    return mean, min(float(low), mean), max(float(high), mean)


def _restricted_means(times: NDArray[Any], done: NDArray[Any], weights: NDArray[Any], limit_s: float) -> NDArray[Any]:
    """The area (draws,) under the Kaplan-Meier curve up to the limit, of runs with weights (draws, n)."""
    # At one time, those that cross come before those that are censored.
    order = numpy.lexsort((~done, times))
    sorted_weights = weights[:, order]
    at_risk = numpy.maximum(sorted_weights[:, ::-1].cumsum(axis=1)[:, ::-1], 1e-300)
    remaining = numpy.maximum(1 - sorted_weights * done[order] / at_risk, 0).cumprod(axis=1)
    widths = numpy.diff(numpy.append(times[order], limit_s))
    areas: NDArray[Any] = times[order][0] + remaining @ widths
    return areas
