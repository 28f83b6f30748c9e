"""Checks that no film passes through other film when the car is folded, except through slots.

Input: placed faces of one body. Output: findings.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.model import FoldedCar, HingeJoint, Pose
from foldcar.car.folded.placed import Finding, PlacedFace
from foldcar.car.folded.pose import apply, compose, rotation, translation

# Faces are shrunk by this before they are intersected, so that faces that meet at an edge do not cross.
SHRINK_MM = 0.3
LEAST_MM = 0.2
PARALLEL = 1e-3
TOUCH_MM = 1e-6
# Layers lie on each other closer than their thickness by less than this.
LAYER_MM = 0.01
LEAST_MM2 = 0.2


def check_crossings(faces: Sequence[PlacedFace]) -> Iterator[Finding]:
    """A finding for each pair of faces that cross."""
    for one, other, length in crossings(faces, faces):
        yield Finding("crossing", one.title, f"runs through {other.title} over {length:.2f} mm")


def check_layers(faces: Sequence[PlacedFace]) -> Iterator[Finding]:
    """A finding for each pair of parallel faces of which one lies in the other's film."""
    for one, other, area in layers(faces):
        yield Finding("crossing", one.title, f"lies in the film of {other.title} over {area:.1f} mm²")


def layers(faces: Sequence[PlacedFace]) -> Iterator[tuple[PlacedFace, PlacedFace, float]]:
    """Pairs of parallel faces that overlap closer than their films are thick, and the area of it (mm²)."""
    low, high = (np.array([pick(face.corners_mm, axis=0) for face in faces]) for pick in (np.min, np.max))
    normals = np.array([face.normal for face in faces])
    thickest = max(face.piece.thickness_mm for face in faces)
    for i, face in enumerate(faces):
        near = (low <= high[i] + thickest).all(axis=1) & (high >= low[i] - thickest).all(axis=1)
        near &= np.linalg.norm(np.cross(normals, face.normal), axis=1) <= PARALLEL
        near[: i + 1] = False
        for k in np.flatnonzero(near):
            other = faces[int(k)]
            local = face.in_face(other.corners_mm)
            apart = (face.piece.thickness_mm + other.piece.thickness_mm) / 2
            if float(np.abs(local[:, 2]).max()) > apart - LAYER_MM:
                continue
            shape = shapely.Polygon(local[:, :2]).buffer(-SHRINK_MM)
            area = shape.intersection(face.polygon.buffer(-SHRINK_MM)).area
            if area > LEAST_MM2:
                yield face, other, float(area)


def crossings(
    first: Sequence[PlacedFace], second: Sequence[PlacedFace]
) -> Iterator[tuple[PlacedFace, PlacedFace, float]]:
    """Pairs of crossing faces, one of each group, and the crossing's length (mm); each pair once within one group."""
    if not first or not second:
        return
    low, high = (np.array([pick(face.corners_mm, axis=0) for face in second]) for pick in (np.min, np.max))
    normals = np.array([face.normal for face in second])
    for i, face in enumerate(first):
        corners = face.corners_mm
        near = (low <= corners.max(axis=0) + TOUCH_MM).all(axis=1) & (high >= corners.min(axis=0) - TOUCH_MM).all(axis=1)
        near &= np.linalg.norm(np.cross(normals, face.normal), axis=1) > PARALLEL
        if first is second:
            near[: i + 1] = False
        for k in np.flatnonzero(near):
            other = second[int(k)]
            length = _crossing_mm(face, other)
            if length > LEAST_MM:
                yield face, other, length


def _crossing_mm(a: PlacedFace, b: PlacedFace) -> float:
    """Length of the line along which the interiors of two faces cross (mm)."""
    heights_a, heights_b = b.in_face(a.corners_mm)[:, 2], a.in_face(b.corners_mm)[:, 2]
    # A face that lies on one side of the other's plane cannot cross it.
    if any(np.min(h) > -SHRINK_MM or np.max(h) < SHRINK_MM for h in (heights_a, heights_b)):
        return 0.0
    direction: NDArray[np.float64] = np.cross(a.normal, b.normal).astype(np.float64)
    direction /= np.linalg.norm(direction)
    # A point that lies in both planes.
    origin_a, origin_b = a.matrix[:3, 3], b.matrix[:3, 3]
    equations = np.array([a.normal, b.normal, direction])
    values = np.array([a.normal @ origin_a, b.normal @ origin_b, direction @ origin_a])
    through = np.linalg.solve(equations, values)
    first, second = (_inside(face, through, direction) for face in (a, b))
    return float(shapely.length(shapely.intersection(first, second)))


def _inside(face: PlacedFace, through: NDArray[np.float64], direction: NDArray[np.float64]) -> shapely.Geometry:
    """The intervals of the line inside the shrunk face, as segments of the x axis (mm)."""
    reach = 2 * float(np.abs(face.corners_mm - through).max()) + 10
    ends = face.in_face(np.array([through - reach * direction, through + reach * direction]))[:, :2]
    line = shapely.LineString(ends)
    shape = face.polygon.buffer(-SHRINK_MM)
    parts = shapely.get_parts(line.intersection(shape))
    # Distances along the line from ``through``, which is the same point for both faces.
    spans = [
        [(line.project(shapely.Point(part.coords[i])) - reach, 0.0) for i in (0, -1)] for part in parts if part.length > 0
    ]
    return shapely.union_all([shapely.LineString(span) for span in spans])


def check_hinges(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], wheel_distance_mm: float
) -> Iterator[Finding]:
    """Findings for each hinge at both limits, all others flat; hinge strips bend and are not checked.

    Wheels must stay ``wheel_distance_mm`` apart.
    """
    strips = {piece.name for piece in car.pieces if any(crease.flexure for crease in piece.creases)}
    for hinge in car.hinges:
        front, rear = (
            [face for face in bodies[body] if face.piece.name not in strips] for body in (hinge.front, hinge.rear)
        )
        for angle in (hinge.min_rad, hinge.max_rad):
            turn = folded_back(hinge, angle)
            moved = [replace(face, pose=compose(turn, face.pose)) for face in rear]
            place = f"between {hinge.front} and {hinge.rear}, folded by {math.degrees(angle):.1f} degrees"
            for one, other, length in crossings(front, moved):
                yield Finding("hinge", place, f"{one.title} runs through {other.title} over {length:.2f} mm")
            yield from _wheels(car, hinge, turn, place, wheel_distance_mm)


def folded_back(hinge: HingeJoint, angle_rad: float) -> Pose:
    """The rear segment's motion in the front one's frame (mm); a positive angle is the front segment nose up."""
    x, y, z = hinge.center_mm
    return compose(translation(x, y, z), rotation("y", angle_rad), translation(-x, -y, -z))


def _wheels(car: FoldedCar, hinge: HingeJoint, turn: Pose, place: str, distance_mm: float) -> Iterator[Finding]:
    for front in (axle for axle in car.axles if axle.body == hinge.front):
        for rear in (axle for axle in car.axles if axle.body == hinge.rear and axle.side == front.side):
            x, _, z = apply(turn, *rear.center_mm)
            gap = math.hypot(x - front.center_mm[0], z - front.center_mm[2]) - front.radius_mm - rear.radius_mm
            if gap < distance_mm - 1e-6:
                yield Finding(
                    "hinge", place, f"{front.wheel} is {gap:.2f} mm from {rear.wheel}, the limit is {distance_mm:g} mm"
                )
