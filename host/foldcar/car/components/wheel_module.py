"""The wheel module W: a beam, two servos in its sides, and the wheels they turn."""

from collections.abc import Sequence

from foldcar.car.compiler.component import Component, Sub
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.box_beam import wall_mm
from foldcar.car.components.dimensions import HEIGHT, RADIUS, WHEEL_MODULE_LENGTH, WIDTH
from foldcar.car.components.module import TAB_THERE, TOWARDS_MIDDLE, Module
from foldcar.car.components.servo_mount import ServoMount, doubler_length_mm
from foldcar.car.components.wheel import TYRE_WIDTH
from foldcar.car.parts.catalogue import catalogue


def tyre_gap_mm() -> float:
    """Distance from the side wall's outer surface to the tyre (mm): the servo's height outside the wall and a gap."""
    servo, assembly = catalogue().servo, catalogue().assembly
    return servo.depth_mm.value - servo.ear_underside_mm.value + assembly.tyre_gap_mm.value


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
        thickness = catalogue().film.thickness_mm.value
        axis = (self["length"] / 2, wall_mm(self["height"]) / 2)
        out = -(thickness / 2 + tyre_gap_mm() + self["tire_thickness"] / 2)
        for side in ("left", "right"):
            wall = f"beam.{side}"
            servo = ServoMount.cut(shape, f"{side} servo", wall, axis, self["towards_middle"])
            shape.axle(wall, servo, side, (*axis, out), self["radius"], self["tire_thickness"])

    def _check_length(self) -> None:
        """ComponentError if the layer behind a servo would overlap the tab of a cap."""
        servo = catalogue().servo
        reach = servo.length_mm.value / 2 - servo.axis_from_end_mm.value + doubler_length_mm() / 2
        least = 2 * (reach + self["tab_there"])
        if self["tab_there"] > 0 and self["length"] < least:
            why = f"a segment of its own: one {servo.name} and the cap's tabs"
            raise self.misfit("length", f"{self['length']:g} is below the minimum {least:g} ({why})")


def _doubler_height(module: Component) -> float:
    """Height of the layer behind a servo (mm): the wall's, less the tabs and flaps that are glued along its edges."""
    servo, assembly = catalogue().servo, catalogue().assembly
    least = servo.width_mm.value + 2 * (assembly.opening_clearance_mm.value + assembly.doubler_margin_mm.value)
    return max(least, min(wall_mm(module["height"]) - 2 * assembly.fold_distance_mm.value, 2 * servo.width_mm.value))
