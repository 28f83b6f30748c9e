"""Components: their parameters and subcomponents, solved from the top down.

A component declares its parameters and its subcomponents; ``build`` then makes its faces and connects them (shape.py). A
parameter of a subcomponent is the parent's parameter of the same name (``inherit``), a parameter of the parent named
``prefix.name`` (``prefix``), or set to a number or an expression of the parent's parameters (``settings``). Two sources
of a value that disagree are an error that names both.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

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


Expression = Callable[["Component"], float]


@dataclass(frozen=True)
class Sub:
    """A subcomponent of class ``kind``; ``body`` names its rigid body, by default the parent's.

    The one with ``root`` is built first, so that its first face is the parent's first face.
    """

    name: str
    kind: "type[Component]"
    inherit: tuple[str, ...] = ()
    prefix: str | None = None
    root: bool = False
    settings: Mapping[str, float | Expression] = field(default_factory=dict)
    body: str | None = None


class Component:
    """The base class of all that is folded, cut or bought: subclasses declare parameters and override ``build``.

    ``parts`` are the chosen parts, those of the whole car.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def __init__(self, path: str = "", body: str = "", parts: Catalogue | None = None) -> None:
        self.path, self.body, self.parts = path, body, parts or catalogue()
        self.slots = {one.name: Slot(one, self._under(one.name), self.parts) for one in self.parameters}
        self._subs = sorted(self.subcomponents(), key=lambda sub: not sub.root)
        self.children: dict[str, Component] = {}
        for sub in self._subs:
            if sub.name in self.children:
                raise ComponentError(path, f'two subcomponents are called "{sub.name}"')
            self.children[sub.name] = sub.kind(self._under(sub.name), sub.body or body, self.parts)
            self._bind(sub, self.children[sub.name])

    def subcomponents(self) -> Sequence[Sub]:
        """The subcomponents; none by default."""
        return ()

    def build(self, shape: "Shape") -> None:
        """Make the component's faces and connect them; its parameters are final and its subcomponents built."""

    def __getitem__(self, name: str) -> float:
        """A parameter's value in its unit; ComponentError outside its limits."""
        return self.slot(name).read()

    def slot(self, path: str) -> Slot:
        """The slot of a parameter by its path below this component (``length``, ``beam.length``); else ComponentError."""
        if path in self.slots:
            return self.slots[path]
        child, dot, rest = path.partition(".")
        if dot and child in self.children:
            return self.children[child].slot(rest)
        raise ComponentError(self.path, f'has no parameter "{path}"; it has {", ".join(self.slots) or "none"}')

    def solve(self, values: Mapping[str, float]) -> None:
        """Assign the values, then derive every other parameter; ComponentError if two values disagree."""
        for name, value in values.items():
            self.slot(name).assign(value)
        self._settle()

    def misfit(self, name: str, message: str) -> ComponentError:
        """A ComponentError whose cause is the parameter ``name``."""
        return ComponentError(self._under(name), message, self.slot(name))

    def _settle(self) -> None:
        for name in self.slots:
            self.slots[name].read()
        for sub in self._subs:
            child = self.children[sub.name]
            for name, setting in sub.settings.items():
                value = setting(self) if callable(setting) else setting
                child.slot(name).assign(float(value), f" (set by {self.path or type(self).__name__})")
            child._settle()

    def _bind(self, sub: Sub, child: "Component") -> None:
        for name in (*sub.inherit, *sub.settings):
            child.slot(name)
        for name, slot in child.slots.items():
            if name in sub.settings or not (name in sub.inherit or sub.prefix is not None):
                continue
            mine = name if name in sub.inherit else f"{sub.prefix}.{name}"
            if mine in self.slots:
                self.slots[mine].unite(slot)
            else:
                self.slots[mine] = slot

    def _under(self, name: str) -> str:
        return f"{self.path}.{name}" if self.path else name
