"""Differences between simulated and driven success rates, and between the ranks of designs by them.

A gap is the trials' rate minus simulation's: if it is negative, simulation is optimistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.rate import Rate

AGREES, OPTIMISTIC, PESSIMISTIC, TOO_FEW = "agrees", "optimistic", "pessimistic", "too few cars or trials"


@dataclass(frozen=True)
class Gap:
    """Trials' rate minus simulation's, -1 to 1, with its interval; ``confidence`` is 0 to 1."""

    value: float
    low: float
    high: float
    confidence: float

    def verdict(self, margin: float) -> str:
        """Return AGREES if the interval is within ``margin`` (0 to 1), OPTIMISTIC below 0, PESSIMISTIC above 0.

        Otherwise there were TOO_FEW cars or trials.
        """
        if -margin <= self.low and self.high <= margin:
            return AGREES
        if self.high < 0:
            return OPTIMISTIC
        return PESSIMISTIC if self.low > 0 else TOO_FEW


@dataclass(frozen=True)
class Rates:
    """The rates of one design in simulation and of built cars, at one confidence.

    ``correlation`` is that of paired results, 0 if they are not paired.
    """

    simulated: Rate
    driven: Rate
    correlation: float = 0.0


def mean_gap(rates: Sequence[Rates]) -> Gap:
    """Return the mean gap over one or more designs.

    The interval is by the square-and-add method (Newcombe 1998,
    doi:10.1002/(SICI)1097-0258(19980430)17:8<873::AID-SIM779>3.0.CO;2-I; Zou and Donner 2008). For one design with
    Wilson's intervals it is Newcombe's hybrid score interval. For paired results it is his method 10
    (doi:10.1002/(SICI)1097-0258(19981130)17:22<2635::AID-SIM954>3.0.CO;2-C).
    """
    f, y = (
        numpy.array([(rate.value, rate.low, rate.high) for rate in side])
        for side in ([rate.simulated for rate in rates], [rate.driven for rate in rates])
    )
    correlation = numpy.array([rate.correlation for rate in rates])
    value = float((y[:, 0] - f[:, 0]).mean())

    def reach(of_y: NDArray[Any], of_f: NDArray[Any]) -> float:
        squares = of_y**2 + of_f**2 - 2 * correlation * of_y * of_f
        return float(numpy.sqrt(squares.sum()) / len(rates))

    low = value - reach(y[:, 0] - y[:, 1], f[:, 2] - f[:, 0])
    high = value + reach(y[:, 2] - y[:, 0], f[:, 0] - f[:, 1])
    return Gap(value, max(-1.0, low), min(1.0, high), rates[0].simulated.confidence)


def pair_correlation(first: Sequence[bool], second: Sequence[bool]) -> float:
    """Return the correlation of paired results, corrected for continuity as in Newcombe's method 10; 0 if undefined."""
    a, b = (numpy.array(results, dtype=float) for results in (first, second))
    both, neither = float(a @ b), float((1 - a) @ (1 - b))
    first_only, second_only = float(a @ (1 - b)), float((1 - a) @ b)
    margins = a.sum() * (1 - a).sum() * b.sum() * (1 - b).sum()
    if not margins:
        return 0.0
    product = both * neither - first_only * second_only
    corrected = max(product - len(a) / 2, 0.0) if product > 0 else product
    return float(corrected / numpy.sqrt(margins))


@dataclass(frozen=True)
class RankAgreement:
    """How well simulation ranks ``designs`` that have runs and trials.

    ``mmrv`` is the mean maximum rank violation, 0 to 1, best 0 (Li et al. 2024, SIMPLER, 2405.05941). If simulation and
    trials rank two designs differently, the violation is the difference of their driven rates. Each design counts with
    its largest violation. None with fewer than two designs.
    """

    designs: int
    mmrv: float | None = None


def rank_agreement(simulated: ArrayLike, driven: ArrayLike) -> RankAgreement:
    """Compare the ranks of designs by their simulated and their driven rates."""
    f, y = numpy.asarray(simulated, float), numpy.asarray(driven, float)
    if len(f) < 2:
        return RankAgreement(len(f))
    swapped = (f[:, None] < f[None, :]) != (y[:, None] < y[None, :])
    return RankAgreement(len(f), float((numpy.abs(y[:, None] - y[None, :]) * swapped).max(axis=1).mean()))
