"""Checks of parts and wheels in the folded car: nothing overlaps, wheels turn freely.

Input: a car and its placed faces. Output: findings.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import Axle, FoldedCar, Mount
from foldcar.car.folded.placed import PlacedFace

# Parts may touch: overlaps of boxes up to this depth are contact.
TOUCH_MM = 0.1
# Film gives way: an area of a face inside a part up to this is contact.
FILM_MM2 = 0.5
# Screws fit with a part's holes off by this.
FIT_MM = 0.3


def check_parts(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], soft: str, wheel_distance_mm: float
) -> Iterator[Finding]:
    """Findings about parts and wheels. Parts named ``soft`` are ignored; tyres must be ``wheel_distance_mm`` apart."""
    firm = [mount for mount in car.mounts if mount.part != soft and mount.body.startswith("segment")]
    for one, other in itertools.combinations(firm, 2):
        depth = _depth_mm(one, other)
        if depth > TOUCH_MM:
            yield Finding("parts", one.name, f"runs {depth:.2f} mm into {other.name}")
    for mount in firm:
        for face in bodies.get(mount.body, ()):
            area = _film_inside_mm2(mount, face)
            if area > FILM_MM2:
                yield Finding("parts", mount.name, f"is cut by {area:.1f} mm² of {face.title}")
        yield from _holes(mount, bodies.get(mount.body, ()))
    yield from _wheels(car, bodies, firm, wheel_distance_mm)


def _box(mount: Mount) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    pose = np.array(mount.pose)
    return pose[:3, 3], pose[:3, :3], np.array(mount.size_mm) / 2


def _depth_mm(one: Mount, other: Mount) -> float:
    """Depth (mm) by which two boxes overlap (separating-axis theorem), negative if they are apart."""
    (c1, r1, h1), (c2, r2, h2) = _box(one), _box(other)
    between = c2 - c1
    axes = [*r1.T, *r2.T, *(np.cross(a, b) for a in r1.T for b in r2.T)]
    depth = np.inf
    for axis in axes:
        length = np.linalg.norm(axis)
        if length > 1e-9:
            axis = axis / length
            reach = np.abs(r1.T @ axis) @ h1 + np.abs(r2.T @ axis) @ h2
            depth = min(depth, reach - abs(between @ axis))
    return float(depth)


def _film_inside_mm2(mount: Mount, face: PlacedFace) -> float:
    """The area (mm²) of a face, without holes, inside a box slightly smaller than the part."""
    center, turn, half = _box(mount)
    half = half - TOUCH_MM - face.piece.thickness_mm / 2
    corners = (face.corners_mm - center) @ turn
    if (corners.min(axis=0) > half).any() or (corners.max(axis=0) < -half).any():
        return 0.0
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    points = face.in_face(signs * half @ turn.T + center)
    # Points where the box's edges pass the face's plane; an edge joins two corners that differ in one sign.
    section = []
    for i, k in itertools.combinations(range(8), 2):
        a, b = points[i], points[k]
        if np.abs(signs[i] - signs[k]).sum() == 2 and a[2] * b[2] < 0:
            section.append((a + (b - a) * a[2] / (a[2] - b[2]))[:2])
    if len(section) < 3:
        return 0.0
    return float(shapely.MultiPoint(section).convex_hull.intersection(face.polygon).area)


def _holes(mount: Mount, faces: Sequence[PlacedFace]) -> Iterator[Finding]:
    """Findings if a part's holes are missing or their centre is not under the part's."""
    found = {hole.name: (face, hole) for face in faces for hole in face.face.holes}
    middles = []
    for name in mount.holes:
        if name not in found:
            yield Finding("parts", mount.name, f"there is no hole {name}")
            return
        face, hole = found[name]
        center, _, _ = _box(mount)
        x, y = shapely.Polygon(hole.outline_mm).centroid.coords[0]
        middles.append(np.array((x, y)) - face.in_face(center[None])[0, :2])
    if middles:
        off = float(np.linalg.norm(np.mean(middles, axis=0)))
        if off > FIT_MM:
            yield Finding("parts", mount.name, f"is {off:.2f} mm off the middle of its holes, the limit is {FIT_MM:g} mm")


def _wheels(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], firm: Sequence[Mount], distance_mm: float
) -> Iterator[Finding]:
    for one, other in itertools.combinations(car.axles, 2):
        widths = (one.tyre_width_mm + other.tyre_width_mm) / 2
        if abs(one.center_mm[1] - other.center_mm[1]) >= widths:
            continue
        gap = float(np.hypot(one.center_mm[0] - other.center_mm[0], one.center_mm[2] - other.center_mm[2]))
        gap -= one.radius_mm + other.radius_mm
        if gap < distance_mm - 1e-6:
            yield Finding("wheels", one.wheel, f"is {gap:.2f} mm from {other.wheel}, the limit is {distance_mm:g} mm")
    for axle in car.axles:
        for face in (face for faces in bodies.values() for face in faces if face.body.startswith("segment")):
            if _reaches(axle, face.corners_mm):
                yield Finding("wheels", axle.wheel, f"runs into {face.title}")
        for mount in firm:
            center, turn, half = _box(mount)
            signs = np.array(list(itertools.product((-1, 1), repeat=3)))
            if _reaches(axle, signs * half @ turn.T + center):
                yield Finding("wheels", axle.wheel, f"runs into {mount.name}")


def _reaches(axle: Axle, corners: NDArray[np.float64]) -> bool:
    """Whether the convex hull of the corners, (n, 3) in mm, intersects the wheel's cylinder."""
    across = np.abs(corners[:, 1] - axle.center_mm[1])
    same_side = np.ptp(np.sign(corners[:, 1] - axle.center_mm[1])) == 0
    if same_side and across.min() >= axle.tyre_width_mm / 2 - 1e-6:
        return False
    outline = shapely.MultiPoint(corners[:, [0, 2]]).convex_hull
    return bool(outline.distance(shapely.Point(axle.center_mm[0], axle.center_mm[2])) < axle.radius_mm)
