"""Parts in walls, caps and floors, with layers of film behind them, and screws: servo, switch and ball caster.

A servo is inserted from outside until its ears lie on the wall: its shaft points outwards, its length runs along the
wall. A switch snaps into an end cap. A caster is screwed under the floor of a user's module: `Sub("caster", Caster)` and
`Caster.attach` in `build`; in the simulator, which has contacts for wheels and bellies only, it is mass without contact.
A screw's frame has its origin in the middle of its length, z along its axis towards its head.
"""

import math

from foldcar.car.components.component import Component, Parameter
from foldcar.car.components.shape import Shape, rectangle_around
from foldcar.car.folded.model import IDENTITY, Access, Point, Pose, Solid
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.bought import Screw
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
    return (parts.servo.screw_spacing_mm.most + parts.assembly.screw_hole_mm.value) / 2


def least_doubler_mm(parts: Catalogue) -> float:
    """The least height of the second layer (mm)."""
    margins = parts.assembly.opening_clearance_mm.value + parts.assembly.doubler_margin_mm.value
    return parts.servo.width_mm.most + 2 * margins


class ServoMount(Component):
    """The second layer behind the wall; the parent calls :meth:`cut` to put the servo into a wall."""

    parameters = (Parameter("height", 12, 1, 200, "of the second layer", "the servo's opening", internal=True),)

    def build(self, shape: Shape) -> None:
        """The face ``doubler``, its origin at the centre of the opening."""
        outline = rectangle_around((0.0, 0.0), doubler_length_mm(self.parts), self["height"])
        shape.face("doubler", outline, piece="servo doubler")
        _opening(shape, "doubler", "opening", 0.0, 0.0)

    @staticmethod
    def cut(shape: Shape, mount: str, wall: str, axis_mm: tuple[float, float], inward: float) -> str:
        """Put the servo of the subcomponent ``mount`` into the face ``wall`` of the caller.

        ``axis_mm``: the point where its axis passes the wall; ``inward`` is 1 if its long side lies towards +x, else -1.
        Returns the name of the mounted part.
        """
        servo, wall_mm = shape.parts.servo, shape.parts.film_mm
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
    a, b = ((size.most + clearance) / 2 for size in (servo.length_mm, servo.width_mm))
    far = screw_end_mm(shape.parts) - r
    turns = [math.pi * (i / ARC_STEPS - 0.5) for i in range(ARC_STEPS + 1)]
    half = [(a, -b), (a, -r), *((far + r * math.cos(at), r * math.sin(at)) for at in turns), (a, r), (a, b)]
    outline = [*half, *((-u, -v) for u, v in half)]
    return shape.polygon_hole(face, name, "opening", [(x + u, y + v) for u, v in outline])


def layers(parts: Catalogue) -> int:
    """How many layers of film and tape lie behind the panel, so that the barbs of any such switch hold."""
    film, tape = parts.film.thickness_mm.least, parts.assembly.tape_mm.least
    return max(1, math.ceil((parts.switch.panel_least_mm.most - film) / (film + tape) - 1e-9))


def depth_mm(parts: Catalogue) -> float:
    """How far the switch reaches inwards from the panel (mm)."""
    switch = parts.switch
    return switch.height_mm.value - switch.rocker_height_mm.value - switch.bezel_height_mm.value


class SwitchMount(Component):
    """Faces ``layer 1`` …; the parent calls :meth:`cut`."""

    def build(self, shape: Shape) -> None:
        """The layers, each with its opening at the origin."""
        switch, around = self.parts.switch, 2 * self.parts.assembly.switch_margin_mm.value
        size = (switch.slot_length_mm.value + around, switch.slot_width_mm.value + around)
        outline = rectangle_around((0.0, 0.0), *size)
        for i in range(layers(self.parts)):
            name = f"layer {i + 1}"
            shape.face(name, outline, piece="switch doubler")
            _switch_opening(shape, name, f"{name}.opening", (0.0, 0.0))

    @staticmethod
    def cut(shape: Shape, mount: str, panel: str, at_mm: Point) -> None:
        """Put the switch of the subcomponent ``mount`` into the caller's face ``panel``, seen from inside."""
        switch, film = shape.parts.switch, shape.parts.film_mm
        for i in range(layers(shape.parts)):
            shape.laminate(f"{mount}.layer {i + 1}", panel, translation(*at_mm, (i + 1) * film))
        hole = _switch_opening(shape, panel, f"{mount} opening", at_mm)
        outside = switch.rocker_height_mm.value + switch.bezel_height_mm.value
        half = switch.height_mm.value / 2
        # z of the mount's frame points outwards; its box's middle lies inside.
        middle = half - outside - film / 2
        pose = compose(translation(*at_mm, middle), rotation("x", math.pi))
        size = switch.size_mm
        body = (switch.body_length_mm.value, switch.body_width_mm.value)
        solids = [
            _box((size[0], size[1]), half - outside, half - switch.rocker_height_mm.value),
            _box(body, half - switch.rocker_height_mm.value, half),
            _box(body, -half, half - outside),
        ]
        finger = Access("finger", translation(0, 0, half), *shape.parts.tools.finger_mm)
        shape.box(switch.name, switch.name, panel, pose, size, switch.mass_kg.value, [hole], solids, [finger])


def _switch_opening(shape: Shape, face: str, name: str, at_mm: Point) -> str:
    switch = shape.parts.switch
    return shape.rectangular_hole(face, name, "opening", at_mm, switch.slot_length_mm.value, switch.slot_width_mm.value)


def _box(footprint: tuple[float, float], low_mm: float, high_mm: float) -> Solid:
    return Solid("box", (*footprint, high_mm - low_mm), translation(0, 0, (low_mm + high_mm) / 2))


class Caster(Component):
    """A second layer of film on the floor; the caster is screwed under it."""

    def build(self, shape: Shape) -> None:
        """The face ``plate``, its origin at its centre."""
        caster, margin = self.parts.caster, self.parts.assembly.doubler_margin_mm.value
        outline = rectangle_around((0.0, 0.0), caster.length_mm.value + 2 * margin, caster.width_mm.value + 2 * margin)
        shape.face("plate", outline, piece="caster plate")
        _holes(shape, "plate", "", (0.0, 0.0))

    @staticmethod
    def attach(shape: Shape, mount: str, floor: str, at_mm: tuple[float, float]) -> None:
        """Fix the caster of the subcomponent ``mount`` under the caller's face ``floor``, its centre at ``at_mm``."""
        caster, film = shape.parts.caster, shape.parts.film_mm
        holes = _holes(shape, floor, f"{mount}.", at_mm)
        shape.laminate(f"{mount}.plate", floor, translation(*at_mm, film))
        under = translation(*at_mm, -(film + caster.height_mm.value) / 2)
        pose = compose(under, rotation("x", math.pi))
        shape.box(caster.name, f"{shape.name}.{mount}", floor, pose, caster.size_mm, caster.mass_kg.value, holes)


def _holes(shape: Shape, face: str, prefix: str, middle: tuple[float, float]) -> list[str]:
    half, size = shape.parts.caster.hole_spacing_mm.value / 2, shape.parts.assembly.screw_hole_mm.value
    return [
        shape.round_hole(face, f"{prefix}screw {i + 1}", "screw", (middle[0] + x, middle[1]), size)
        for i, x in enumerate((-half, half))
    ]


def cylinder(
    diameter_mm: float, low_mm: float, high_mm: float, x_mm: float = 0.0, y_mm: float = 0.0, bore_mm: float = 0.0
) -> Solid:
    """A cylinder along z between two heights, with a bore along its axis."""
    pose = translation(x_mm, y_mm, (low_mm + high_mm) / 2)
    bores = ((0.0, 0.0, bore_mm),) if bore_mm else ()
    return Solid("cylinder", (diameter_mm, diameter_mm, high_mm - low_mm), pose, bores)


def driver(parts: Catalogue, z_mm: float) -> Access:
    """The room of a screwdriver along +z from a height."""
    return Access("driver", translation(0, 0, z_mm), *parts.tools.driver_mm)


def screw_in(shape: Shape, screw: Screw, name: str, on: str, under_head: Pose, grip_mm: float) -> None:
    """Add a screw: ``under_head`` is the point below its head in the frame of the face ``on``, z outwards.

    Its nut is ``grip_mm`` below the head.
    """
    head, shank = screw.head_height_mm.value, screw.length_mm.value
    middle = (head - shank) / 2
    solids = [
        cylinder(screw.head_diameter_mm.value, -middle, head - middle),
        cylinder(screw.diameter_mm.value, -shank - middle, -middle),
    ]
    if screw.nut_width_mm is not None and screw.nut_height_mm is not None:
        # A nut is held with a flat towards what stands beside it.
        low = -grip_mm - screw.nut_height_mm.value - middle
        solids.append(cylinder(screw.nut_width_mm.value, low, -grip_mm - middle))
    size = (screw.head_diameter_mm.value, screw.head_diameter_mm.value, head + shank)
    pose = compose(under_head, translation(0, 0, middle))
    accesses = [driver(shape.parts, head - middle)]
    shape.box(screw.name, name, on, pose, size, screw.mass_kg.value, (), solids, accesses)
