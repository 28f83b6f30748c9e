"""A component's parameter: a number with its unit, default, limits and the reason for its lower limit; its value.

A value comes from the component itself or from a parent; two sources that disagree are an error that names both.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from foldcar.car.parts.catalogue import Catalogue
from foldcar.errors import FoldcarError

# Computed values and limits carry errors of rounding.
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

    def default_with(self, parts: Catalogue) -> float:
        """The default with these parts."""
        return float(self.default(parts) if callable(self.default) else self.default)

    def least_with(self, parts: Catalogue) -> float:
        """The minimum with these parts."""
        return float(self.minimum(parts) if callable(self.minimum) else self.minimum)

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


class ComponentError(FoldcarError):
    """A component that cannot be made. ``slot`` is the slot of the parameter at fault, or None."""

    def __init__(self, path: str, message: str, slot: "Slot | None" = None) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.message, self.slot = message, slot


class Slot:
    """The variable that holds one parameter's value; united slots share one value."""

    def __init__(self, parameter: Parameter, path: str, parts: Catalogue) -> None:
        self.parameter, self.path, self.parts = parameter, path, parts
        self._value: float | None = None
        self._source = ""
        self._same: Slot | None = None

    @property
    def head(self) -> "Slot":
        """The slot that holds the common value of all slots united with this one."""
        return self if self._same is None else self._same.head

    def unite(self, other: "Slot") -> None:
        """Let both slots share one value; its default is that of this slot's parameter."""
        if self.head is not other.head:
            other.head._same = self.head

    def assign(self, value: float, origin: str = "") -> None:
        """Set the value; ``origin`` says in messages where it comes from.

        ComponentError if this slot, or one united with it, has another value already.
        """
        head = self.head
        if head._value is not None and abs(head._value - value) > ROUNDING:
            there = f"{head._value:g} at {head._source}"
            raise ComponentError(self.path, f"{value:g} here{origin}, but {there}; they must be equal", self)
        head._value, head._source = value, f"{self.path}{origin}"

    def read(self) -> float:
        """The value, or the default if none was assigned; ComponentError outside the limits of this slot's parameter."""
        head = self.head
        if head._value is None:
            head._value, head._source = head.parameter.default_with(head.parts), f"{head.path} (its default)"
        complaint = self.parameter.complaint(head._value, self.parts)
        if complaint:
            raise ComponentError(self.path, complaint, self)
        return head._value
