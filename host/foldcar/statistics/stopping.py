"""Stopping rules: when the runs of a design suffice, for `foldcar sweep --until` and `foldcar optimize`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.rate import anytime_interval

# A design is left undecided when the runs that it may still get would decide it with a lower chance.
MIN_CHANCE = 0.02
NEAR_HORIZON = 10
# Parts of the greatest stake that are betted against a design.
STAKES = numpy.arange(1, 10)[:, None] / 10
# Of sums of losses (shares, seconds or joules).
ROUNDING = 1e-9


@dataclass(frozen=True)
class StoppingRule:
    """A design is decided when its anytime-valid interval is narrow enough, or on one side of every threshold.

    Shares are 0 to 1: ``half_width`` is the greatest half of an interval's width, None where ``thresholds``, in ascending
    order, decide. The ``confidence`` is that of each design by itself.
    """

    half_width: float | None
    thresholds: tuple[float, ...]
    confidence: float = 0.95

    def decided(self, successes: ArrayLike, runs: ArrayLike) -> NDArray[Any]:
        """Whether each of the designs (designs,) is decided."""
        low, high = anytime_interval(successes, runs, self.confidence)
        if self.half_width is not None:
            return numpy.asarray((high - low) / 2 <= self.half_width)
        sides = [(low > threshold) | (high < threshold) for threshold in self.thresholds]
        return numpy.asarray(numpy.all(sides, axis=0))

    def chance(self, rates: ArrayLike, masses: ArrayLike, passed: int, runs: int, then: int) -> float:
        """The chance that the design is decided after ``then`` runs, of which ``runs`` are made.

        Its rate is one of ``rates`` with ``masses``, both (rates,).
        """
        from scipy.stats import binom

        new = numpy.arange(then - runs + 1)
        decided = _decided(self, then)[passed : passed + len(new)]
        likely = binom.pmf(new[decided], then - runs, numpy.asarray(rates)[:, None]).sum(axis=1)
        return float(numpy.asarray(masses) @ likely)

    def hopeless(self, passed: int, runs: int, most: int) -> bool:
        """Whether ``most`` runs of a design would decide it with a chance below MIN_CHANCE, by its ``runs`` alone.

        Jeffreys' prior. Only of thresholds: an interval that does not reach a width becomes narrower all the same.
        """
        if self.half_width is not None:
            return False
        # The near horizon spares the far one, whose table is long.
        horizons = (min(most, NEAR_HORIZON * (runs + 1)), most)
        return all(_later_chance(self, passed, runs, then) < MIN_CHANCE for then in horizons)

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "StoppingRule":
        """The rule as a store keeps it in JSON: an object of its fields."""
        return cls(**{**facts, "thresholds": tuple(facts["thresholds"])})

    @property
    def text(self) -> str:
        """What makes a design decided, as a clause: ``its 95 % interval is …``."""
        interval = f"its {100 * self.confidence:g} % interval"
        if self.half_width is not None:
            return f"{interval} is at most {100 * self.half_width:g} percentage points to each side"
        places = " and of ".join(f"{100 * threshold:g} %" for threshold in self.thresholds)
        return f"{interval} lies on one side of {places}"


@lru_cache(maxsize=256)
def _decided(rule: StoppingRule, runs: int) -> NDArray[Any]:
    """Whether 0 to ``runs`` passed runs decide a design."""
    return rule.decided(numpy.arange(runs + 1), runs)


@lru_cache(maxsize=4096)
def _later_chance(rule: StoppingRule, passed: int, runs: int, then: int) -> float:
    """The chance that the design is decided after ``then`` runs, by Jeffreys' prior."""
    from scipy.stats import betabinom

    new = numpy.arange(then - runs + 1)
    decided = _decided(rule, then)[passed : passed + len(new)]
    return float(betabinom.pmf(new[decided], then - runs, passed + 0.5, runs - passed + 0.5).sum())


def evidence_of_worse(excess: ArrayLike, number: int, most_better: float) -> float:
    """How strongly a design's first runs say that it ends worse than another over ``number`` environments.

    ``excess`` (n,): its loss less the other's in the environments so far, which are in random order; none is below
    -``most_better``. If the sum over all environments were 0 or less, this number would reach 1/risk at any time with a
    probability of at most ``risk``. In the symbols below, x_i being the excess in environment i of N and b
    ``most_better``, the mean of x_i given those before would then be at most μ_i = -(x_1 + … + x_(i-1)) / (N - i + 1). So
    Π (1 + c (x_i - μ_i) / (b + μ_i)) is a supermartingale for each stake c of 0 to 1, and so is its mean over STAKES
    (Ville's inequality; Waudby-Smith and Ramdas 2020, 2006.04347). Infinite where what is left cannot make up for it.
    """
    x = numpy.asarray(excess, dtype=float)
    before = numpy.cumsum(x) - x
    mean = -before / (number - numpy.arange(len(x)))
    room = most_better + mean
    # Without room every environment left must be -b, or the sum is above 0.
    if ((room < ROUNDING) & (x - mean > ROUNDING)).any():
        return math.inf
    gains = numpy.divide(x - mean, room, out=numpy.zeros(len(x)), where=room >= ROUNDING)
    return float(numpy.prod(1 + STAKES * gains, axis=1).mean())
