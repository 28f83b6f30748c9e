"""A component's parameter: a number with its unit, default, limits and the reason for its lower limit."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from foldcar.car.parts.catalogue import Catalogue, catalogue

# Computed limits carry errors of rounding.
ROUNDING = 1e-9

# A number, or a function that computes it from the parts catalogue.
Number = float | Callable[[Catalogue], float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a component, in millimetres or degrees (``unit``).

    A shared one has one value for the whole car. An internal one is set by the parent component, never by a design.
    ``sold`` are the only values that there are, if any: what can be bought.
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
    sold: Callable[[Catalogue], Sequence[float]] | None = None

    @property
    def default_value(self) -> float:
        """The default, with the default parts if it depends on them."""
        return _number(self.default, catalogue())

    @property
    def least(self) -> float:
        """The minimum, with the default parts if it depends on them."""
        return _number(self.minimum, catalogue())

    def default_with(self, parts: Catalogue) -> float:
        """The default with these parts."""
        return _number(self.default, parts)

    def least_with(self, parts: Catalogue) -> float:
        """The minimum with these parts."""
        return _number(self.minimum, parts)

    def complaint(self, value: float, parts: Catalogue) -> str | None:
        """The error message for a value outside the limits with these parts, or None."""
        least = self.least_with(parts)
        if not value >= least - ROUNDING:
            return f"{value:g} is below the minimum {at_least(least)} ({self.reason})"
        if not value <= self.maximum + ROUNDING:
            return f"{value:g} is above the maximum {at_most(self.maximum)}"
        sold = self.sold(parts) if self.sold else [value]
        nearest = min(sold, key=lambda one: abs(one - value))
        if abs(nearest - value) > ROUNDING:
            side = "above" if value > nearest else "below"
            known = ", ".join(f"{one:g}" for one in sold)
            return f"{value:g} is {side} the {nearest:g} of the nearest that is sold ({known})"
        return None


def at_least(limit: float) -> str:
    """A lower limit as text, rounded so that a value like it is not below."""
    return f"{math.ceil(limit * 1000 - 1e-6) / 1000:.10g}"


def at_most(limit: float) -> str:
    """An upper limit as text, rounded so that a value like it is not above."""
    return f"{math.floor(limit * 1000 + 1e-6) / 1000:.10g}"


def _number(number: Number, parts: Catalogue) -> float:
    return float(number(parts)) if callable(number) else float(number)
