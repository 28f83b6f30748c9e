"""Intervals of a success probability from a number of independent runs.

Wilson's and Jeffreys' cover 95 % on average over the true rate, and less at some rates; Clopper and Pearson's covers at
least that at every rate and is wider (Brown, Cai and DasGupta 2001, doi:10.1214/ss/1009213286).
"""

from functools import lru_cache

from foldcar.errors import FoldcarError


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval (low, high), each 0 to 1, for ``successes`` of ``runs`` (1927)."""
    return _scipy_interval(successes, runs, confidence, "wilson")


def clopper_pearson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """The interval (low, high), each 0 to 1, that covers at least ``confidence`` at every rate (1934)."""
    return _scipy_interval(successes, runs, confidence, "exact")


def jeffreys_interval(successes: float, runs: float, confidence: float = 0.95) -> tuple[float, float]:
    """The interval (low, high) between quantiles of Beta(successes + 1/2, failures + 1/2); counts may be fractions.

    It begins at 0 when no run succeeded, and ends at 1 when all did (Brown, Cai and DasGupta 2001, section 4.1.2).
    """
    from scipy.stats import beta

    check_counts(successes, runs)
    check_confidence(confidence)
    tail = (1 - confidence) / 2
    posterior = beta(successes + 0.5, runs - successes + 0.5)
    low = float(posterior.ppf(tail)) if successes > 0 else 0.0
    high = float(posterior.ppf(1 - tail)) if successes < runs else 1.0
    return low, high


# Thousands of designs have the same few counts, and an interval takes half a millisecond.
@lru_cache(100_000)
def _scipy_interval(successes: int, runs: int, confidence: float, method: str) -> tuple[float, float]:
    from scipy.stats import binomtest

    check_counts(successes, runs)
    check_confidence(confidence)
    interval = binomtest(successes, runs).proportion_ci(confidence_level=confidence, method=method)
    return float(interval.low), float(interval.high)


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
