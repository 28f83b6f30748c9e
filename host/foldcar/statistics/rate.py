"""Success rates and mean times from independent runs, with the interval that holds for how the runs were stopped.

For a number of runs that was fixed beforehand it is Wilson's, which covers 95 % on average over the true rate, and less
at some rates; that of means is Clopper and Pearson's, which covers at least 95 % at every rate, and is wider (Brown, Cai
and DasGupta 2001, doi:10.1214/ss/1009213286). The anytime-valid one holds at whatever number of runs one stops.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError

# Parameters of the mixture: with 1/2 the anytime-valid interval is narrow near 0 and 1, where most designs are.
MIXTURE = 0.5
# Halvings of [0, 1]: the ends are exact to 1e-15.
HALVINGS = 50
# Midpoints of equal parts of a distribution.
PARTS = (numpy.arange(100) + 0.5) / 100


@dataclass(frozen=True)
class Rate:
    """An estimated success probability; ``value``, ``low``, ``high`` and ``confidence`` are 0 to 1.

    ``method`` says in a reader's words what the interval rests on.
    """

    value: float
    low: float
    high: float
    confidence: float
    method: str

    @classmethod
    def counted(cls, passed: int, runs: int, what: str, stopped: bool = False, confidence: float = 0.95) -> "Rate":
        """The share of ``runs`` that passed; ``what`` was counted, by a sweep that ``stopped`` when it knew."""
        low, high = rate_interval(passed, runs, stopped, confidence)
        return cls(passed / runs, low, high, confidence, f"{interval_name(stopped)} interval of {what}")

    @property
    def half_width(self) -> float:
        """Half of the interval's width, 0 to 0.5."""
        return (self.high - self.low) / 2


def rate_interval(passed: int, runs: int, stopped: bool = False, confidence: float = 0.95) -> tuple[float, float]:
    """The interval (low, high) of the rate behind ``passed`` of ``runs``: Wilson's, or the anytime-valid one."""
    if not stopped:
        return wilson_interval(passed, runs, confidence)
    low, high = anytime_interval(passed, runs, confidence)
    return float(low), float(high)


def interval_name(stopped: bool) -> str:
    """What :func:`rate_interval` is called."""
    return "anytime-valid" if stopped else "Wilson"


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval (low, high), each 0 to 1, for ``successes`` of ``runs`` (1927)."""
    from scipy.special import ndtri

    check_counts(successes, runs)
    check_confidence(confidence)
    z2 = float(ndtri((1 + confidence) / 2)) ** 2
    rate, scale = successes / runs, 1 + z2 / runs
    middle = (rate + z2 / (2 * runs)) / scale
    reach = math.sqrt(z2 * (rate * (1 - rate) / runs + z2 / (4 * runs**2))) / scale
    return 0.0 if successes == 0 else middle - reach, 1.0 if successes == runs else middle + reach


def clopper_pearson_interval(successes: ArrayLike, runs: ArrayLike, confidence: float = 0.95) -> tuple[Any, Any]:
    """The interval (low, high), each 0 to 1, that covers at least ``confidence`` at every rate (1934); of arrays, too."""
    from scipy.special import betaincinv

    passed, total, tail = numpy.asarray(successes, float), numpy.asarray(runs, float), (1 - confidence) / 2
    # Where there is no failure, or no success, the quantile is not defined.
    low = betaincinv(numpy.maximum(passed, 1), total - passed + 1, tail)
    high = betaincinv(passed + 1, numpy.maximum(total - passed, 1), 1 - tail)
    return numpy.where(passed > 0, low, 0.0), numpy.where(passed < total, high, 1.0)


def anytime_interval(
    successes: ArrayLike, runs: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The interval (low, high), each 0 to 1, of the rate behind ``successes`` of ``runs``; arrays of one shape.

    Each covers its rate with at least ``confidence`` at all numbers of runs together. Without runs it is 0 to 1.
    If the rate were p, the likelihood of the runs under a mixture of rates, Beta(1/2, 1/2), divided by that under p would
    exceed 1/alpha at any time with a probability of at most alpha (Ville's inequality). The interval holds the p at which
    it does not: the Beta-binomial mixture of Robbins (1970, doi:10.1214/aoms/1177696786), as in Howard et al. (2021,
    1810.08240). After 100 runs, half of them passed, it is 15 instead of Wilson's 10 percentage points to each side.
    """
    passed, total = numpy.broadcast_arrays(numpy.asarray(successes, float), numpy.asarray(runs, float))
    if not numpy.all((passed >= 0) & (passed <= total)):
        raise FoldcarError("successes must be 0 to the number of runs")
    check_confidence(confidence)
    threshold = -numpy.log1p(-confidence)
    return _lowest_rate(passed, total, threshold), 1 - _lowest_rate(total - passed, total, threshold)


def limited_mean(
    crossed: int, runs: int, sum_s: float, sum_squares_s2: float, limit_s: float
) -> tuple[float, float, float]:
    """The restricted mean time and its 95 % interval (mean, low, high), in seconds, of runs whose other ones never cross.

    Those count with the limit, whenever they ended. From sums over the runs that crossed, of their times and of the
    squares. The interval is a Bayesian bootstrap (Rubin 1981, doi:10.1214/aos/1176345338) with half a run that crosses at
    once and half a run that never does: where runs cross at once or never, it is Jeffreys'. In closed form but for one
    step: the mean time of crossing has a beta distribution of the same mean and variance. Student's t covers too little
    at ten runs.
    """
    from scipy.special import betaincinv

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
    low, high = numpy.quantile(means, [0.025, 0.975], method="hazen")
    return mean, min(float(low), mean), max(float(high), mean)


def check_counts(successes: float, runs: float) -> None:
    """Refuse fewer than one run, and successes outside 0 to ``runs``."""
    if not runs >= 1:
        raise FoldcarError(f"an interval needs at least 1 run; there are {runs:g}")
    if not 0 <= successes <= runs:
        raise FoldcarError(f"successes must be 0 to {runs:g}, the number of runs; they are {successes:g}")


def check_confidence(confidence: float) -> None:
    """Refuse a confidence that is not between 0 and 1."""
    if not 0 < confidence < 1:
        raise FoldcarError(f"confidence must be between 0 and 1, as 0.95; it is {confidence:g}")


def _lowest_rate(passed: NDArray[Any], total: NDArray[Any], threshold: float) -> NDArray[Any]:
    """The lowest rates at which the logarithm of the ratio of likelihoods is at most ``threshold``."""
    from scipy.special import betaln, xlog1py, xlogy

    mixed = betaln(passed + MIXTURE, total - passed + MIXTURE) - betaln(MIXTURE, MIXTURE)
    below, above = numpy.zeros(passed.shape), passed / numpy.maximum(total, 1)
    for _ in range(HALVINGS):
        middle = (below + above) / 2
        inside = mixed - xlogy(passed, middle) - xlog1py(total - passed, -middle) <= threshold
        below, above = numpy.where(inside, below, middle), numpy.where(inside, middle, above)
    return numpy.where(passed > 0, above, 0.0)
