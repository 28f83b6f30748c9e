"""How far simulated and driven success rates, and ranks of designs by them, are apart.

A gap is trials minus simulation: below 0 simulation is optimistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy
from numpy.typing import ArrayLike

from foldcar.analysis.rate import Rate

AGREES, OPTIMISTIC, PESSIMISTIC, TOO_FEW = "agrees", "optimistic", "pessimistic", "too few cars or trials"


@dataclass(frozen=True)
class Gap:
    """Trials' rate minus simulation's, -1 to 1, with its interval; ``confidence`` is 0 to 1."""

    value: float
    low: float
    high: float
    confidence: float

    def verdict(self, margin: float) -> str:
        """What the interval says of simulation, if rates that differ by no more than ``margin`` (0 to 1) agree.

        One of AGREES (all of it within the margin), OPTIMISTIC (all of it below 0), PESSIMISTIC (all of it above 0),
        else TOO_FEW.
        """
        if -margin <= self.low and self.high <= margin:
            return AGREES
        if self.high < 0:
            return OPTIMISTIC
        return PESSIMISTIC if self.low > 0 else TOO_FEW


def mean_gap(simulated: Sequence[Rate], driven: Sequence[Rate]) -> Gap:
    """The mean over designs, at least one, of the differences of their rates, all of one confidence.

    By the square-and-add method (Newcombe 1998, Zou and Donner 2008); of one design with Wilson's intervals it is
    Newcombe's hybrid score interval.
    """
    f, y = (numpy.array([(rate.value, rate.low, rate.high) for rate in rates]) for rates in (simulated, driven))
    value = float((y[:, 0] - f[:, 0]).mean())
    below = numpy.sqrt(((y[:, 0] - y[:, 1]) ** 2 + (f[:, 2] - f[:, 0]) ** 2).sum()) / len(f)
    above = numpy.sqrt(((y[:, 2] - y[:, 0]) ** 2 + (f[:, 0] - f[:, 1]) ** 2).sum()) / len(f)
    return Gap(value, max(-1.0, value - float(below)), min(1.0, value + float(above)), simulated[0].confidence)


@dataclass(frozen=True)
class RankAgreement:
    """How well simulation ranks ``designs`` that have runs and trials.

    ``mmrv`` is the mean maximum rank violation, 0 to 1, best 0 (Li et al. 2024, SIMPLER, 2405.05941): two designs that
    simulation ranks otherwise than the trials violate by the difference of their driven rates, and each design counts
    with its largest violation. None with fewer than two.
    """

    designs: int
    mmrv: float | None = None


def rank_agreement(simulated: ArrayLike, driven: ArrayLike) -> RankAgreement:
    """The agreement of designs' ranks by their rates, of runs and of trials."""
    f, y = numpy.asarray(simulated, float), numpy.asarray(driven, float)
    if len(f) < 2:
        return RankAgreement(len(f))
    otherwise = (f[:, None] < f[None, :]) != (y[:, None] < y[None, :])
    return RankAgreement(len(f), float((numpy.abs(y[:, None] - y[None, :]) * otherwise).max(axis=1).mean()))
