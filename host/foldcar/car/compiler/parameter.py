"""A component's parameter: a number with its unit, default, limits and the reason for its lower limit."""

from collections.abc import Callable
from dataclasses import dataclass

from foldcar.car.parts.catalogue import Catalogue, catalogue

# A number, or a function that computes it from the parts catalogue.
Number = float | Callable[[Catalogue], float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a component, in millimetres or degrees (``unit``).

    A shared one has one value for the whole car. An internal one is set by the parent component, never by a design.
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
        """The default, computed from the parts catalogue if it depends on it."""
        return _number(self.default)

    @property
    def least(self) -> float:
        """The minimum, computed from the parts catalogue if it depends on it."""
        return _number(self.minimum)

    def complaint(self, value: float) -> str | None:
        """The error message for a value outside the limits, or None."""
        if not value >= self.least:
            return f"{value:g} is below the minimum {self.least:g} ({self.reason})"
        if not value <= self.maximum:
            return f"{value:g} is above the maximum {self.maximum:g}"
        return None


def _number(number: Number) -> float:
    return float(number(catalogue())) if callable(number) else float(number)
