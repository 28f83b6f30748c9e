"""Differences between simulated and driven success rates, and between the ranks of designs by them.

A gap is the built cars' rate minus simulation's: if it is negative, simulation is optimistic.
"""

from dataclasses import dataclass

import numpy
from numpy.typing import ArrayLike

AGREES, OPTIMISTIC, PESSIMISTIC, TOO_FEW = "agrees", "optimistic", "pessimistic", "too few cars or trials"


@dataclass(frozen=True)
class Gap:
    """Built cars' rate minus simulation's, -1 to 1, with its interval; ``confidence`` is 0 to 1."""

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
        if self.low > 0:
            return PESSIMISTIC
        return TOO_FEW


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
    """Return how well the order of designs in simulation agrees with their order in trials.

    ``simulated`` and ``driven`` (designs,) are their success rates in simulation and in trials. If simulation and trials
    order a pair of designs differently, the pair is violated by the difference of the two rates in trials. The result has
    the mean over the designs of each design's largest violation, or None if there are fewer than 2 designs.
    """
    simulated, driven = numpy.asarray(simulated, float), numpy.asarray(driven, float)
    if len(simulated) < 2:
        return RankAgreement(len(simulated))
    # All pairs of designs (designs, designs).
    lower_in_simulation = simulated[:, None] < simulated[None, :]
    lower_in_trials = driven[:, None] < driven[None, :]
    rate_differences = numpy.abs(driven[:, None] - driven[None, :])
    violations = rate_differences * (lower_in_simulation != lower_in_trials)
    # The worst pair of each design counts.
    worst_of_design = violations.max(axis=1)
    return RankAgreement(len(simulated), float(worst_of_design.mean()))
