"""Components: their parameters and subcomponents, from the top down.

A component declares its parameters and its subcomponents, whose values it computes from its own; ``build`` then makes
its faces and connects them (shape.py).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from foldcar.car.parts.catalogue import Catalogue, catalogue
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.car.components.shape import Shape

# Computed values and limits carry errors of rounding.
ROUNDING = 1e-9

# A number, or a function that computes it from the parts catalogue.
Number = float | Callable[[Catalogue], float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a component, in millimetres or degrees (``unit``).

    A shared one has one value for the whole car, unless a place sets that of one module; a ``uniform`` one cannot differ
    from module to module. ``sold`` are the only values that there are, if any: what can be bought. A switch has no unit,
    and the value 0 (false) or 1 (true). A design has the value of an ``optional`` one only if it is set.
    """

    name: str
    default: Number
    minimum: Number
    maximum: float
    help: str
    reason: str
    unit: str = "mm"
    shared: bool = False
    sold: Callable[[Catalogue], Sequence[float]] | None = None
    uniform: bool = False
    optional: bool = False

    @property
    def is_switch(self) -> bool:
        """Whether it is either true or false."""
        return not self.unit

    def default_with(self, parts: Catalogue) -> float:
        """The default with these parts."""
        return float(self.default(parts) if callable(self.default) else self.default)

    def least_with(self, parts: Catalogue) -> float:
        """The minimum with these parts."""
        return float(self.minimum(parts) if callable(self.minimum) else self.minimum)

    def complaint(self, value: float, parts: Catalogue) -> str | None:
        """The error message for a value outside the limits with these parts, or None."""
        if self.is_switch:
            return None if value in (0, 1) else f"{value:g} is neither true nor false"
        least = self.least_with(parts)
        if not value >= least - ROUNDING:
            metres = f"; lengths of cars are in mm: {value:g} m is {1000 * value:g}" if 0 < value < 1 else ""
            hint = metres if self.unit == "mm" else ""
            return f"{value:g} is below the minimum {at_least(least)} ({self.reason}){hint}"
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
    """A component that cannot be made. ``key`` is the outermost parameter that sets the value at fault, or None."""

    def __init__(self, path: str, message: str, key: str | None = None) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.message, self.key = message, key


@dataclass(frozen=True)
class Sub:
    """A subcomponent of class ``kind`` with these values; ``body`` names its rigid body, by default the parent's.

    ``keys`` tell which of the parent's parameters a value is, if that has another name.
    """

    name: str
    kind: "type[Component]"
    values: Mapping[str, float] = field(default_factory=dict)
    keys: Mapping[str, str] = field(default_factory=dict)
    body: str | None = None


class Component:
    """The base class of all that is folded, cut or bought: subclasses declare parameters and override ``build``.

    ``parts`` are the chosen parts, those of the whole car. A parent may give values beside parameters.
    """

    parameters: tuple[Parameter, ...] = ()

    def __init__(
        self, values: Mapping[str, float] | None = None, path: str = "", body: str = "", parts: Catalogue | None = None,
        keys: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        """``keys`` are the outermost parameters that set values. ComponentError for a value outside its limits."""
        self.path, self.body, self.parts = path, body, parts or catalogue()
        given = dict(values or {})
        self.keys = {name: name for name in given} if keys is None else keys
        self.values = {parameter.name: parameter.default_with(self.parts) for parameter in self.parameters} | given
        for parameter in self.parameters:
            complaint = parameter.complaint(self[parameter.name], self.parts)
            if complaint:
                raise self.misfit(parameter.name, complaint)
        self.children: dict[str, Component] = {}
        for sub in self.subcomponents():
            if sub.name in self.children:
                raise ComponentError(path, f'two subcomponents are called "{sub.name}"')
            known = {name: self.keys.get(sub.keys.get(name, name)) for name in sub.values}
            outermost = {name: key for name, key in known.items() if key is not None}
            made = sub.kind(sub.values, self._under(sub.name), sub.body or self.body, self.parts, outermost)
            self.children[sub.name] = made

    def subcomponents(self) -> Sequence[Sub]:
        """The subcomponents; none by default."""
        return ()

    def sub(self, name: str, kind: "type[Component]", inherit: str = "", **others: str | float) -> Sub:
        """A subcomponent that inherits parameters under the same name, or under another one, or has values of its own.

        ``self.sub("car", WheelModule, "width height", length="wheel_length", driven=False)``. All others are defaults.
        """
        inherited = dict(zip(inherit.split(), inherit.split(), strict=True))
        inherited |= {parameter: own for parameter, own in others.items() if isinstance(own, str)}
        fixed = {parameter: float(value) for parameter, value in others.items() if not isinstance(value, str)}
        declared = [parameter.name for parameter in kind.parameters]
        for parameter in (*inherited, *fixed):
            if parameter not in declared:
                message = f'{kind.__name__} has no parameter "{parameter}"; it has {", ".join(declared)}'
                raise ComponentError(self._under(name), message)
        return Sub(name, kind, {parameter: self[own] for parameter, own in inherited.items()} | fixed, inherited)

    def build(self, shape: "Shape") -> None:
        """Make the component's faces and connect them; its subcomponents are built."""

    def __getitem__(self, name: str) -> float:
        """A parameter's value in its unit."""
        if name not in self.values:
            raise ComponentError(self.path, f'has no parameter "{name}"; it has {", ".join(self.values) or "none"}')
        return self.values[name]

    def misfit(self, name: str, message: str) -> ComponentError:
        """A ComponentError whose cause is the parameter ``name``."""
        return ComponentError(self._under(name), message, self.keys.get(name))

    def _under(self, name: str) -> str:
        return f"{self.path}.{name}" if self.path else name
