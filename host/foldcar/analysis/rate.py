"""A success rate as an analysis states it: its estimate, its interval, and how both were found."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rate:
    """An estimated success probability; ``value``, ``low``, ``high`` and ``confidence`` are 0 to 1.

    ``method`` says in a reader's words what the interval rests on.
    """

    value: float
    low: float
    high: float
    confidence: float
    method: str

    @property
    def half_width(self) -> float:
        """Half of the interval's width, 0 to 0.5."""
        return (self.high - self.low) / 2
