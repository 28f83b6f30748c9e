"""How far simulated and driven success rates are apart, and how well simulation ranks designs.

Input: rates with intervals, or counts. The gap is trials minus simulation: below 0 simulation is optimistic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence
from foldcar.analysis.rate import Rate

AGREES, OPTIMISTIC, PESSIMISTIC, TOO_FEW = "agrees", "optimistic", "pessimistic", "too few trials"
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


@dataclass(frozen=True)
class RankAgreement:
    """How designs rank in simulation and in trials, over ``designs`` that have both.

    ``pearson`` and ``spearman`` are correlations of the rates, -1 to 1, each with the interval of what the true rates
    may have; None where it is undefined: fewer than three designs, or all rates equal. ``mmrv`` is the mean
    maximum rank violation, 0 to 1, best 0; None with fewer than two designs.
    """

    designs: int
    pearson: float | None
    pearson_interval: tuple[float, float] | None
    spearman: float | None
    spearman_interval: tuple[float, float] | None
    mmrv: float | None


def gap(simulated: Rate, driven: Rate) -> Gap:
    """The difference of two rates of one confidence, by the square-and-add method (Newcombe 1998, Zou and Donner 2008).

    With Wilson's intervals it is Newcombe's hybrid score interval. Rates that rise and fall together, as a rate that
    was rectified by the other, make it too wide rather than too narrow.
    """
    return mean_gap([simulated], [driven])


def mean_gap(simulated: Sequence[Rate], driven: Sequence[Rate]) -> Gap:
    """The mean over designs of the gaps of their rates, at least one each; square-and-add as in :func:`gap`."""
    f, y = _ends(simulated), _ends(driven)
    value = float((y[:, 0] - f[:, 0]).mean())
    below = numpy.sqrt(((y[:, 0] - y[:, 1]) ** 2 + (f[:, 2] - f[:, 0]) ** 2).sum()) / len(f)
    above = numpy.sqrt(((y[:, 2] - y[:, 0]) ** 2 + (f[:, 0] - f[:, 1]) ** 2).sum()) / len(f)
    return Gap(value, max(-1.0, value - float(below)), min(1.0, value + float(above)), simulated[0].confidence)


def mean_maximum_rank_violation(simulated: ArrayLike, driven: ArrayLike) -> float:
    """The mean maximum rank violation of rates (designs,), at least two (Li et al. 2024, SIMPLER, 2405.05941).

    Two designs that simulation ranks otherwise than the trials violate by the difference of their driven rates; each
    design counts with its largest violation. 0: no pair is ranked otherwise.
    """
    f, y = numpy.asarray(simulated, dtype=float), numpy.asarray(driven, dtype=float)
    otherwise = (f[:, None] < f[None, :]) != (y[:, None] < y[None, :])
    violations = numpy.abs(y[:, None] - y[None, :]) * otherwise
    return float(violations.max(axis=1).mean())


def rank_agreement(
    simulated: Sequence[tuple[int, int]], driven: Sequence[tuple[int, int]], confidence: float = 0.95
) -> RankAgreement:
    """The agreement of designs' ranks from how many passed of how many, (passed, all) of runs and of trials.

    Intervals hold the correlation of the true rates with probability ``confidence``, given Jeffreys' priors.
    """
    check_confidence(confidence)
    runs, trials = numpy.array(simulated, dtype=float), numpy.array(driven, dtype=float)
    if len(runs) < 2:
        return RankAgreement(len(runs), None, None, None, None, None)
    f, y = runs[:, 0] / runs[:, 1], trials[:, 0] / trials[:, 1]
    mmrv = mean_maximum_rank_violation(f, y)
    if len(runs) < 3 or numpy.ptp(f) == 0 or numpy.ptp(y) == 0:
        return RankAgreement(len(runs), None, None, None, None, mmrv)
    random = numpy.random.default_rng(0)
    drawn = [random.beta(n[:, 0] + 0.5, n[:, 1] - n[:, 0] + 0.5, (DRAWS, len(n))) for n in (runs, trials)]
    tails = [(1 - confidence) / 2, (1 + confidence) / 2]
    ends = []
    for rank in (False, True):
        low, high = numpy.quantile(_correlations(*((_ranks(d) for d in drawn) if rank else drawn)), tails)
        ends.append((float(low), float(high)))
    pearson = float(_correlations(f[None], y[None])[0])
    spearman = float(_correlations(_ranks(f[None]), _ranks(y[None]))[0])
    return RankAgreement(len(runs), pearson, ends[0], spearman, ends[1], mmrv)


def _ranks(values: NDArray[Any]) -> NDArray[Any]:
    """The ranks of the values in each row, equal ones with their mean rank."""
    from scipy.stats import rankdata

    return numpy.asarray(rankdata(values, axis=1))


def _correlations(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Pearson's correlation of each row of one table with the same row of the other."""
    a, b = (values - values.mean(axis=1, keepdims=True) for values in (first, second))
    found: NDArray[Any] = (a * b).sum(axis=1) / numpy.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))
    return found


def _ends(rates: Sequence[Rate]) -> NDArray[Any]:
    return numpy.array([(rate.value, rate.low, rate.high) for rate in rates])
