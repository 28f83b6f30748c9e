"""When enough is known of a design's success rate: what `foldcar sweep --until` goes by."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.rate import anytime_interval

# A design is left undecided when the runs that it may still get would decide it with a lower chance.
LEAST_CHANCE = 0.02
NEAR_HORIZON = 10


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
        """Whether ``most`` runs of a design would decide it with a chance below LEAST_CHANCE, by its ``runs`` alone.

        Jeffreys' prior. Only of thresholds: an interval that does not reach a width becomes narrower all the same.
        """
        if self.half_width is not None:
            return False
        # The near horizon spares the far one, whose table is long.
        horizons = (min(most, NEAR_HORIZON * (runs + 1)), most)
        return all(_later_chance(self, passed, runs, then) < LEAST_CHANCE for then in horizons)

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
