"""The base class of modules, the units of a type string: a length of box beam with parts in or on it.

A user module is a subclass with a ``letter`` (or a name, without underscores) and a ``title``; see docs/compiler.md.
The hinge is a Component of its own (hinge_module.py).
"""

import math
from collections.abc import Sequence
from typing import ClassVar

from foldcar.car.components.box_beam import FROM_CAR, BoxBeam, wall_mm
from foldcar.car.components.component import Component, Sub
from foldcar.car.components.dimensions import HEIGHT, RADIUS, WHEEL_MODULE_LENGTH, WIDTH
from foldcar.car.components.mounts import ServoMount, inside_mm, least_doubler_mm
from foldcar.car.components.parameter import Parameter
from foldcar.car.components.shape import Shape
from foldcar.car.components.wheel import TYRE_WIDTH
from foldcar.car.parts.catalogue import Catalogue

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


def tyre_gap_mm(parts: Catalogue) -> float:
    """Distance from the side wall's outer surface to the wheel (mm): the inner disc lies on the horn's outer face."""
    servo, horn = parts.servo, parts.horn
    face = servo.spline_top_mm.value - horn.spline_depth_mm.value + horn.height_mm.value
    return face - servo.ear_underside_mm.value


class WheelModule(Module):
    """One axle in the middle of the module, at half its height."""

    letter = "W"
    title = "wheel module: one axle, two servos and their wheels"
    parameters = (WIDTH, HEIGHT, RADIUS, WHEEL_MODULE_LENGTH, TYRE_WIDTH, TOWARDS_MIDDLE, TAB_THERE)

    def subcomponents(self) -> Sequence[Sub]:
        """The beam, and a servo mount in each side."""
        mounts = [Sub(f"{side} servo", ServoMount, settings={"height": _doubler_height}) for side in ("left", "right")]
        return (*super().subcomponents(), *mounts)

    def build(self, shape: Shape) -> None:
        """Put a servo into each side wall, its long side towards the middle of the segment, and a wheel onto it."""
        self._check_length()
        thickness = self.parts.film.thickness_mm.value
        axis = (self["length"] / 2, wall_mm(self["height"], self.parts) / 2)
        out = -(thickness / 2 + tyre_gap_mm(self.parts) + self["tire_thickness"] / 2)
        running = self.parts.tyre.running_width_mm(self["tire_thickness"])
        for side in ("left", "right"):
            wall = f"beam.{side}"
            servo = ServoMount.cut(shape, f"{side} servo", wall, axis, self["towards_middle"])
            shape.axle(wall, servo, side, (*axis, out), self["radius"], running)

    def _check_length(self) -> None:
        """ComponentError if the layer behind a servo, or the nut of its screw, would meet the tab of a cap."""
        servo = self.parts.servo
        least = math.ceil(20 * (inside_mm(self.parts)[0] + self["tab_there"])) / 10
        if self["tab_there"] > 0 and self["length"] < least:
            why = f"a segment of its own: one {servo.name} and the cap's tabs"
            raise self.misfit("length", f"{self['length']:g} is below the minimum {least:g} ({why})")


def _doubler_height(module: Component) -> float:
    """Height of the layer behind a servo (mm): at most twice the servo's, and clear of the lid's flap and its locks."""
    parts, assembly = module.parts, module.parts.assembly
    wall = wall_mm(module["height"], parts)
    flap = assembly.flap_mm.value + parts.film.thickness_mm.value + assembly.slot_clearance_mm.value
    return max(least_doubler_mm(parts), min(wall - 2 * flap, 2 * parts.servo.width_mm.value))
