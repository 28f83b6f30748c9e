"""An interval for the mean of bounded values that holds at every number of them (Waudby-Smith and Ramdas, 2010.09686).

A gambler who bets fairly on the values if their mean were m multiplies his stake by more than 2/alpha with a probability
of at most alpha/2 (Ville's inequality). The interval holds the means at which neither the gambler who bets on higher
values nor the one who bets on lower ones got so rich. Stakes are spread over fractions of the capital ("hedged grid
Kelly"), more closely near 0 and 1, as in Cover's universal portfolio; so the values' order does not matter.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence
from foldcar.errors import FoldcarError

# Fractions of the capital that are staked: midpoints of equal parts of the arcsine distribution.
FRACTIONS = numpy.sin(numpy.pi * (numpy.arange(64) + 0.5) / 128) ** 2
# Halvings of [0, 1]: the ends are exact to 1e-12.
HALVINGS = 40


def betting_interval(
    values: ArrayLike, confidence: float = 0.95, low: float = 0.0, high: float = 1.0
) -> tuple[float, float]:
    """The interval (low, high) of the mean of independent ``values`` (n,), which lie within ``low`` and ``high``.

    It covers with at least ``confidence`` whatever their distribution, and whenever one stops adding values for a reason
    seen in the past ones. Without values it is all of ``low`` to ``high``.
    """
    check_confidence(confidence)
    found = numpy.asarray(values, dtype=float)
    if not low < high:
        raise FoldcarError(f"the bounds of the values must differ: low {low:g}, high {high:g}")
    if found.ndim != 1 or not numpy.all((found >= low) & (found <= high)):
        raise FoldcarError(f"betting intervals need a list of values from {low:g} to {high:g}")
    scaled = (found - low) / (high - low)
    threshold = numpy.log(2 / (1 - confidence))
    span = high - low
    return low + span * _lowest_mean(scaled, threshold), high - span * _lowest_mean(1 - scaled, threshold)


def _lowest_mean(values: NDArray[Any], threshold: float) -> float:
    """The lowest mean in 0 to 1 at which bets on higher values earn no more than exp(threshold)."""
    below, above = 0.0, float(values.mean()) if len(values) else 0.0
    for _ in range(HALVINGS):
        middle = (below + above) / 2
        # A stake of a fraction c pays 1 - c + c x/m: its capital falls as m grows.
        if middle > 0 and _log_capital(values, middle) <= threshold:
            above = middle
        else:
            below = middle
    return below


def _log_capital(values: NDArray[Any], mean: float) -> float:
    from scipy.special import logsumexp

    gains = numpy.log1p(FRACTIONS * (values[:, None] / mean - 1)).sum(axis=0)
    return float(logsumexp(gains)) - float(numpy.log(len(FRACTIONS)))
