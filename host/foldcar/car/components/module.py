"""The base class of modules, the units of a type string: a length of box beam with parts in or on it.

A user module is a subclass with a ``letter`` (or a name, without underscores) and a ``title``; see docs/compiler.md.
The hinge is a Component of its own (hinge_module.py).
"""

from collections.abc import Sequence
from typing import ClassVar

from foldcar.car.compiler.component import Component, Sub
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.components.box_beam import FROM_CAR, BoxBeam
from foldcar.car.components.dimensions import HEIGHT, WIDTH

# Set by the car: 1 if the middle of the segment lies in front of the module's, else -1.
TOWARDS_MIDDLE = Parameter("towards_middle", 1, -1, 1, "where the segment's middle is", "rear", "", internal=True)
# Set by the car: the depth (mm) of the end cap's tab on the side walls at the module's end towards that middle.
TAB_THERE = Parameter("tab_there", 0, 0, 100, "depth of an end cap's tab", "none", internal=True)


class Module(Component):
    """A length of the car's body: a subcomponent ``beam`` as long, wide and high as the module."""

    letter: ClassVar[str]
    title: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = (
        WIDTH,
        HEIGHT,
        Parameter("length", 80, 10, 400, "length of the module", "a strip that can be folded"),
    )

    def subcomponents(self) -> Sequence[Sub]:
        """The beam; a subclass adds to it with ``(*super().subcomponents(), Sub(…))``."""
        return (Sub("beam", BoxBeam, inherit=("length", "width", "height", *FROM_CAR), root=True),)
