"""Success rates and mean times from independent runs, with the interval that suits the stopping rule of the runs.

If the number of runs was fixed, the interval is Wilson's. It covers 95 % on average over the true rate, and less at some
rates. Clopper and Pearson's covers at least 95 % at every rate, and is wider (Brown, Cai and DasGupta 2001,
doi:10.1214/ss/1009213286). The anytime-valid interval holds whenever the runs are stopped.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError

# The anytime-valid interval mixes rates by Beta(1/2, 1/2), so it is narrow near 0 and 1, where most designs are.
MIXTURE = 0.5
# Bisections of [0, 1]: the ends are exact to 1e-15.
HALVINGS = 50
# Midpoints of equally probable parts of a distribution.
MIDPOINTS = (numpy.arange(100) + 0.5) / 100


@dataclass(frozen=True)
class Rate:
    """An estimated success probability; ``value``, ``low``, ``high`` and ``confidence`` are 0 to 1.

    ``method`` describes the interval and its data to readers.
    """

    value: float
    low: float
    high: float
    confidence: float
    method: str

    @classmethod
    def from_counts(cls, passed: int, runs: int, what: str, stopped: bool = False, confidence: float = 0.95) -> "Rate":
        """Estimate a success rate from ``passed`` of ``runs``, with the interval of :func:`rate_interval`.

        ``what`` says for readers what the counts are from, such as "40 runs". ``stopped`` is whether a stopping rule
        ended the runs. Raises FoldcarError if the counts are impossible.
        """
        low, high = rate_interval(passed, runs, stopped, confidence)
        return cls(passed / runs, low, high, confidence, f"{interval_name(stopped)} interval of {what}")

    @property
    def half_width(self) -> float:
        """Half of the interval's width, 0 to 0.5."""
        return (self.high - self.low) / 2


def rate_interval(passed: int, runs: int, stopped: bool = False, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval (low, high) of the rate: anytime-valid if a rule ``stopped`` the runs, else Wilson's."""
    if not stopped:
        return wilson_interval(passed, runs, confidence)
    low, high = anytime_interval(passed, runs, confidence)
    return float(low), float(high)


def interval_name(stopped: bool) -> str:
    """Return the name of the interval of :func:`rate_interval`."""
    return "anytime-valid" if stopped else "Wilson"


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return Wilson's score interval (1927) (low, high), each 0 to 1, for ``successes`` of ``runs``."""
    from scipy.special import ndtri

    check_counts(successes, runs)
    check_confidence(confidence)
    z_squared = float(ndtri((1 + confidence) / 2)) ** 2
    rate = successes / runs
    scale = 1 + z_squared / runs
    middle = (rate + z_squared / (2 * runs)) / scale
    half_width = math.sqrt(z_squared * (rate * (1 - rate) / runs + z_squared / (4 * runs**2))) / scale
    # Exact at the ends, in spite of rounding.
    low = 0.0 if successes == 0 else middle - half_width
    high = 1.0 if successes == runs else middle + half_width
    return low, high


def clopper_pearson_interval(successes: ArrayLike, runs: ArrayLike, confidence: float = 0.95) -> tuple[Any, Any]:
    """Return Clopper and Pearson's interval (1934) (low, high), each 0 to 1, for numbers or arrays of one shape."""
    from scipy.special import betaincinv

    passed, total = numpy.asarray(successes, float), numpy.asarray(runs, float)
    failed = total - passed
    tail = (1 - confidence) / 2
    # The lower quantile is undefined without successes, and the upper one without failures.
    low = betaincinv(numpy.maximum(passed, 1), failed + 1, tail)
    high = betaincinv(passed + 1, numpy.maximum(failed, 1), 1 - tail)
    return numpy.where(passed > 0, low, 0.0), numpy.where(failed > 0, high, 1.0)


def anytime_interval(
    successes: ArrayLike, runs: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return an interval (low, high) of the success rate that stays valid if you look at it after every run.

    ``successes`` and ``runs`` are arrays of one shape. So are low and high, which are between 0 and 1. With a probability
    of at least ``confidence``, the intervals after 1, 2, 3, ... runs all contain the true rate. For this it is wider than
    Wilson's interval: after 100 runs, of which half passed, it reaches 15 percentage points to each side of the rate
    instead of 10. Without runs it is 0 to 1. Raises FoldcarError if the counts are impossible.

    Derivation: let the ratio be the likelihood of the runs if their rate has the distribution Beta(1/2, 1/2), divided by
    their likelihood at the true rate. Let alpha be 1 - ``confidence``. By Ville's inequality, the probability that the
    ratio exceeds 1/alpha after any run is at most alpha. So the interval has all rates for which the ratio is at most
    1/alpha (Robbins 1970, doi:10.1214/aoms/1177696786; Howard et al. 2021, 1810.08240).
    """
    passed, total = numpy.broadcast_arrays(numpy.asarray(successes, float), numpy.asarray(runs, float))
    if not numpy.all((passed >= 0) & (passed <= total)):
        raise FoldcarError("successes must be 0 to the number of runs")
    check_confidence(confidence)
    log_ratio_limit = -numpy.log1p(-confidence)
    low = _lowest_rate(passed, total, log_ratio_limit)
    # The highest rate of success is the lowest rate of failure.
    high = 1 - _lowest_rate(total - passed, total, log_ratio_limit)
    return low, high


def limited_mean(
    crossed: int, runs: int, sum_s: float, sum_squares_s2: float, limit_s: float
) -> tuple[float, float, float]:
    """Return the mean time of all runs with its 95 % interval (mean, low, high), in seconds.

    ``crossed`` of the ``runs`` passed, which means that they crossed the course. ``sum_s`` is the sum of their times, and
    ``sum_squares_s2`` the sum of the squares of their times. A run that did not cross counts as ``limit_s``. Raises
    FoldcarError if counts or times are impossible.

    The interval is a Bayesian bootstrap (Rubin 1981, doi:10.1214/aos/1176345338), because Student's t covers too little
    at ten runs. Two pseudo-runs of weight 1/2 are added: one crosses at time 0, the other never. So the interval is
    Jeffreys' interval if all runs cross at time 0 or never. One step is approximate: the mean time of the runs that cross
    gets a beta distribution with the mean and the variance of the bootstrap.
    """
    from scipy.special import betaincinv

    check_counts(crossed, runs)
    max_sum_s = crossed * limit_s * (1 + 1e-9)
    if not (limit_s > 0 and 0 <= sum_s <= max_sum_s and sum_squares_s2 >= 0):
        raise FoldcarError(f"times to cross must be 0 to {limit_s:g} s, the limit")
    failed = runs - crossed
    mean = (sum_s + failed * limit_s) / runs
    # In the bootstrap, the fraction of runs that cross and the mean time of these runs are independent. Each is
    # represented by its quantiles. So there is a mean time over all runs for each pair of such quantiles; in it, the runs
    # that do not cross take the limit.
    crossed_fractions = betaincinv(crossed + 0.5, failed + 0.5, MIDPOINTS)
    crossing_times = _quantiles_of_mean_crossing_time(crossed, sum_s / limit_s, sum_squares_s2 / limit_s**2)
    mean_times_s = limit_s * (1 - numpy.outer(crossed_fractions, 1 - crossing_times))
    low, high = numpy.quantile(mean_times_s, [0.025, 0.975], method="hazen")
    return mean, min(float(low), mean), max(float(high), mean)


def _quantiles_of_mean_crossing_time(crossed: int, sum_times: float, sum_squares: float) -> NDArray[Any]:
    """Return the quantiles of the mean time of the runs that cross, in the bootstrap of :func:`limited_mean`.

    Times are fractions of the time limit. ``crossed`` is the number of runs that cross. ``sum_times`` is the sum of
    their times, and ``sum_squares`` the sum of the squares of their times. The bootstrap adds an invented run with the
    weight 1/2 that crosses at time 0, so the number of runs is ``crossed`` + 1/2. The result is [0] if the mean time
    has no variance.
    """
    from scipy.special import betaincinv

    mean = sum_times / (crossed + 0.5)
    mean_square = sum_squares / (crossed + 0.5)
    variance = (mean_square - mean**2) / (crossed + 1.5)
    if variance <= 0 or not 0 < mean < 1:
        return numpy.zeros(1)
    # The beta distribution with this mean and variance has the parameters mean * strength and (1 - mean) * strength.
    strength = mean * (1 - mean) / variance - 1
    return numpy.asarray(betaincinv(mean * strength, (1 - mean) * strength, MIDPOINTS))


def check_counts(successes: float, runs: float) -> None:
    """Raise FoldcarError if there is less than one run, or successes are not 0 to ``runs``."""
    if not runs >= 1:
        raise FoldcarError(f"an interval needs at least 1 run; there are {runs:g}")
    if not 0 <= successes <= runs:
        raise FoldcarError(f"successes must be 0 to {runs:g}, the number of runs; they are {successes:g}")


def check_confidence(confidence: float) -> None:
    """Raise FoldcarError if the confidence is not between 0 and 1."""
    if not 0 < confidence < 1:
        raise FoldcarError(f"confidence must be between 0 and 1, as 0.95; it is {confidence:g}")


def _lowest_rate(passed: NDArray[Any], total: NDArray[Any], log_ratio_limit: float) -> NDArray[Any]:
    """Return the lower ends of the intervals of :func:`anytime_interval`, for ``passed`` of ``total`` runs (arrays).

    There the log of the ratio, which is defined in that function, is equal to ``log_ratio_limit``. This rate is found by
    bisection between 0 and the observed rate.
    """
    from scipy.special import betaln, xlog1py, xlogy

    failed = total - passed
    # The log likelihood of the runs if their rate has the distribution Beta(MIXTURE, MIXTURE).
    log_mixture = betaln(passed + MIXTURE, failed + MIXTURE) - betaln(MIXTURE, MIXTURE)
    rate_below = numpy.zeros(passed.shape)
    rate_within = passed / numpy.maximum(total, 1)
    for _ in range(HALVINGS):
        middle = (rate_below + rate_within) / 2
        # xlogy(a, b) is a log(b), and xlog1py(a, b) is a log(1 + b).
        log_ratio = log_mixture - xlogy(passed, middle) - xlog1py(failed, -middle)
        is_within = log_ratio <= log_ratio_limit
        rate_below = numpy.where(is_within, rate_below, middle)
        rate_within = numpy.where(is_within, middle, rate_within)
    # Without a passed run, the interval begins at 0.
    return numpy.where(passed > 0, rate_within, 0.0)
