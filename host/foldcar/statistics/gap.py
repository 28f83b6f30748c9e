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
        """Return AGREES if the interval is within ± ``margin`` (0 to 1), OPTIMISTIC if below 0, PESSIMISTIC if above 0.

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
    # Each (designs, 3): rate, low, high.
    simulated = numpy.array([(pair.simulated.value, pair.simulated.low, pair.simulated.high) for pair in rates])
    driven = numpy.array([(pair.driven.value, pair.driven.low, pair.driven.high) for pair in rates])
    correlation = numpy.array([pair.correlation for pair in rates])
    value = float((driven[:, 0] - simulated[:, 0]).mean())

    def margin(of_driven: NDArray[Any], of_simulated: NDArray[Any]) -> float:
        """Combine the distances (designs,) of both rates from the ends of their intervals, by squares."""
        squares = of_driven**2 + of_simulated**2 - 2 * correlation * of_driven * of_simulated
        return float(numpy.sqrt(squares.sum()) / len(rates))

    low = value - margin(driven[:, 0] - driven[:, 1], simulated[:, 2] - simulated[:, 0])
    high = value + margin(driven[:, 2] - driven[:, 0], simulated[:, 0] - simulated[:, 1])
    return Gap(value, max(-1.0, low), min(1.0, high), rates[0].simulated.confidence)


def pair_correlation(first: Sequence[bool], second: Sequence[bool]) -> float:
    """Return the phi coefficient of paired results (pairs,), corrected for continuity as in Newcombe's method 10.

    Returns 0 if the results of ``first``, or those of ``second``, are all equal.
    """
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
    """Compare the ranks of designs by their ``simulated`` and ``driven`` rates (designs,), as in RankAgreement."""
    simulated, driven = numpy.asarray(simulated, float), numpy.asarray(driven, float)
    if len(simulated) < 2:
        return RankAgreement(len(simulated))
    swapped = (simulated[:, None] < simulated[None, :]) != (driven[:, None] < driven[None, :])
    # (designs, designs): by how much the driven rates of a pair in swapped order differ. Each design's worst pair counts.
    violations = numpy.abs(driven[:, None] - driven[None, :]) * swapped
    return RankAgreement(len(simulated), float(violations.max(axis=1).mean()))
