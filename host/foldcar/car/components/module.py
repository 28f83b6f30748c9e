"""The base class of modules, the units of a type string: a length of box beam with parts in or on it.

A user module is a subclass with a ``letter`` (or a name, without underscores) and a ``title``; see docs/compiler.md.
The hinge is a Component of its own (hinge_module.py).
"""

import math
from collections.abc import Sequence
from typing import ClassVar

from foldcar.car.components.box_beam import HEIGHT, SET_BY_CAR, WIDTH, BoxBeam, wall_mm
from foldcar.car.components.component import Component, Sub
from foldcar.car.components.mounts import ServoMount, inside_mm, least_doubler_mm, screw_end_mm
from foldcar.car.components.parameter import Parameter
from foldcar.car.components.shape import Shape
from foldcar.car.components.wheel import RADIUS, TYRE_WIDTH
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
        inherited = ("length", "width", "height", *(one.name for one in SET_BY_CAR))
        return (Sub("beam", BoxBeam, inherit=inherited, root=True),)


def _least_wheel_module(parts: Catalogue) -> float:
    """From the far edge of the screw hole on the servo's long side to the fold, on both sides of the axis (mm)."""
    servo = parts.servo
    reach = servo.length_mm.value / 2 - servo.axis_from_end_mm.value + screw_end_mm(parts)
    return 2 * (reach + parts.assembly.fold_distance_mm.value)


class WheelModule(Module):
    """One axle in the middle of the module, at half its height."""

    letter = "W"
    title = "wheel module: one axle, two servos and their wheels"
    parameters = (
        WIDTH,
        HEIGHT,
        RADIUS,
        Parameter(
            "length", 60, _least_wheel_module, 400, "length of a wheel module, its axle in the middle",
            "the opening and screws of one servo",
        ),
        TYRE_WIDTH,
        TOWARDS_MIDDLE,
        TAB_THERE,
    )  # fmt: skip

    def subcomponents(self) -> Sequence[Sub]:
        """The beam, and a servo mount in each side."""
        mounts = [Sub(f"{side} servo", ServoMount, settings={"height": _doubler_height}) for side in ("left", "right")]
        return (*super().subcomponents(), *mounts)

    def build(self, shape: Shape) -> None:
        """Put a servo into each side wall, its long side towards the middle of the segment, and a wheel onto it."""
        parts, servo, horn = self.parts, self.parts.servo, self.parts.horn
        # The layer behind a servo, or the nut of its screw, must not meet the tab of a cap.
        least = math.ceil(20 * (inside_mm(parts)[0] + self["tab_there"])) / 10
        if self["tab_there"] > 0 and self["length"] < least:
            why = f"a segment of its own: one {servo.name} and the cap's tabs"
            raise self.misfit("length", f"{self['length']:g} is below the minimum {least:g} ({why})")
        axis = (self["length"] / 2, wall_mm(self["height"], parts) / 2)
        # From the side wall's outer surface to the wheel: the inner disc lies on the horn's outer face.
        face = servo.spline_top_mm.value - horn.spline_depth_mm.value + horn.height_mm.value
        gap = face - servo.ear_underside_mm.value
        out = -(parts.film.thickness_mm.value / 2 + gap + self["tire_thickness"] / 2)
        running = self.parts.tyre.running_width_mm(self["tire_thickness"])
        for side in ("left", "right"):
            wall = f"beam.{side}"
            name = ServoMount.cut(shape, f"{side} servo", wall, axis, self["towards_middle"])
            shape.axle(wall, name, side, (*axis, out), self["radius"], running)


def _doubler_height(module: Component) -> float:
    """Height of the layer behind a servo (mm): at most twice the servo's, and clear of the lid's flap and its locks."""
    parts, assembly = module.parts, module.parts.assembly
    wall = wall_mm(module["height"], parts)
    flap = assembly.flap_mm.value + parts.film.thickness_mm.value + assembly.slot_clearance_mm.value
    return max(least_doubler_mm(parts), min(wall - 2 * flap, 2 * parts.servo.width_mm.value))
