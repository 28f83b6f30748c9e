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

    A shared parameter has one value for the whole car, unless a place overrides it for one module; a ``uniform`` one
    cannot differ between modules. ``sold`` are the values that can be bought; without it every value within the limits
    is allowed. A switch has no unit and the value 0 (false) or 1 (true). A design has an ``optional`` one only if set.
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
        """Whether its value is either true or false."""
        return not self.unit

    def default_with(self, parts: Catalogue) -> float:
        """Return the default with these parts."""
        return float(self.default(parts) if callable(self.default) else self.default)

    def minimum_with(self, parts: Catalogue) -> float:
        """Return the minimum with these parts."""
        return float(self.minimum(parts) if callable(self.minimum) else self.minimum)

    def limit_error(self, value: float, parts: Catalogue) -> str | None:
        """Return the message for a value that is not allowed with these parts, or None if the value is allowed."""
        if self.is_switch:
            return None if value in (0, 1) else f"{value:g} is neither true nor false"
        minimum = self.minimum_with(parts)
        # NaN fulfils no comparison, so it is refused here.
        if not value >= minimum - ROUNDING:
            metres = f"; lengths of cars are in mm: {value:g} m is {1000 * value:g}" if 0 < value < 1 else ""
            hint = metres if self.unit == "mm" else ""
            return f"{value:g} is below the minimum {minimum_text(minimum)} ({self.reason}){hint}"
        if not value <= self.maximum + ROUNDING:
            return f"{value:g} is above the maximum {maximum_text(self.maximum)}"
        sold = self.sold(parts) if self.sold else [value]
        nearest = min(sold, key=lambda size: abs(size - value))
        if abs(nearest - value) > ROUNDING:
            sizes = ", ".join(f"{size:g}" for size in sold)
            return f"{value:g} is not sold; the nearest size is {nearest:g} (sizes: {sizes})"
        return None


def minimum_text(limit: float) -> str:
    """Format a lower limit, rounded up so that the value shown is itself allowed."""
    return f"{math.ceil(limit * 1000 - 1e-6) / 1000:.10g}"


def maximum_text(limit: float) -> str:
    """Format an upper limit, rounded down so that the value shown is itself allowed."""
    return f"{math.floor(limit * 1000 + 1e-6) / 1000:.10g}"


class ComponentError(FoldcarError):
    """A component that cannot be made. ``key`` is the parameter of the design that sets the wrong value, or None."""

    def __init__(self, path: str, message: str, key: str | None = None) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.message, self.key = message, key


@dataclass(frozen=True)
class Sub:
    """A subcomponent of class ``kind`` with these values. ``body`` names its rigid body, by default that of the parent.

    A parent's parameter may set a value under another name. ``keys`` then has the name of the parent's parameter by
    the name of the value.
    """

    name: str
    kind: "type[Component]"
    values: Mapping[str, float] = field(default_factory=dict)
    keys: Mapping[str, str] = field(default_factory=dict)
    body: str | None = None


class Component:
    """The base class of all that is folded, cut or bought. Subclasses declare parameters and override ``build``.

    ``parts`` are the parts that the whole car uses. A parent may also give values that are no parameters.
    """

    parameters: tuple[Parameter, ...] = ()

    def __init__(
        self, values: Mapping[str, float] | None = None, path: str = "", body: str = "", parts: Catalogue | None = None,
        keys: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        """Set and check the values of the parameters, and make the subcomponents.

        ``path`` is the path of the component in the car, and ``body`` the rigid body to which it belongs. ``keys`` maps
        the name of a value to the key in the design file that sets it, for use in messages: ``radius`` may be set by
        ``W2.radius``. Without ``keys``, each name is its own key. Raises ComponentError for a value outside its limits.
        """
        self.path = path
        self.body = body
        self.parts = parts or catalogue()
        given_values = dict(values or {})
        self.keys = {name: name for name in given_values} if keys is None else keys
        defaults = {parameter.name: parameter.default_with(self.parts) for parameter in self.parameters}
        self.values = defaults | given_values
        for parameter in self.parameters:
            limit_error = parameter.limit_error(self[parameter.name], self.parts)
            if limit_error:
                raise self.parameter_error(parameter.name, limit_error)
        self.children: dict[str, Component] = {}
        for sub in self.subcomponents():
            if sub.name in self.children:
                raise ComponentError(path, f'two subcomponents are called "{sub.name}"')
            child_path, child_body = self._under(sub.name), sub.body or self.body
            self.children[sub.name] = sub.kind(sub.values, child_path, child_body, self.parts, self._keys_of(sub))

    def _keys_of(self, sub: Sub) -> dict[str, str]:
        """Return the key of the design that sets each value of a subcomponent, by the name of the value.

        A value that comes from a parameter of this component is set by the same key as that parameter. A value that this
        component computes is set by no key, so it is left out.
        """
        keys: dict[str, str] = {}
        for value_name in sub.values:
            parameter_name = sub.keys.get(value_name, value_name)
            if parameter_name in self.keys:
                keys[value_name] = self.keys[parameter_name]
        return keys

    def subcomponents(self) -> Sequence[Sub]:
        """Return the subcomponents; none by default."""
        return ()

    def sub(self, name: str, kind: "type[Component]", inherit: str = "", **settings: str | float) -> Sub:
        """Return a subcomponent whose parameters are inherited, set, or left at their defaults.

        ``inherit`` names the parameters whose values come from the parameters of this component with the same names,
        separated by blanks. In ``settings``, a string is the name of the parameter of this component whose value is
        taken; a number or a boolean is the value itself. Raises ComponentError for a parameter that the subcomponent
        does not have.

        Example: ``self.sub("car", WheelModule, "width height", length="wheel_length", driven=False)``
        """
        # The parameter of this component that sets a parameter of the subcomponent, by the name of the latter.
        own_parameters = {parameter: parameter for parameter in inherit.split()}
        values: dict[str, float] = {}
        for parameter, setting in settings.items():
            if isinstance(setting, str):
                own_parameters[parameter] = setting
            else:
                values[parameter] = float(setting)
        declared = [parameter.name for parameter in kind.parameters]
        for parameter in (*own_parameters, *values):
            if parameter not in declared:
                message = f'{kind.__name__} has no parameter "{parameter}"; it has {", ".join(declared)}'
                raise ComponentError(self._under(name), message)
        inherited_values = {parameter: self[own_parameter] for parameter, own_parameter in own_parameters.items()}
        return Sub(name, kind, values=inherited_values | values, keys=own_parameters)

    def build(self, shape: "Shape") -> None:
        """Make the component's faces and connect them; its subcomponents are built before."""

    def __getitem__(self, name: str) -> float:
        """Return a parameter's value in its unit."""
        if name not in self.values:
            raise ComponentError(self.path, f'has no parameter "{name}"; it has {", ".join(self.values) or "none"}')
        return self.values[name]

    def parameter_error(self, name: str, message: str) -> ComponentError:
        """Return a ComponentError whose cause is the parameter ``name``."""
        return ComponentError(self._under(name), message, self.keys.get(name))

    def _under(self, name: str) -> str:
        return f"{self.path}.{name}" if self.path else name
