"""Times to cross as survival data: runs that did not cross in time are censored, not left out.

A car that failed never crosses: its time is censored at the limit, whenever it failed. A run that was ended from
outside is censored then.
"""

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence
from foldcar.errors import FoldcarError


@dataclass(frozen=True)
class TimesToCross:
    """The Kaplan-Meier estimate, and the mean time up to the limit (restricted mean), in seconds.

    ``not_crossed[i]`` (k,) is the fraction that has not crossed at ``times_s[i]``; ``low`` and ``high`` (k,) are its
    interval. The median is None where fewer than half cross. The restricted mean's interval is None for one run.
    """

    times_s: NDArray[Any]
    not_crossed: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]
    median_s: float | None
    restricted_mean_s: float
    restricted_mean_interval_s: tuple[float, float] | None
    limit_s: float
    runs: int


def times_to_cross(times_s: ArrayLike, crossed: ArrayLike, limit_s: float, confidence: float = 0.95) -> TimesToCross:
    """Estimate from times (n,) at which runs crossed, or were censored where ``crossed`` (n,) is false.

    Intervals of fractions are log-log ones (Kalbfleisch and Prentice 1980); that of the restricted mean is Greenwood's
    variance, times n/(n-1), with Student's t: the t interval of the mean where nothing is censored before the limit.
    """
    from scipy.stats import CensoredData, ecdf, t

    check_confidence(confidence)
    times, done = numpy.asarray(times_s, dtype=float), numpy.asarray(crossed, dtype=bool)
    if times.ndim != 1 or times.shape != done.shape or not len(times):
        raise FoldcarError("times to cross need at least one run, each with its time and whether it crossed")
    if not (limit_s > 0 and numpy.all((times >= 0) & (times <= limit_s))):
        raise FoldcarError(f"times to cross must be 0 to {limit_s:g} s, the limit")
    survival = ecdf(CensoredData.right_censored(times, ~done)).sf
    ends = survival.quantiles
    with numpy.errstate(divide="ignore", invalid="ignore"):
        interval = survival.confidence_interval(confidence, method="log-log")
    low, high = interval.low.probabilities, interval.high.probabilities
    # Where all or none have crossed the formula has no value: nothing is excluded.
    low, high = numpy.where(numpy.isnan(low), 0.0, low), numpy.where(numpy.isnan(high), 1.0, high)
    half = numpy.flatnonzero(survival.probabilities <= 0.5)
    mean, variance = _restricted_mean(ends, survival.probabilities, times, done, limit_s)
    n = len(times)
    within = None
    if n > 1 and done.any():
        reach = float(t.ppf((1 + confidence) / 2, n - 1)) * float(numpy.sqrt(variance * n / (n - 1)))
        within = (max(mean - reach, 0.0), min(mean + reach, limit_s))
    median = float(ends[half[0]]) if len(half) else None
    return TimesToCross(ends, survival.probabilities, low, high, median, mean, within, limit_s, n)


def _restricted_mean(
    ends: NDArray[Any], fractions: NDArray[Any], times: NDArray[Any], done: NDArray[Any], limit_s: float
) -> tuple[float, float]:
    """The area under the fractions up to the limit, and Greenwood's variance of it."""
    edges = numpy.concatenate([[0.0], ends, [limit_s]])
    areas = numpy.diff(edges) * numpy.concatenate([[1.0], fractions])
    # The area after each of the times.
    beyond = areas[::-1].cumsum()[::-1][1:]
    at_risk = (times[None, :] >= ends[:, None]).sum(axis=1)
    events = ((times[None, :] == ends[:, None]) & done).sum(axis=1)
    survivors = at_risk - events
    terms = numpy.where(survivors > 0, beyond**2 * events / numpy.maximum(at_risk * survivors, 1), 0.0)
    return float(areas.sum()), float(terms.sum())
