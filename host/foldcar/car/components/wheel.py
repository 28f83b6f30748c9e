"""A wheel: a spool of two discs on a hub, rim strips hooked around it, the horn, its screws and the tyre.

The wheel's frame has its origin at the wheel's centre and y along the axle, outwards on the left side. The discs' edges
are the running circle, the tyre lies over them.
"""

import math

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.dimensions import RADIUS
from foldcar.car.components.hub import EVEN_MM, build_hub
from foldcar.car.components.rim_strip import build_rim, facet_pose, notch_mm, tie_angles_rad
from foldcar.car.components.wheel_parts import add_wheel_parts
from foldcar.car.components.wheel_size import WheelSize, wheel_screws_mm
from foldcar.car.folded.model import Point, Pose
from foldcar.car.folded.pose import compose, inverse, rotation, translation

TYRE_WIDTH = Parameter(
    "tire_thickness", 12, 8, 40, "width of a wheel, from outside to outside of its discs", "the tongues of its rim"
)


class Wheel(Component):
    """Two discs, a hub and a rim; the servo's horn is screwed to the inner disc."""

    parameters = (RADIUS, TYRE_WIDTH)

    def build(self, shape: Shape) -> None:
        """Faces ``inner``, ``outer``, ``hub``, ``wall 1`` … and ``rim 0 0`` …"""
        size = WheelSize(self["radius"], self["tire_thickness"], self.parts)
        poses = self._discs(shape, size)
        build_hub(shape, size)
        self._holes(shape, size)
        build_rim(shape, size)
        for strip in range(size.strips):
            angle = tie_angles_rad(size)[strip * size.ties]
            at = facet_pose(size, size.rim.apothem_mm, size.rim.facet_mm, angle)
            shape.place(f"rim {strip} 0", "inner", compose(inverse(poses["inner"]), at))
        shape.place("outer", "inner", compose(inverse(poses["inner"]), poses["outer"]))
        add_wheel_parts(shape, size)
        shape.begin_at("inner", poses["inner"])

    def _discs(self, shape: Shape, size: WheelSize) -> dict[str, Pose]:
        """The faces of the discs, drawn as seen from inside the wheel, and their poses in the wheel's frame."""
        out = (size.width_mm - size.film_mm) / 2
        for name, mirror in (("inner", -1), ("outer", 1)):
            points, names = _disc(size, mirror)
            shape.face(name, points, names, piece=f"wheel {name} disc")
        return {
            "inner": compose(translation(0, -out, 0), rotation("x", -math.pi / 2)),
            "outer": compose(translation(0, out, 0), rotation("x", math.pi / 2)),
        }

    def _holes(self, shape: Shape, size: WheelSize) -> None:
        """Holes for the horn's screws in the inner disc and the hub's layer on it, and the access to them."""
        assembly, horn = self.parts.assembly, self.parts.horn
        for face in ("inner", "hub"):
            shape.round_hole(face, f"{face}.hub", "axle", (0, 0), horn.recess_diameter_mm.value)
            for i, center in enumerate(wheel_screws_mm(horn)):
                # Slots towards the axle, for horns whose holes lie nearer to it or farther from it.
                screw, off = self.parts.horn_screw.diameter_mm, horn.wheel_screws.tolerance
                wide, far = screw.value + screw.tolerance + 2 * assembly.cut_mm.value, math.hypot(*center)
                near, out = ((center[0] * share, center[1] * share) for share in (1 - off / far, 1 + off / far))
                shape.slotted_hole(face, f"{face}.horn screw {i + 1}", "screw", near, out, wide)
        shape.round_hole("outer", "outer.access", "opening", (0, 0), 2 * size.access_radius_mm)


def _disc(size: WheelSize, mirror: int) -> tuple[list[Point], list[str]]:
    """The outline of a disc with a notch for each tie: the bottom of notch i is the edge ``notch i``.

    ``mirror`` is -1 if directions in the wheel's frame run clockwise in the disc's.
    """
    radius, (half, bottom) = size.disc_radius_mm, notch_mm(size)
    ties = tie_angles_rad(size)
    order = sorted(range(len(ties)), key=lambda i: mirror * ties[i])
    opening = math.asin(half / radius)
    points: list[Point] = []
    names: list[str] = []
    for place, tie in enumerate(order):
        angle = mirror * ties[tie]
        following = mirror * ties[order[(place + 1) % len(order)]] + (0.0 if place + 1 < len(order) else 2 * math.pi)
        c, s = math.cos(angle), math.sin(angle)
        points += [(c * x - s * y, s * x + c * y) for x, y in ((bottom, -half), (bottom, half))]
        names += [f"notch {tie}", f"wall a {tie}"]
        start, end = angle + opening, following - opening
        steps = math.ceil((end - start) / 2 / math.acos(1 - EVEN_MM / radius))
        for i in range(steps + 1):
            at = start + (end - start) * i / steps
            points.append((radius * math.cos(at), radius * math.sin(at)))
            names.append(f"arc {tie} {i}" if i < steps else f"wall b {tie}")
    return points, names
