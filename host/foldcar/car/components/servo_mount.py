"""A servo in a wall: its opening with notches for its screws, and a second layer of film behind it.

The servo is inserted from outside until its ears lie on the wall: its shaft points outwards, its length runs along
the wall.
"""

import math

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.fasteners import cylinder, screw_in
from foldcar.car.folded.model import Solid
from foldcar.car.folded.pose import IDENTITY, compose, rotation, translation
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity

# Sides of a notch's round end.
ARC_STEPS = 24


def inside_mm(parts: Catalogue) -> tuple[float, float]:
    """From the axis to the last layer or nut inside (mm), on the servo's long side and on its short one."""
    servo, nut = parts.servo, parts.screw.nut_width_mm
    middle = servo.length_mm.value / 2 - servo.axis_from_end_mm.value
    corner = 0.0 if nut is None else nut.value / 3**0.5
    reach = max(doubler_length_mm(parts) / 2, servo.screw_spacing_mm.value / 2 + corner)
    return reach + middle, reach - middle


def doubler_length_mm(parts: Catalogue) -> float:
    """Length of the second layer (mm), which reaches past the notches."""
    return 2 * (screw_end_mm(parts) + parts.assembly.doubler_margin_mm.value)


def screw_end_mm(parts: Catalogue) -> float:
    """From the middle of the opening to the outer end of a screw's notch (mm).

    Servos whose screws are farther apart find room there; if they are nearer, their own slots take them.
    """
    spacing = parts.servo.screw_spacing_mm
    return (spacing.value + spacing.tolerance + parts.assembly.screw_hole_mm.value) / 2


def least_doubler_mm(parts: Catalogue) -> float:
    """The least height of the second layer (mm)."""
    margins = parts.assembly.opening_clearance_mm.value + parts.assembly.doubler_margin_mm.value
    return parts.servo.width_mm.value + parts.servo.width_mm.tolerance + 2 * margins


class ServoMount(Component):
    """The second layer behind the wall; the parent calls :meth:`cut` to put the servo into a wall."""

    parameters = (Parameter("height", 12, 1, 200, "of the second layer", "the servo's opening", internal=True),)

    def build(self, shape: Shape) -> None:
        """The face ``doubler``, its origin at the centre of the opening."""
        a, b = doubler_length_mm(self.parts) / 2, self["height"] / 2
        shape.face("doubler", ((-a, -b), (a, -b), (a, b), (-a, b)), piece="servo doubler")
        _opening(shape, "doubler", "opening", 0.0, 0.0)

    @staticmethod
    def cut(shape: Shape, mount: str, wall: str, axis_mm: tuple[float, float], inward: float) -> str:
        """Put the servo of the subcomponent ``mount`` into the face ``wall`` of the caller.

        ``axis_mm``: the point where its axis passes the wall; ``inward`` is 1 if its long side lies towards +x, else -1.
        Returns the name of the mounted part.
        """
        servo, wall_mm = shape.parts.servo, shape.parts.film.thickness_mm.value
        x = axis_mm[0] + inward * (servo.length_mm.value / 2 - servo.axis_from_end_mm.value)
        y = axis_mm[1]
        hole = _opening(shape, wall, f"{mount}.wall opening", x, y)
        shape.laminate(f"{mount}.doubler", wall, translation(x, y, wall_mm))
        # The ears' undersides lie on the outside of the wall.
        depth = servo.ear_underside_mm.value - servo.depth_mm.value / 2 - wall_mm / 2
        # The box's length and width lie in the wall, its depth across it; half a turn puts its shaft's end at the axis.
        turn = rotation("z", 0.0 if inward > 0 else math.pi)
        size = (servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value)
        name = f"{shape.name}.{mount}"
        pose = compose(translation(x, y, depth), turn)
        shape.box(servo.name, name, wall, pose, size, servo.mass_kg.value, [hole], _solids(shape.parts))
        under_head = -wall_mm / 2 - servo.ear_thickness_mm.value
        grip = servo.ear_thickness_mm.value + 2 * wall_mm
        for i, side in enumerate((-1, 1), 1):
            at = translation(x + side * servo.screw_spacing_mm.value / 2, y, under_head)
            screw_in(shape, shape.parts.screw, f"{name} screw {i}", wall, compose(at, rotation("x", math.pi)), grip)
        return name


def _solids(parts: Catalogue) -> list[Solid]:
    """Body, ears, turret, idler and spline in the frame of the body's middle, whose z points to the servo's bottom."""
    servo = parts.servo
    length, width, depth = servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value

    def z(height: Quantity) -> float:
        return depth / 2 - height.value

    ears = z(servo.ear_underside_mm)
    thickness = servo.ear_thickness_mm.value
    axis = servo.axis_from_end_mm.value - length / 2
    top, turret, spline = -depth / 2, z(servo.turret_top_mm), z(servo.spline_top_mm)
    # The centre screw cuts its way into the spline.
    screw = parts.centre_screw.diameter_mm.value
    half = servo.screw_spacing_mm.value / 2
    holes = tuple((x, 0.0, servo.screw_hole_mm.value) for x in (-half, half))
    idler = axis + servo.idler_from_axis_mm.value
    return [
        Solid("box", (length, width, depth), IDENTITY),
        Solid("box", (servo.ear_span_mm.value, width, thickness), translation(0, 0, ears - thickness / 2), holes),
        cylinder(servo.turret_diameter_mm.value, turret, top, axis, bore_mm=screw),
        cylinder(servo.idler_diameter_mm.value, turret, top, idler),
        cylinder(servo.spline_diameter_mm.value, spline, turret, axis, bore_mm=screw),
    ]


def _opening(shape: Shape, face: str, name: str, x: float, y: float) -> str:
    """Cut the servo's opening, with a notch for the screw at each end; returns its full name.

    One piece of waste instead of three: between a hole and the opening there would be less than 1 mm of film, which holds
    nothing. A notch holds its screw across the wall's length and outwards, the servo's body rests inwards.
    """
    servo, assembly = shape.parts.servo, shape.parts.assembly
    clearance, r = 2 * assembly.opening_clearance_mm.value, assembly.screw_hole_mm.value / 2
    a, b = ((size.value + size.tolerance + clearance) / 2 for size in (servo.length_mm, servo.width_mm))
    far = screw_end_mm(shape.parts) - r
    turns = [math.pi * (i / ARC_STEPS - 0.5) for i in range(ARC_STEPS + 1)]
    half = [(a, -b), (a, -r), *((far + r * math.cos(at), r * math.sin(at)) for at in turns), (a, r), (a, b)]
    outline = [*half, *((-u, -v) for u, v in half)]
    return shape.polygon_hole(face, name, "opening", [(x + u, y + v) for u, v in outline])
