"""A wheel: a spool of two discs on a hub, rim strips hooked around it, the horn, its screws and the tyre.

The wheel's frame has its origin at the wheel's centre and y along the axle, outwards on the left side. The discs' edges
are the running circle, the tyre lies over them. Bought parts are placed in the frame of the inner disc, whose z points
from the car outwards along the axle.
"""

import math
from itertools import pairwise

from foldcar.car.components.component import Component, Parameter
from foldcar.car.components.hooked_strip import (
    EVEN_MM,
    WheelSize,
    access_radius_mm,
    build_hub,
    build_rim,
    first_facet_pose,
    min_radius_mm,
    wheel_screws_mm,
)
from foldcar.car.components.mounts import add_screw, cylinder, wheel_hole_mm
from foldcar.car.components.shape import Shape, on_circle
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
        """Add the faces ``inner``, ``outer``, ``hub``, ``wall 1`` … and ``rim 0 0`` …, the holes for horn or rod,
        and the tyre.
        """
        size = WheelSize(self["radius"], self["tire_thickness"], self.parts)
        # The discs are drawn as seen from inside the wheel.
        for name, mirror in (("inner", -1), ("outer", 1)):
            shape.face(name, _disc_outline(size, mirror), piece=f"wheel {name} disc")
        # In the wheel's frame y is the axle. z of both discs points into the wheel.
        out = (size.width_mm - size.film_mm) / 2
        poses = {
            "inner": compose(translation(0, -out, 0), rotation("x", -math.pi / 2)),
            "outer": compose(translation(0, out, 0), rotation("x", math.pi / 2)),
        }
        build_hub(shape, size)
        if self["driven"]:
            self._cut_holes(shape, size)
        else:
            for face in ("inner", "hub", "outer"):
                shape.round_hole(face, f"{face}.rod", "axle", (0, 0), wheel_hole_mm(self.parts))
        build_rim(shape, size)
        for strip in range(size.strips):
            shape.place(f"rim {strip} 0", "inner", compose(inverse(poses["inner"]), first_facet_pose(size, strip)))
        shape.place("outer", "inner", compose(inverse(poses["inner"]), poses["outer"]))
        if self["driven"]:
            _add_horn(shape, size)
        if self.parts.tyre.thickness_mm.value > 0:
            _add_tyre(shape, size)
        shape.begin_at("inner", poses["inner"])

    def _cut_holes(self, shape: Shape, size: WheelSize) -> None:
        """Cut the holes for the horn's screws into inner disc and hub, and the hole for the driver into the outer
        disc.
        """
        assembly, horn = self.parts.assembly, self.parts.horn
        for face in ("inner", "hub"):
            shape.round_hole(face, f"{face}.hub", "axle", (0, 0), horn.recess_diameter_mm.value)
            for i, center in enumerate(wheel_screws_mm(horn)):
                # Slots towards the axle, for horns whose holes lie nearer to it or farther from it.
                position_tolerance, distance = horn.wheel_screws.tolerance, math.hypot(*center)
                width = self.parts.horn_screw.diameter_mm.max_value + 2 * assembly.cut_mm.value
                inner, outer = (
                    (center[0] * scale, center[1] * scale)
                    for scale in (1 - position_tolerance / distance, 1 + position_tolerance / distance)
                )
                shape.slotted_hole(face, f"{face}.horn screw {i + 1}", "screw", inner, outer, width)
        shape.round_hole("outer", "outer.access", "opening", (0, 0), 2 * access_radius_mm(self.parts))


def _disc_outline(size: WheelSize, mirror: int) -> dict[str, Point]:
    """Return the outline of a disc with a notch for each tie; a point has the name of the edge that starts at it.

    The bottom of notch i is the edge ``notch i``. ``mirror`` is -1 if directions in the frame of the wheel run
    clockwise in the frame of the disc, else 1.
    """
    radius, (notch_half, notch_bottom) = size.disc_radius_mm, size.notch_mm
    notch_angle = math.asin(notch_half / radius)
    directions = sorted((mirror * angle, tie) for tie, angle in enumerate(size.tie_angles_rad))
    outline: dict[str, Point] = {}
    for (angle, tie), (next_angle, _) in pairwise([*directions, (directions[0][0] + 2 * math.pi, 0)]):
        cos, sin = math.cos(angle), math.sin(angle)
        outline[f"notch {tie}"] = (cos * notch_bottom + sin * notch_half, sin * notch_bottom - cos * notch_half)
        outline[f"wall a {tie}"] = (cos * notch_bottom - sin * notch_half, sin * notch_bottom + cos * notch_half)
        start, end = angle + notch_angle, next_angle - notch_angle
        steps = math.ceil((end - start) / 2 / math.acos(1 - EVEN_MM / radius))
        points = on_circle(radius, (start + (end - start) * i / steps for i in range(steps + 1)))
        names = [*(f"arc {tie} {i}" for i in range(steps)), f"wall b {tie}"]
        outline |= dict(zip(names, points, strict=True))
    return outline


# The number of boxes that model the tyre's ring.
TYRE_BOXES = 48


def _add_horn(shape: Shape, size: WheelSize) -> None:
    """Mount the horn on the side of the inner disc that faces the car, with screws from outside."""
    horn, parts = shape.parts.horn, shape.parts
    film_bottom = -size.film_mm / 2
    x0, y0, x1, y1 = horn.extent_mm
    center = ((x0 + x1) / 2, (y0 + y1) / 2, film_bottom - horn.height_mm.value / 2)
    box_mm, solids = (x1 - x0, y1 - y0, horn.height_mm.value), _horn_solids(shape.parts, center)
    shape.box(horn.name, "horn", "inner", translation(*center), box_mm, horn.mass_kg.value, solids=solids)
    seat = translation(0, 0, film_bottom - horn.recess_depth_mm.value)
    add_screw(shape, parts.centre_screw, "centre screw", "inner", seat, 0.0)
    for i, (x, y) in enumerate(wheel_screws_mm(horn)):
        # On the hub's layer.
        seat = translation(x, y, -film_bottom + size.film_mm)
        add_screw(shape, parts.horn_screw, f"wheel screw {i + 1}", "inner", seat, 0.0)


def _horn_solids(parts: Catalogue, center: tuple[float, float, float]) -> list[Solid]:
    """Return the hub of the horn, and its arms or disc, as solids in the frame of its box, whose middle is at
    ``center``.
    """
    horn, screw_mm = parts.horn, parts.horn_screw.diameter_mm.value
    x, y, _ = center
    height, arm_height, recess = horn.height_mm.value, horn.thickness_mm.value, horn.recess_depth_mm.value
    hub_mm, recess_mm = horn.hub_diameter_mm.value, horn.recess_diameter_mm.value
    # From the servo outwards: around the spline, a floor for the centre screw's head, a recess for it.
    ends = (-height / 2, -height / 2 + horn.spline_depth_mm.value, height / 2 - recess, height / 2)
    bores = (parts.servo.spline_diameter_mm.value, horn.centre_hole_mm.value, recess_mm)
    layers = zip(ends, ends[1:], bores, strict=False)
    solids = [cylinder(hub_mm, low, high, -x, -y, bore_mm=bore) for low, high, bore in layers]
    # Arms and disc are flush with the hub's outer face; the screws cut their way into them.
    at_z = (height - arm_height) / 2
    screws = wheel_screws_mm(horn)
    if horn.disc_diameter_mm:
        disc = horn.disc_diameter_mm.value
        holes = ((0.0, 0.0, recess_mm), *((screw_x, screw_y, screw_mm) for screw_x, screw_y in screws))
        solids.append(Solid("cylinder", (disc, disc, arm_height), translation(-x, -y, at_z), holes))
    if horn.arms:
        for angle, reach in zip(horn.arms.at_deg, horn.arms.reach_mm, strict=True):
            turn = rotation("z", math.radians(angle))
            # An arm's frame: x along it, the origin in its middle.
            in_arm = (apply(inverse(turn), *point) for point in screws)
            screw_holes = ((screw_x - reach / 2, screw_y, screw_mm) for screw_x, screw_y, _ in in_arm)
            holes = ((-reach / 2, 0.0, recess_mm), *screw_holes)
            pose = compose(translation(-x, -y, at_z), turn, translation(reach / 2, 0, 0))
            solids.append(Solid("box", (reach, horn.arms.width_mm, arm_height), pose, holes))
    return solids


def _add_tyre(shape: Shape, size: WheelSize) -> None:
    """Add the tyre: a ring of boxes over both discs and the rim."""
    tyre = shape.parts.tyre
    width, thickness = tyre.running_width_mm(size.width_mm), tyre.thickness_mm.value
    step = 2 * math.pi / TYRE_BOXES
    mean_radius = size.disc_radius_mm + thickness / 2
    box = (thickness, 2 * mean_radius * math.tan(step / 2), width)
    poses = (compose(rotation("z", i * step), translation(mean_radius, 0, 0)) for i in range(TYRE_BOXES))
    solids = [Solid("box", box, pose) for pose in poses]
    pose, size_mm = translation(0, 0, (size.width_mm - size.film_mm) / 2), (2 * size.radius_mm, 2 * size.radius_mm, width)
    shape.box(tyre.name, "tyre", "inner", pose, size_mm, tyre.mass_kg(size.radius_mm, size.width_mm), solids=solids)
