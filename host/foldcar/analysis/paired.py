"""Two designs compared over the same environments, by the environments where they differ."""

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence
from foldcar.errors import FoldcarError

RESAMPLES = 4000


@dataclass(frozen=True)
class PairedRates:
    """The rate of the first design less the second's, -1 to 1, with its interval and McNemar's p-value.

    ``only_first`` and ``only_second`` count the environments that one design alone passed.
    """

    difference: float
    low: float
    high: float
    confidence: float
    only_first: int
    only_second: int
    environments: int
    p_value: float


def paired_rates(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> PairedRates:
    """Compare two designs that passed (1) or failed (0) in the same environments (n,).

    The test is McNemar's exact one (1947): the binomial test of the discordant environments. The interval is Wald's with
    one discordant environment added to each kind (Bonett and Price 2012, doi:10.3102/1076998611411915).
    """
    from scipy.stats import binomtest, norm

    check_confidence(confidence)
    a, b = _pair(first, second)
    if not numpy.all(((a == 0) | (a == 1)) & ((b == 0) | (b == 1))):
        raise FoldcarError("results to compare must be 0 (failed) or 1 (passed)")
    n, only_first, only_second = len(a), int(((a > b)).sum()), int(((a < b)).sum())
    p_value = binomtest(only_first, only_first + only_second).pvalue if only_first + only_second else 1.0
    up, down = (only_first + 1) / (n + 2), (only_second + 1) / (n + 2)
    half = norm.ppf((1 + confidence) / 2) * numpy.sqrt((up + down - (up - down) ** 2) / (n + 2))
    low, high = max(up - down - half, -1.0), min(up - down + half, 1.0)
    difference = (only_first - only_second) / n
    return PairedRates(
        difference, min(float(low), difference), max(float(high), difference), confidence, only_first, only_second, n,
        float(p_value),
    )


def paired_bootstrap(
    first: ArrayLike, second: ArrayLike, confidence: float = 0.95, seed: int = 1007
) -> tuple[float, float, float]:
    """The mean of ``first`` less ``second`` (n,), any metric, and its interval: (difference, low, high) in its unit.

    Environments are resampled; the interval is the expanded percentile one, which allows for few of them (Hesterberg
    2015, doi:10.1080/00031305.2015.1089789). For passed and failed, ``paired_rates`` is better.
    """
    from scipy.stats import norm, t

    check_confidence(confidence)
    a, b = _pair(first, second)
    differences = a - b
    n = len(differences)
    if n < 2 or numpy.ptp(differences) == 0:
        raise FoldcarError(
            f"a paired bootstrap needs environments whose differences vary; {n} of them, all different by "
            f"{differences[0]:g}, say nothing about its error"
        )
    rng = numpy.random.default_rng(seed)
    # Resampling n of n is drawing the number of times that each one is taken.
    means = rng.multinomial(n, numpy.full(n, 1 / n), size=RESAMPLES) @ differences / n
    tail = norm.cdf(numpy.sqrt(n / (n - 1)) * t.ppf((1 - confidence) / 2, n - 1))
    low, high = numpy.quantile(means, [tail, 1 - tail])
    return float(differences.mean()), float(low), float(high)


def _pair(first: ArrayLike, second: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    a, b = numpy.asarray(first, dtype=float), numpy.asarray(second, dtype=float)
    if a.ndim != 1 or a.shape != b.shape:
        raise FoldcarError(f"results to compare must be of the same environments; there are {a.size} and {b.size}")
    if not len(a):
        raise FoldcarError("the designs have no environment in common")
    if not (numpy.all(numpy.isfinite(a)) and numpy.all(numpy.isfinite(b))):
        raise FoldcarError("results to compare must be finite numbers")
    return a, b
