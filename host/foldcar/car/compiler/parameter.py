"""What a component can be told: a number with its unit, default, limits and the reason for the lower one."""

from collections.abc import Callable
from dataclasses import dataclass

from foldcar.car.parts.catalogue import Catalogue, catalogue

# A limit or default that follows from the parts' data.
Number = float | Callable[[Catalogue], float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a component, in millimetres or degrees.

    A shared one has one value for the whole car. An internal one is set by the parent, never by people.
    """

    name: str
    default: Number
    minimum: Number
    maximum: float
    help: str
    reason: str
    unit: str = "mm"
    shared: bool = False
    internal: bool = False

    @property
    def default_value(self) -> float:
        """The default, from the parts' data if it depends on them."""
        return _number(self.default)

    @property
    def least(self) -> float:
        """The minimum, from the parts' data if it depends on them."""
        return _number(self.minimum)

    def complaint(self, value: float) -> str | None:
        """What is wrong with the value, or None."""
        if not value >= self.least:
            return f"{value:g} is below the minimum {self.least:g} ({self.reason})"
        if not value <= self.maximum:
            return f"{value:g} is above the maximum {self.maximum:g}"
        return None


def _number(number: Number) -> float:
    return float(number(catalogue())) if callable(number) else float(number)
