"""A wheel: a spool of two discs on a hub, rim strips hooked around it, the horn, its screws and the tyre.

The wheel's frame has its origin at the wheel's centre and y along the axle, outwards on the left side. The discs' edges
are the running circle, the tyre lies over them. Bought parts are placed in the frame of the inner disc, whose z points
from the car outwards along the axle.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

from foldcar.car.components.component import Component, Parameter
from foldcar.car.components.hooked_strip import build_hub, build_rim, first_facet_pose
from foldcar.car.components.mounts import add_screw, cylinder
from foldcar.car.components.rods import wheel_hole_mm
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

        The discs are the faces ``inner`` and ``outer``. In the wheel's frame, y points along the axle from the inner disc
        to the outer one. z of each disc's frame points along the axle into the wheel.
        """
        size = WheelSize(self["radius"], self["tire_thickness"], self.parts)
        # The discs face each other. So the same direction around the axle has opposite angles in their frames.
        outer_angles = size.tie_angles_rad
        inner_angles = [-angle for angle in outer_angles]
        shape.face("inner", _disc_outline(size, inner_angles), piece="wheel inner disc")
        shape.face("outer", _disc_outline(size, outer_angles), piece="wheel outer disc")
        build_hub(shape, size)
        if self["driven"]:
            self._cut_holes(shape, size)
        else:
            for face in ("inner", "hub", "outer"):
                shape.round_hole(face, f"{face}.rod", "axle", (0, 0), wheel_hole_mm(self.parts))
        build_rim(shape, size)
        # The poses of the discs in the wheel's frame, and those of outer disc and rim in the inner disc's frame.
        disc_y = (size.width_mm - size.film_mm) / 2
        inner_pose = compose(translation(0, -disc_y, 0), rotation("x", -math.pi / 2))
        outer_pose = compose(translation(0, disc_y, 0), rotation("x", math.pi / 2))
        wheel_in_inner = inverse(inner_pose)
        for strip in range(size.strips):
            shape.place(f"rim {strip} 0", "inner", compose(wheel_in_inner, first_facet_pose(size, strip)))
        shape.place("outer", "inner", compose(wheel_in_inner, outer_pose))
        # Bought parts.
        if self["driven"]:
            _add_horn(shape, size)
        if self.parts.tyre.thickness_mm.value > 0:
            _add_tyre(shape, size)
        shape.begin_at("inner", inner_pose)

    def _cut_holes(self, shape: Shape, size: WheelSize) -> None:
        """Cut the holes of the wheel, which is screwed to the servo's horn.

        The inner disc and the hub get slots for the horn's screws and a hole around the axle. The outer disc gets an
        opening through which a screwdriver reaches the screws.
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


def _disc_outline(size: WheelSize, tie_angles_rad: Sequence[float]) -> dict[str, Point]:
    """Return the outline of a disc: a circle around the axle with a notch for each *tie*, a hook of the rim.

    The outline runs counter-clockwise in the disc's frame, whose origin is on the axle. ``tie_angles_rad`` has the
    directions of the ties in this frame. Each point has the name of the edge that starts at it. The bottom of the notch
    for tie 0 is the edge ``notch 0``.
    """
    radius = size.disc_radius_mm
    half_notch_rad = math.asin(size.notch_half_mm / radius)
    # The ties in the order of the outline. After the last one comes the first again.
    angles_with_ties = sorted((angle, tie) for tie, angle in enumerate(tie_angles_rad))
    first_angle, first_tie = angles_with_ties[0]
    angles_with_ties.append((first_angle + 2 * math.pi, first_tie))
    outline: dict[str, Point] = {}
    for (angle, tie), (next_angle, _) in pairwise(angles_with_ties):
        bottom_start, bottom_end = _notch_bottom(size, angle)
        outline[f"notch {tie}"] = bottom_start
        outline[f"wall a {tie}"] = bottom_end
        # The arc from this notch to the next one, in short steps. The last point is the upper corner of the next notch.
        arc_start, arc_end = angle + half_notch_rad, next_angle - half_notch_rad
        steps = arc_steps(radius, arc_end - arc_start)
        arc_angles = [arc_start + (arc_end - arc_start) * step / steps for step in range(steps + 1)]
        *arc_points, next_corner = on_circle(radius, arc_angles)
        for step, point in enumerate(arc_points):
            outline[f"arc {tie} {step}"] = point
        outline[f"wall b {tie}"] = next_corner
    return outline


def _notch_bottom(size: WheelSize, angle_rad: float) -> tuple[Point, Point]:
    """Return the two ends of the bottom of a notch, in counter-clockwise order. ``angle_rad`` is the notch's direction.

    The bottom is a straight line across this direction, whose middle has the distance ``notch_bottom_mm`` from the axle.
    """
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    half_width, bottom = size.notch_half_mm, size.notch_bottom_mm
    start = (cos * bottom + sin * half_width, sin * bottom - cos * half_width)
    end = (cos * bottom - sin * half_width, sin * bottom + cos * half_width)
    return start, end


# The number of boxes that model the tyre's ring.
TYRE_BOXES = 48


def _add_horn(shape: Shape, size: WheelSize) -> None:
    """Mount the servo's horn on the side of the inner disc that faces the car, and add the screws that hold it.

    The origin of the inner disc's frame is on the axle, in the middle of the film. z points outwards, away from the car.
    None of the screws has a nut, so their grips are 0.
    """
    horn, parts, film = shape.parts.horn, shape.parts, size.film_mm
    # The horn's outer face lies on the disc's surface that faces the car.
    horn_top_z = -film / 2
    extent = horn.extent_mm
    middle_x, middle_y = (extent.min_x + extent.max_x) / 2, (extent.min_y + extent.max_y) / 2
    center = (middle_x, middle_y, horn_top_z - horn.height_mm.value / 2)
    box_mm = (extent.max_x - extent.min_x, extent.max_y - extent.min_y, horn.height_mm.value)
    solids = _horn_solids(parts, center)
    shape.box(horn.name, "horn", "inner", translation(*center), box_mm, horn.mass_kg.value, solids=solids)
    # The centre screw holds the horn on the servo. Its head lies in a recess of the horn.
    recess_bottom = translation(0, 0, horn_top_z - horn.recess_depth_mm.value)
    add_screw(shape, parts.centre_screw, "centre screw", "inner", recess_bottom, grip_mm=0.0)
    # Two screws hold the wheel on the horn. Their heads lie on the hub's layer, which is glued onto the disc.
    hub_top_z = film / 2 + film
    for number, (x, y) in enumerate(wheel_screws_mm(horn), 1):
        on_hub = translation(x, y, hub_top_z)
        add_screw(shape, parts.horn_screw, f"wheel screw {number}", "inner", on_hub, grip_mm=0.0)


def _horn_solids(parts: Catalogue, center: tuple[float, float, float]) -> list[Solid]:
    """Return the solids of a servo's horn: its hub on the servo's shaft, and its arms or its disc.

    ``center`` is the middle of the horn's box in a frame whose origin lies on the horn's axis. The solids are given in
    the frame of the box, whose origin is this middle. z points outwards, away from the servo.
    """
    horn, recess_mm = parts.horn, parts.horn.recess_diameter_mm.value
    center_x, center_y, _ = center
    axis = (-center_x, -center_y)
    # Arms and disc are flush with the hub's outer face. They have a bore for the recess, and one for each screw that cuts
    # its thread into them.
    plate_height = horn.thickness_mm.value
    plate_middle = translation(*axis, (horn.height_mm.value - plate_height) / 2)
    screws, screw_mm = wheel_screws_mm(horn), parts.horn_screw.diameter_mm.value
    solids = _horn_hub(parts, axis)
    if horn.disc_diameter_mm:
        disc_mm = horn.disc_diameter_mm.value
        bores = [(0.0, 0.0, recess_mm), *((x, y, screw_mm) for x, y in screws)]
        solids.append(Solid("cylinder", (disc_mm, disc_mm, plate_height), plate_middle, tuple(bores)))
    if horn.arms:
        for angle_deg, reach in zip(horn.arms.at_deg, horn.arms.reach_mm, strict=True):
            # An arm begins at the horn's axis. The origin of its frame is its middle, and x points outwards along it.
            turn = rotation("z", math.radians(angle_deg))
            bores = [(-reach / 2, 0.0, recess_mm)]
            for screw in screws:
                along_arm, across_arm, _ = apply(inverse(turn), *screw)
                bores.append((along_arm - reach / 2, across_arm, screw_mm))
            pose = compose(plate_middle, turn, translation(reach / 2, 0, 0))
            solids.append(Solid("box", (reach, horn.arms.width_mm, plate_height), pose, tuple(bores)))
    return solids


def _horn_hub(parts: Catalogue, axis: Point) -> list[Solid]:
    """Return the hub of a horn as three cylinders around ``axis``, in the frame of the horn's box.

    From the servo outwards, these are a cylinder around the end of the servo's shaft, a floor for the centre screw's
    head, and a cylinder around the recess for this head.
    """
    horn, (x, y) = parts.horn, axis
    hub_mm, top_z = horn.hub_diameter_mm.value, horn.height_mm.value / 2
    floor_z = -top_z + horn.spline_depth_mm.value
    recess_z = top_z - horn.recess_depth_mm.value
    return [
        cylinder(hub_mm, -top_z, floor_z, x, y, bore_mm=parts.servo.spline_diameter_mm.value),
        cylinder(hub_mm, floor_z, recess_z, x, y, bore_mm=horn.centre_hole_mm.value),
        cylinder(hub_mm, recess_z, top_z, x, y, bore_mm=horn.recess_diameter_mm.value),
    ]


def _add_tyre(shape: Shape, size: WheelSize) -> None:
    """Add the tyre over the discs and the rim, modelled as a ring of boxes.

    The boxes are given in the tyre's frame: the origin is its centre, and z points along the axle.
    """
    tyre = shape.parts.tyre
    width, thickness = tyre.running_width_mm(size.width_mm), tyre.thickness_mm.value
    # The middles of the boxes lie on the circle through the middle of the tyre's thickness. Their middle planes form a
    # polygon around this circle, so a box is as long as a side of the polygon.
    step_rad = 2 * math.pi / TYRE_BOXES
    middle_radius = size.disc_radius_mm + thickness / 2
    box_length = 2 * middle_radius * math.tan(step_rad / 2)
    solids = []
    for number in range(TYRE_BOXES):
        box_pose = compose(rotation("z", number * step_rad), translation(middle_radius, 0, 0))
        solids.append(Solid("box", (thickness, box_length, width), box_pose))
    # The wheel's centre in the frame of the inner disc.
    pose = translation(0, 0, (size.width_mm - size.film_mm) / 2)
    size_mm = (2 * size.radius_mm, 2 * size.radius_mm, width)
    mass_kg = tyre.mass_kg(size.radius_mm, size.width_mm)
    shape.box(tyre.name, "tyre", "inner", pose, size_mm, mass_kg, solids=solids)
