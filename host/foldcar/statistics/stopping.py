"""Stopping rules: whether a design has enough runs, for `foldcar sweep --until` and `foldcar optimize`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.rate import anytime_interval

# A design gets no further runs if these would decide it with a lower probability.
MIN_CHANCE = 0.02
NEAR_HORIZON = 10
# Fractions of the greatest possible stake, in bets that a design is not worse.
STAKES = numpy.arange(1, 10)[:, None] / 10
# Rounding error of sums of losses (rates, seconds or joules).
ROUNDING = 1e-9


@dataclass(frozen=True)
class StoppingRule:
    """A design is decided when its anytime-valid interval is narrow enough, or on one side of every threshold.

    ``half_width`` (0 to 1) is half of the widest interval that decides; None if ``thresholds`` (0 to 1, ascending)
    decide. The ``confidence`` is that of a single design.
    """

    half_width: float | None
    thresholds: tuple[float, ...]
    confidence: float = 0.95

    def decided(self, successes: ArrayLike, runs: ArrayLike) -> NDArray[Any]:
        """Return whether each design (designs,) is decided."""
        low, high = anytime_interval(successes, runs, self.confidence)
        if self.half_width is not None:
            return numpy.asarray((high - low) / 2 <= self.half_width)
        sides = [(low > threshold) | (high < threshold) for threshold in self.thresholds]
        return numpy.asarray(numpy.all(sides, axis=0))

    def chance(self, rates: ArrayLike, masses: ArrayLike, passed: int, runs: int, later_runs: int) -> float:
        """Return the probability that the design is decided after ``later_runs`` runs, given the ``runs`` so far.

        Its rate is one of ``rates`` with probabilities ``masses``, both (rates,).
        """
        from scipy.stats import binom

        new = numpy.arange(later_runs - runs + 1)
        decided = _decided(self, later_runs)[passed : passed + len(new)]
        likely = binom.pmf(new[decided], later_runs - runs, numpy.asarray(rates)[:, None]).sum(axis=1)
        return float(numpy.asarray(masses) @ likely)

    def hopeless(self, passed: int, runs: int, most: int) -> bool:
        """Return whether ``most`` runs of a design would decide it with a probability below MIN_CHANCE.

        By its ``runs`` so far and Jeffreys' prior. Never for a ``half_width``: further runs always narrow the interval.
        """
        if self.half_width is not None:
            return False
        # The near horizon is checked first, because the far one needs a long table.
        horizons = (min(most, NEAR_HORIZON * (runs + 1)), most)
        return all(_later_chance(self, passed, runs, later_runs) < MIN_CHANCE for later_runs in horizons)

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "StoppingRule":
        """Make the rule from its fields, as a store keeps them in JSON."""
        return cls(**{**facts, "thresholds": tuple(facts["thresholds"])})

    @property
    def text(self) -> str:
        """The condition for a design to be decided, as a clause: ``its 95 % interval is …``."""
        interval = f"its {100 * self.confidence:g} % interval"
        if self.half_width is not None:
            return f"{interval} is at most {100 * self.half_width:g} percentage points to each side"
        places = " and of ".join(f"{100 * threshold:g} %" for threshold in self.thresholds)
        return f"{interval} lies on one side of {places}"


@lru_cache(maxsize=256)
def _decided(rule: StoppingRule, runs: int) -> NDArray[Any]:
    """Return whether a design is decided with 0, 1, … ``runs`` passed runs (runs + 1,)."""
    return rule.decided(numpy.arange(runs + 1), runs)


@lru_cache(maxsize=4096)
def _later_chance(rule: StoppingRule, passed: int, runs: int, later_runs: int) -> float:
    """Return the probability that the design is decided after ``later_runs`` runs, by Jeffreys' prior."""
    from scipy.stats import betabinom

    new = numpy.arange(later_runs - runs + 1)
    decided = _decided(rule, later_runs)[passed : passed + len(new)]
    return float(betabinom.pmf(new[decided], later_runs - runs, passed + 0.5, runs - passed + 0.5).sum())


def evidence_of_worse(excess: ArrayLike, number: int, most_better: float) -> float:
    """Return the evidence that a design ends worse than another over ``number`` environments, as a betting score.

    ``excess`` (n,) is its loss minus the other's in the environments so far, in random order; at least -``most_better``.
    If the sum over all environments is 0 or less, the score ever reaches 1/risk with a probability of at most ``risk``.
    It is infinite if the remaining environments cannot bring the sum down to 0.

    Let x_i be the excess in environment i of N, and b ``most_better``. If the sum is at most 0, the mean of x_i given
    those before is at most μ_i = -(x_1 + … + x_(i-1)) / (N - i + 1). So Π (1 + c (x_i - μ_i) / (b + μ_i)) is a
    supermartingale for each stake c of 0 to 1, and so is its mean over STAKES (Ville's inequality; Waudby-Smith and
    Ramdas 2020, 2006.04347).
    """
    x = numpy.asarray(excess, dtype=float)
    before = numpy.cumsum(x) - x
    mean = -before / (number - numpy.arange(len(x)))
    room = most_better + mean
    # Without room every remaining excess must be -b, or the sum is above 0.
    if ((room < ROUNDING) & (x - mean > ROUNDING)).any():
        return math.inf
    gains = numpy.divide(x - mean, room, out=numpy.zeros(len(x)), where=room >= ROUNDING)
    return float(numpy.prod(1 + STAKES * gains, axis=1).mean())
