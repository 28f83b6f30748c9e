"""Composites: connected modules that a type string names like one module; a part of a car, or a whole car.

A subclass declares its parameters, its subcomponents (modules, hinges, other composites) with the values that they
inherit, and which ends meet. In a car it stands for the type string of its modules, front to back. docs/compiler.md
has an example.
"""

from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple

from foldcar.car.components.component import Component, ComponentError
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import BrainModule, Module

ENDS = ("front", "rear")


class CompositePart(NamedTuple):
    """A module of a composite. ``root`` is whether the composite names it as the one that carries the electronics."""

    module: Module | HingeModule
    root: bool


class Composite(Component):
    """Connected modules. ``connections`` are the pairs of ends that meet, such as ``("car.rear", "brain.front")``.

    ``root`` is the name of the subcomponent with the module B that carries the electronics. By default it is the
    first B of the car.
    """

    letter: ClassVar[str]
    title: ClassVar[str]
    connections: ClassVar[Sequence[tuple[str, str]]] = ()
    root: ClassVar[str] = ""

    def modules(self) -> Iterator[CompositePart]:
        """Yield the modules from front to back, also those of nested composites.

        The *root* is the module that carries the electronics. Raises ComponentError if they form no chain.
        """
        for name in self._order():
            child = self.children[name]
            is_root = name == self.root
            if isinstance(child, Composite):
                # If a nested composite is the root, the root module is the one inside it.
                for part in child.modules():
                    yield CompositePart(part.module, root=is_root and part.root)
            elif isinstance(child, Module | HingeModule):
                yield CompositePart(child, root=is_root)
            else:
                raise ComponentError(child.path, f"is a {type(child).__name__}, not a module, a hinge or a composite")

    def check(self) -> None:
        """Raise ComponentError if its modules do not form a chain, or its root cannot carry the electronics."""
        roots = [part.module for part in self.modules() if part.root]
        if self.root and (len(roots) != 1 or not isinstance(roots[0], BrainModule)):
            raise ComponentError(self.path, f'root "{self.root}" is not one module B, nor a composite whose root is one')

    def _order(self) -> list[str]:
        """Return the names of the subcomponents from front to back.

        A connection joins the rear end of one subcomponent to the front end of the next one. Raises ComponentError if
        the connections do not make one chain of all subcomponents.
        """
        # For each subcomponent, the one that is connected to its rear end.
        module_behind: dict[str, str] = {}
        for connection in self.connections:
            name_by_end = {end: name for name, end in map(self._end, connection)}
            meeting = " meets ".join(connection)
            # If two front ends or two rear ends meet, the names have only one end.
            if set(name_by_end) != set(ENDS):
                raise ComponentError(self.path, f"{meeting}: a rear end must meet a front end")
            ahead, behind = name_by_end["rear"], name_by_end["front"]
            if ahead in module_behind or behind in module_behind.values():
                raise ComponentError(self.path, f"{meeting}, but an end can be connected once only")
            module_behind[ahead] = behind
        # A chain begins with a module that is behind no other.
        chains: list[list[str]] = []
        modules_in_chains: set[str] = set()
        for first in self.children:
            if first not in module_behind.values():
                chain = [first]
                while chain[-1] in module_behind:
                    chain.append(module_behind[chain[-1]])
                chains.append(chain)
                modules_in_chains.update(chain)
        # The other modules have no first one: their connections go round in a ring.
        ring = [name for name in self.children if name not in modules_in_chains]
        if len(chains) != 1 or ring:
            parts = [" - ".join(chain) for chain in chains]
            if ring:
                parts.append(f"{' - '.join(ring)}, a ring")
            chains_text = "; ".join(parts) or "nothing"
            raise ComponentError(self.path, f"its connections must make one chain, but make {chains_text}")
        return chains[0]

    def _end(self, place: str) -> tuple[str, str]:
        """Split an end such as ``car.rear`` into name and end. Raises ComponentError if one of them is unknown."""
        name, _, end = place.rpartition(".")
        if name not in self.children or end not in ENDS:
            names = ", ".join(self.children)
            raise ComponentError(self.path, f'connects "{place}"; it has {names}, each with .front and .rear')
        return name, end
