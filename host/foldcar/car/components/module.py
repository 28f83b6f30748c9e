"""Modules, the units of a type string: a length of box beam with parts in or on it; W with an axle, B with a body.

A user module is a subclass with a ``letter`` (or a name, without underscores) and a ``title``; see docs/compiler.md.
The hinge is a Component of its own (hinge_module.py), and so is the B that carries the electronics (electronics.py).
"""

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

from foldcar.car.components.box_beam import HEIGHT, WIDTH, BoxBeam, wall_distance_mm
from foldcar.car.components.component import Component, Parameter, Sub
from foldcar.car.components.mounts import (
    min_doubler_mm,
    put_servo,
    screw_end_mm,
    servo_reach_mm,
    switches_width_mm,
)
from foldcar.car.components.rods import put_rod
from foldcar.car.components.shape import Shape
from foldcar.car.components.wheel import DRIVEN, RADIUS, TYRE_WIDTH
from foldcar.car.parts.catalogue import Catalogue

SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")


class Module(Component):
    """A length of the car's body: a subcomponent ``beam`` as long, wide and high as the module."""

    letter: ClassVar[str]
    title: ClassVar[str]
    parameters: tuple[Parameter, ...] = (
        WIDTH,
        HEIGHT,
        Parameter("length", 80, 10, 400, "length of the module", "a strip that can be folded"),
    )

    def subcomponents(self) -> Sequence[Sub]:
        """Return the beam; a subclass adds to it with ``(*super().subcomponents(), Sub(…))``."""
        return (Sub("beam", BoxBeam, self.values),)


def _min_wheel_module_mm(parts: Catalogue) -> float:
    """Return minimum length (mm): on both sides of the axis, the farther screw hole and its distance from the fold."""
    servo = parts.servo
    reach = servo.length_mm.value / 2 - servo.axis_from_end_mm.value + screw_end_mm(parts)
    return 2 * (reach + parts.assembly.fold_distance_mm.value)


class WheelModule(Module):
    """One axle in the middle of the module, at half its height: two servos, or a rod on which the wheels turn freely.

    The car sets ``towards_middle``: 1 if the segment's middle lies in front of the module's middle, else -1. It also sets
    ``tab_depth`` (mm), the depth of the end cap's tab on the side walls at the module's end nearer to that middle, and
    ``switch_depth`` (mm), that of the switches in the cap at its other end; 0 without them.
    """

    letter = "W"
    title = "wheel module: one axle, two servos and their wheels"
    parameters = (
        WIDTH,
        HEIGHT,
        RADIUS,
        Parameter(
            "length", 60, _min_wheel_module_mm, 400, "length of a wheel module, its axle in the middle",
            "the opening and screws of one servo",
        ),
        TYRE_WIDTH,
        DRIVEN,
    )  # fmt: skip

    def build(self, shape: Shape) -> None:
        """Mount two wheels: each on a servo in a side wall, or both on a rod through the walls if they are not driven.

        The long sides of the servos point to the middle of the segment. The car says where it is by ``towards_middle``: 1
        if it lies in front of this module, else -1. In the frame of a side wall x points forward and z into the car.
        """
        parts, wheel_width_mm = self.parts, self["tire_thickness"]
        gap_mm = self._wall_to_wheel_mm()
        # The axis of the wheels passes the middle of a side wall, so its place is the same in the frames of both walls.
        axis = (self["length"] / 2, wall_distance_mm(self["height"], parts) / 2)
        # The name of the servo of each wheel, "" without a servo.
        servos = dict.fromkeys(SIDES, "")
        if self["driven"]:
            self._check_length()
            self._check_switches()
            layer_mm = self._doubler_height_mm()
            for side in SIDES:
                servo, wall = f"{side} servo", f"beam.{side}"
                servos[side] = put_servo(shape, servo, wall, axis, inward=self["towards_middle"], height_mm=layer_mm)
        else:
            walls_mm = wall_distance_mm(self["width"], parts)
            put_rod(shape, ("beam.left", "beam.right"), axis, apart_mm=walls_mm, gap_mm=gap_mm, wheel_mm=wheel_width_mm)
        # A wheel is outside the wall, where z is negative.
        center_mm = (*axis, -(parts.film_mm / 2 + gap_mm + wheel_width_mm / 2))
        tyre_width_mm = parts.tyre.running_width_mm(wheel_width_mm)
        for side in SIDES:
            shape.axle(f"beam.{side}", servos[side], side, center_mm, self["radius"], tyre_width_mm)

    def _wall_to_wheel_mm(self) -> float:
        """Return the gap (mm) between the outer surface of a side wall and the wheel on its servo.

        The undersides of the servo's ears lie on the wall, and the wheel lies on the outer face of the servo's horn.
        """
        servo, horn = self.parts.servo, self.parts.horn
        # Both heights are measured from the servo's bottom.
        horn_face_mm = servo.spline_top_mm.value - horn.spline_depth_mm.value + horn.height_mm.value
        return horn_face_mm - servo.ear_underside_mm.value

    def _check_length(self) -> None:
        """Raise ComponentError if the layer of film behind a servo, or the nut of its screw, meets the tab of a cap."""
        # The axis is in the middle of the length, so the limit is twice the servo's reach and the tab's depth.
        min_length_mm = _rounded_up(2 * (servo_reach_mm(self.parts).long_mm + self["tab_depth"]))
        if self["tab_depth"] > 0 and self["length"] < min_length_mm:
            reason = f"a segment of its own: one {self.parts.servo.name} and the cap's tabs"
            raise self.parameter_error("length", f"{self['length']:g} is below the minimum {min_length_mm:g} ({reason})")

    def _doubler_height_mm(self) -> float:
        """Return the height of the layer of film behind a servo, its doubler (mm).

        It is clear of the lid's flap and its latches, and at most twice as high as the servo.
        """
        parts = self.parts
        flap_depth_mm = parts.assembly.flap_mm.value + parts.film_mm + parts.assembly.slot_clearance_mm.value
        clear_height_mm = wall_distance_mm(self["height"], parts) - 2 * flap_depth_mm
        return max(min_doubler_mm(parts), min(clear_height_mm, 2 * parts.servo.width_mm.value))

    def _check_switches(self) -> None:
        """Raise ComponentError if the two servos of this module leave no room for switches in the cap at its end.

        Switches fit if they go between the servos, or if the module is so long that they end before the servos begin.
        """
        if not self["switch_depth"]:
            return
        parts, gap_mm = self.parts, self.parts.assembly.part_gap_mm.value
        # A servo hangs with its ears on the outer surface of its wall. It reaches into the car by the height of the ears.
        outer_mm = wall_distance_mm(self["width"], parts) + parts.film_mm
        between_servos_mm = outer_mm - 2 * parts.servo.ear_underside_mm.max_value
        needed_mm = switches_width_mm(parts) + 2 * gap_mm
        if between_servos_mm >= needed_mm:
            return
        # The axis is in the middle of the module's length, and the short sides of the servos point to the cap.
        axis_to_cap_mm = servo_reach_mm(parts).short_mm + self["switch_depth"] + gap_mm
        min_length_mm = _rounded_up(2 * axis_to_cap_mm)
        if self["length"] < min_length_mm:
            # In a body of this width, the switches would fit between the servos.
            sufficient_width_mm = math.ceil(self["width"] + (needed_mm - between_servos_mm))
            reason = f"the servos beside the switches in the cap, if width is below {sufficient_width_mm}"
            raise self.parameter_error("length", f"{self['length']:g} is below the minimum {min_length_mm:g} ({reason})")


def _rounded_up(length_mm: float) -> float:
    """Return a length rounded up to 0.1 mm."""
    return math.ceil(10 * length_mm) / 10


LENGTH = Parameter("length", 80, 10, 400, "length of a body module", "a strip that can be folded")


class BrainModule(Module):
    """A beam; ``ElectronicsModule`` (electronics.py) is the one with boards and batteries in it."""

    letter = "B"
    title = "body module: electronics and batteries"
    parameters = (WIDTH, HEIGHT, LENGTH)
