"""How far simulated and driven success rates, and ranks of designs by them, are apart.

A gap is trials minus simulation: below 0 simulation is optimistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.analysis.rate import Rate

AGREES, OPTIMISTIC, PESSIMISTIC, TOO_FEW = "agrees", "optimistic", "pessimistic", "too few cars or trials"
# Draws of the rates' posterior; the ends of an interval vary by about 0.01 with the draw.
DRAWS = 4000


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
    """How designs rank in simulation and in trials, over ``designs`` that have both.

    ``pearson`` and ``spearman`` are correlations of the rates, -1 to 1, each with the interval of what the true rates
    may have; None where it is undefined: fewer than three designs, or all rates equal. ``mmrv`` is the mean maximum rank
    violation, 0 to 1, best 0 (Li et al. 2024, SIMPLER, 2405.05941): two designs that simulation ranks otherwise than the
    trials violate by the difference of their driven rates, and each design counts with its largest violation. None with
    fewer than two designs.
    """

    designs: int
    pearson: float | None = None
    pearson_interval: tuple[float, float] | None = None
    spearman: float | None = None
    spearman_interval: tuple[float, float] | None = None
    mmrv: float | None = None


def rank_agreement(
    simulated: Sequence[tuple[int, int]], driven: Sequence[tuple[int, int]], drawn: NDArray[Any] | None = None
) -> RankAgreement:
    """The agreement of designs' ranks from how many passed of how many, (passed, all) of runs and of trials.

    Intervals hold the correlation of the true rates with probability 0.95, given Jeffreys' priors. ``drawn`` (DRAWS,
    designs) are draws of the rates behind the trials; without them all trials of a design are independent.
    """
    from scipy.stats import rankdata

    counts = [numpy.array(one, dtype=float) for one in (simulated, driven)]
    if len(simulated) < 2:
        return RankAgreement(len(simulated))
    f, y = rates = [one[:, 0] / one[:, 1] for one in counts]
    otherwise = (f[:, None] < f[None, :]) != (y[:, None] < y[None, :])
    mmrv = float((numpy.abs(y[:, None] - y[None, :]) * otherwise).max(axis=1).mean())
    if len(f) < 3 or numpy.ptp(f) == 0 or numpy.ptp(y) == 0:
        return RankAgreement(len(f), mmrv=mmrv)
    random = numpy.random.default_rng(0)
    drawn_each = [random.beta(n[:, 0] + 0.5, n[:, 1] - n[:, 0] + 0.5, (DRAWS, len(n))) for n in counts]
    if drawn is not None:
        drawn_each[1] = drawn
    # The first row is of the rates themselves.
    values = [numpy.vstack([rate, draws]) for rate, draws in zip(rates, drawn_each, strict=True)]
    found: list[Any] = []
    for first, second in (values, [rankdata(one, axis=1) for one in values]):
        a, b = (one - one.mean(axis=1, keepdims=True) for one in (first, second))
        each = (a * b).sum(axis=1) / numpy.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
        low, high = numpy.quantile(each[1:], [0.025, 0.975])
        found += [float(each[0]), (float(low), float(high))]
    return RankAgreement(len(f), found[0], found[1], found[2], found[3], mmrv)
