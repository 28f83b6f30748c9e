"""A servo in a wall: its opening, its screw holes, and a second layer of film behind them.

The servo is inserted from outside until its ears lie on the wall: its shaft points outwards, its length runs along
the wall.
"""

import math

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.catalogue import catalogue


def doubler_length_mm() -> float:
    """Length of the second layer (mm), which reaches past the screw holes."""
    servo, assembly = catalogue().servo, catalogue().assembly
    return servo.screw_spacing_mm.value + assembly.screw_hole_mm.value + 2 * assembly.doubler_margin_mm.value


class ServoMount(Component):
    """The second layer behind the wall; the parent calls :meth:`cut` to put the servo into a wall."""

    parameters = (Parameter("height", 12, 1, 200, "of the second layer", "the servo's opening", internal=True),)

    def build(self, shape: Shape) -> None:
        """The face ``doubler``, its origin at the centre of the opening."""
        a, b = doubler_length_mm() / 2, self["height"] / 2
        shape.face("doubler", ((-a, -b), (a, -b), (a, b), (-a, b)), piece="servo doubler")
        _holes(shape, "doubler", "", 0.0, 0.0)

    @staticmethod
    def cut(shape: Shape, mount: str, wall: str, axis_mm: tuple[float, float], inward: float) -> str:
        """Put the servo of the subcomponent ``mount`` into the face ``wall`` of the caller.

        ``axis_mm``: the point where its axis passes the wall; ``inward`` is 1 if its long side lies towards +x, else -1.
        Returns the name of the mounted part.
        """
        servo, wall_mm = catalogue().servo, catalogue().film.thickness_mm.value
        x = axis_mm[0] + inward * (servo.length_mm.value / 2 - servo.axis_from_end_mm.value)
        y = axis_mm[1]
        holes = _holes(shape, wall, f"{mount}.wall ", x, y)
        shape.laminate(f"{mount}.doubler", wall, translation(x, y, wall_mm))
        # The ears' undersides lie on the outside of the wall.
        depth = servo.ear_underside_mm.value - servo.depth_mm.value / 2 - wall_mm / 2
        # The box's length and width lie in the wall, its depth across it; half a turn puts its shaft's end at the axis.
        turn = rotation("z", 0.0 if inward > 0 else math.pi)
        size = (servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value)
        name = f"{shape.name}.{mount}"
        shape.box(servo.name, name, wall, compose(translation(x, y, depth), turn), size, servo.mass_kg.value, holes)
        return name


def _holes(shape: Shape, face: str, prefix: str, x: float, y: float) -> list[str]:
    servo, assembly = catalogue().servo, catalogue().assembly
    clearance, pitch = 2 * assembly.opening_clearance_mm.value, servo.screw_spacing_mm.value / 2
    length, width = servo.length_mm.value + clearance, servo.width_mm.value + clearance
    screw = assembly.screw_hole_mm.value
    return [
        shape.rectangular_hole(face, f"{prefix}opening", "opening", (x, y), length, width),
        shape.round_hole(face, f"{prefix}screw 1", "screw", (x - pitch, y), screw),
        shape.round_hole(face, f"{prefix}screw 2", "screw", (x + pitch, y), screw),
    ]
