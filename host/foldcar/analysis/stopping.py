"""When enough is known of a design's success rate: what `foldcar sweep --until` goes by, and what the report reads."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.anytime import anytime_interval


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
