"""A wheel: a spool of two discs on a hub, rim strips hooked around it, the horn, its screws and the tyre.

The wheel's frame has its origin at the wheel's centre and y along the axle, outwards on the left side. The discs' edges
are the running circle, the tyre lies over them. Bought parts are placed in the frame of the inner disc, whose z points
from the car outwards along the axle.
"""

import math
from itertools import pairwise

from foldcar.car.components.component import Component, Parameter
from foldcar.car.components.hooked_strip import build_hub, build_rim, first_facet_pose
from foldcar.car.components.mounts import add_screw, cylinder, wheel_hole_mm
from foldcar.car.components.shape import Shape, on_circle
from foldcar.car.components.wheel_size import WheelSize, access_radius_mm, arc_steps, min_radius_mm, wheel_screws_mm
from foldcar.car.folded.model import Point, Solid
from foldcar.car.folded.pose import apply, compose, inverse, rotation, translation
from foldcar.car.parts.catalogue import Catalogue

RADIUS = Parameter(
    "radius", 60, min_radius_mm, 150, "rolling radius of the wheels, tyre included",
    "a hub between whose walls a driver reaches the horn's screws, and a rim", shared=True,
)  # fmt: skip
TYRE_WIDTH = Parameter(
    "tire_thickness", 12, 8, 40, "width of a wheel, from outside to outside of its discs", "the tongues of its rim",
    uniform=True,
)  # fmt: skip
DRIVEN = Parameter(
    "driven",
    1,
    0,
    1,
    "whether servos drive the wheels; else they turn freely on a rod",
    "true or false",
    "",
    optional=True,
)


class Wheel(Component):
    """Two discs, a hub and a rim.

    The servo's horn is screwed to the inner disc; a wheel without a servo turns on a rod.
    """

    parameters = (RADIUS, TYRE_WIDTH, DRIVEN)

    def build(self, shape: Shape) -> None:
        """Add the discs, the hub and the rim, with the holes for horn or rod, the horn and the tyre.

        The faces are ``inner``, ``outer``, ``hub``, ``wall 1`` … and ``rim 0 0`` ….
        """
        size = WheelSize(self["radius"], self["tire_thickness"], self.parts)
        # The printed sides of the discs face each other. So in the inner disc's frame, directions around the axle run the
        # other way than in the wheel's frame.
        for name, mirror in (("inner", -1), ("outer", 1)):
            shape.face(name, _disc_outline(size, mirror), piece=f"wheel {name} disc")
        build_hub(shape, size)
        if self["driven"]:
            self._cut_holes(shape, size)
        else:
            for face in ("inner", "hub", "outer"):
                shape.round_hole(face, f"{face}.rod", "axle", (0, 0), wheel_hole_mm(self.parts))
        build_rim(shape, size)
        # The poses of the discs in the wheel's frame. y is the axle, and z of each disc points along it into the wheel.
        disc_y = (size.width_mm - size.film_mm) / 2
        inner_pose = compose(translation(0, -disc_y, 0), rotation("x", -math.pi / 2))
        outer_pose = compose(translation(0, disc_y, 0), rotation("x", math.pi / 2))
        # The other faces are placed in the frame of the inner disc.
        wheel_in_inner = inverse(inner_pose)
        for strip in range(size.strips):
            shape.place(f"rim {strip} 0", "inner", compose(wheel_in_inner, first_facet_pose(size, strip)))
        shape.place("outer", "inner", compose(wheel_in_inner, outer_pose))
        if self["driven"]:
            _add_horn(shape, size)
        if self.parts.tyre.thickness_mm.value > 0:
            _add_tyre(shape, size)
        shape.begin_at("inner", inner_pose)

    def _cut_holes(self, shape: Shape, size: WheelSize) -> None:
        """Cut the holes for the horn's screws into inner disc and hub, and the hole for the driver into the outer
        disc.
        """
        assembly, horn = self.parts.assembly, self.parts.horn
        tolerance = horn.wheel_screws.tolerance
        width = self.parts.horn_screw.diameter_mm.max_value + 2 * assembly.cut_mm.value
        for face in ("inner", "hub"):
            shape.round_hole(face, f"{face}.hub", "axle", (0, 0), horn.recess_diameter_mm.value)
            for number, (x, y) in enumerate(wheel_screws_mm(horn), 1):
                # The holes of a horn may lie nearer to the axle or farther from it than in its data. So the holes of the
                # wheel are slots along the radius.
                distance = math.hypot(x, y)
                nearest, farthest = 1 - tolerance / distance, 1 + tolerance / distance
                start, end = (x * nearest, y * nearest), (x * farthest, y * farthest)
                shape.slotted_hole(face, f"{face}.horn screw {number}", "screw", start, end, width)
        shape.round_hole("outer", "outer.access", "opening", (0, 0), 2 * access_radius_mm(self.parts))


def _disc_outline(size: WheelSize, mirror: int) -> dict[str, Point]:
    """Return the outline of a disc with a notch for each tie; a point has the name of the edge that starts at it.

    The bottom of notch i is the edge ``notch i``. ``mirror`` is -1 if directions in the frame of the wheel run
    clockwise in the frame of the disc, else 1.
    """
    radius, half, bottom = size.disc_radius_mm, size.notch_half_mm, size.notch_bottom_mm
    half_notch_rad = math.asin(half / radius)
    # The notches, counter-clockwise around the disc. After the last one comes the first again.
    directions = sorted((mirror * angle, tie) for tie, angle in enumerate(size.tie_angles_rad))
    first_angle, first_tie = directions[0]
    outline: dict[str, Point] = {}
    for (angle, tie), (next_angle, _) in pairwise([*directions, (first_angle + 2 * math.pi, first_tie)]):
        cos, sin = math.cos(angle), math.sin(angle)
        # The corners of the notch's bottom lie in the notch's direction and half its width to both sides of it.
        outline[f"notch {tie}"] = (cos * bottom + sin * half, sin * bottom - cos * half)
        outline[f"wall a {tie}"] = (cos * bottom - sin * half, sin * bottom + cos * half)
        # From this notch to the next, the outline follows the circle.
        start, end = angle + half_notch_rad, next_angle - half_notch_rad
        steps = arc_steps(radius, end - start)
        points = on_circle(radius, (start + (end - start) * step / steps for step in range(steps + 1)))
        names = [*(f"arc {tie} {step}" for step in range(steps)), f"wall b {tie}"]
        outline |= dict(zip(names, points, strict=True))
    return outline


# The number of boxes that model the tyre's ring.
TYRE_BOXES = 48


def _add_horn(shape: Shape, size: WheelSize) -> None:
    """Mount the horn on the side of the inner disc that faces the car, with screws from outside.

    z of the inner disc's frame points outwards, away from the car.
    """
    horn, parts = shape.parts.horn, shape.parts
    # The horn's outer face lies on the disc's lower surface.
    disc_bottom_z, hub_top_z = -size.film_mm / 2, size.film_mm / 2 + size.film_mm
    x0, y0, x1, y1 = horn.extent_mm
    center = ((x0 + x1) / 2, (y0 + y1) / 2, disc_bottom_z - horn.height_mm.value / 2)
    box_mm, solids = (x1 - x0, y1 - y0, horn.height_mm.value), _horn_solids(shape.parts, center)
    shape.box(horn.name, "horn", "inner", translation(*center), box_mm, horn.mass_kg.value, solids=solids)
    # The centre screw's head lies in a recess of the horn. The screws of the wheel have theirs on the hub's layer, which
    # is glued onto the disc.
    recess = translation(0, 0, disc_bottom_z - horn.recess_depth_mm.value)
    add_screw(shape, parts.centre_screw, "centre screw", "inner", recess, grip_mm=0.0)
    for number, (x, y) in enumerate(wheel_screws_mm(horn), 1):
        on_hub = translation(x, y, hub_top_z)
        add_screw(shape, parts.horn_screw, f"wheel screw {number}", "inner", on_hub, grip_mm=0.0)


def _horn_solids(parts: Catalogue, center: tuple[float, float, float]) -> list[Solid]:
    """Return the hub of the horn, and its arms or disc, as solids in the frame of the horn's box.

    The horn's axis is at the origin of its own frame, in which ``center`` is the middle of the box. z points outwards.
    """
    horn, screw_mm = parts.horn, parts.horn_screw.diameter_mm.value
    axis_x, axis_y = -center[0], -center[1]
    top, hub_mm, recess_mm = horn.height_mm.value / 2, horn.hub_diameter_mm.value, horn.recess_diameter_mm.value
    # The hub is three cylinders, from the servo outwards: one around the spline, a floor for the centre screw's head, and
    # one around the recess for this head.
    floor_z, recess_z = -top + horn.spline_depth_mm.value, top - horn.recess_depth_mm.value
    solids = [
        cylinder(hub_mm, -top, floor_z, axis_x, axis_y, bore_mm=parts.servo.spline_diameter_mm.value),
        cylinder(hub_mm, floor_z, recess_z, axis_x, axis_y, bore_mm=horn.centre_hole_mm.value),
        cylinder(hub_mm, recess_z, top, axis_x, axis_y, bore_mm=recess_mm),
    ]
    # Arms and disc are flush with the hub's outer face. The screws cut their thread into them, so they have a bore as
    # wide as the screw.
    arm_height = horn.thickness_mm.value
    arm_middle = translation(axis_x, axis_y, (horn.height_mm.value - arm_height) / 2)
    recess_bore = (0.0, 0.0, recess_mm)
    screws = wheel_screws_mm(horn)
    if horn.disc_diameter_mm:
        disc_mm = horn.disc_diameter_mm.value
        screw_bores = [(x, y, screw_mm) for x, y in screws]
        solids.append(Solid("cylinder", (disc_mm, disc_mm, arm_height), arm_middle, (recess_bore, *screw_bores)))
    if horn.arms:
        for angle_deg, reach in zip(horn.arms.at_deg, horn.arms.reach_mm, strict=True):
            # An arm's frame: x along it, the origin in its middle. The horn's axis is at its end.
            turn = rotation("z", math.radians(angle_deg))
            bores = [(-reach / 2, 0.0, recess_mm)]
            for screw in screws:
                x, y, _ = apply(inverse(turn), *screw)
                bores.append((x - reach / 2, y, screw_mm))
            pose = compose(arm_middle, turn, translation(reach / 2, 0, 0))
            solids.append(Solid("box", (reach, horn.arms.width_mm, arm_height), pose, tuple(bores)))
    return solids


def _add_tyre(shape: Shape, size: WheelSize) -> None:
    """Add the tyre: a ring of boxes over both discs and the rim."""
    tyre = shape.parts.tyre
    width, thickness = tyre.running_width_mm(size.width_mm), tyre.thickness_mm.value
    # Each box touches the circle through the middle of the tyre, and meets its neighbours there.
    angle = 2 * math.pi / TYRE_BOXES
    middle_radius = size.disc_radius_mm + thickness / 2
    box_mm = (thickness, 2 * middle_radius * math.tan(angle / 2), width)
    solids = []
    for number in range(TYRE_BOXES):
        box_pose = compose(rotation("z", number * angle), translation(middle_radius, 0, 0))
        solids.append(Solid("box", box_mm, box_pose))
    # The wheel's centre in the frame of the inner disc.
    pose = translation(0, 0, (size.width_mm - size.film_mm) / 2)
    size_mm, mass_kg = (2 * size.radius_mm, 2 * size.radius_mm, width), tyre.mass_kg(size.radius_mm, size.width_mm)
    shape.box(tyre.name, "tyre", "inner", pose, size_mm, mass_kg, solids=solids)
