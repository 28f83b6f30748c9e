"""Intervals of success rates that hold at whatever number of runs one stops.

If the rate were p, the likelihood of the runs under a mixture of rates, Beta(1/2, 1/2), divided by that under p would
exceed 1/alpha at any time with a probability of at most alpha (Ville's inequality). The interval holds the p at which it
does not: the Beta-binomial mixture of Robbins (1970, doi:10.1214/aoms/1177696786), as in Howard et al. (2021, 1810.08240)
and Waudby-Smith and Ramdas (2010.09686). It is wider than one for a number of runs that was fixed beforehand: after 100
runs, half of them passed, 15 instead of 10 percentage points to each side.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence
from foldcar.errors import FoldcarError

# Parameters of the mixture: with 1/2 the interval is narrow near 0 and 1, where most designs are.
MIXTURE = 0.5
# Halvings of [0, 1]: the ends are exact to 1e-15.
HALVINGS = 50


def anytime_interval(
    successes: ArrayLike, runs: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The interval (low, high), each 0 to 1, of the rate behind ``successes`` of ``runs``; arrays of one shape.

    Each covers its rate with at least ``confidence`` at all numbers of runs together. Without runs it is 0 to 1.
    FoldcarError for counts or a confidence that cannot be.
    """
    passed, total = numpy.broadcast_arrays(numpy.asarray(successes, float), numpy.asarray(runs, float))
    if not numpy.all((passed >= 0) & (passed <= total)):
        raise FoldcarError("successes must be 0 to the number of runs")
    check_confidence(confidence)
    threshold = -numpy.log1p(-confidence)
    return _lowest_rate(passed, total, threshold), 1 - _lowest_rate(total - passed, total, threshold)


def anytime_mean_interval(successes: ArrayLike, runs: ArrayLike, confidence: float = 0.95) -> tuple[float, float]:
    """The interval (low, high) of the mean rate of several designs, from arrays (designs,) of counts.

    The mean of their own intervals, each at such a confidence that all hold together with ``confidence`` (Bonferroni).
    """
    count = numpy.size(successes)
    if not count:
        raise FoldcarError("the mean rate of no design has no interval")
    low, high = anytime_interval(successes, runs, 1 - (1 - confidence) / count)
    return float(low.mean()), float(high.mean())


def _lowest_rate(passed: NDArray[Any], total: NDArray[Any], threshold: float) -> NDArray[Any]:
    """The lowest rates at which the logarithm of the ratio of likelihoods is at most ``threshold``."""
    below, above = numpy.zeros(passed.shape), passed / numpy.maximum(total, 1)
    for _ in range(HALVINGS):
        middle = (below + above) / 2
        inside = _log_ratio(passed, total, middle) <= threshold
        below, above = numpy.where(inside, below, middle), numpy.where(inside, middle, above)
    return numpy.where(passed > 0, above, 0.0)


def _log_ratio(passed: NDArray[Any], total: NDArray[Any], rate: NDArray[Any]) -> NDArray[Any]:
    from scipy.special import betaln, xlog1py, xlogy

    mixed = betaln(passed + MIXTURE, total - passed + MIXTURE) - betaln(MIXTURE, MIXTURE)
    ratio: NDArray[Any] = mixed - xlogy(passed, rate) - xlog1py(total - passed, -rate)
    return ratio
