"""Components: their parameters and subcomponents, solved from the top down.

A component declares its parameters and its subcomponents; ``build`` then makes its faces and connects them (shape.py). A
parameter of a subcomponent is the parent's parameter of the same name (``inherit``), a parameter of the parent named
``prefix.name`` (``prefix``), or set to a number or an expression of the parent's parameters (``settings``).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from foldcar.car.components.parameter import ComponentError, Parameter, Slot
from foldcar.car.components.shape import Graph, Shape
from foldcar.car.parts.catalogue import Catalogue, catalogue

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

    def build(self, shape: Shape) -> None:
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


def build(component: Component, graph: Graph | None = None) -> Graph:
    """The graph of faces and links that a solved component and all its subcomponents build."""
    graph = graph if graph is not None else Graph()
    for child in component.children.values():
        build(child, graph)
    component.build(Shape(component.path, component.body, graph, component.parts))
    return graph
