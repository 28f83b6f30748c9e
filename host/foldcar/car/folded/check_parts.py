"""Checks of parts in the folded car: nothing overlaps but a screw in a bore, holes lie under their parts.

Input: a car and its placed faces. Output: findings.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import FoldedCar, Mount, Solid
from foldcar.car.folded.placed import PlacedFace
from foldcar.car.folded.pose import apply, compose, inverse

Box = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]

# Parts may touch: overlaps of boxes up to this depth are contact.
TOUCH_MM = 0.1
# Film gives way: an area of a face inside a part up to this is contact.
FILM_MM2 = 0.5
# Screws fit with a part's holes off by this.
FIT_MM = 0.3
# Axes are parallel if their cosine is more.
PARALLEL = 0.999


def check_parts(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], soft: str
) -> Iterator[Finding]:
    """Findings about parts. Those named ``soft`` are ignored."""
    firm = [mount for mount in car.mounts if mount.part != soft and mount.body.startswith("segment")]
    solids = [boxes(mount) for mount in firm]
    for (one, first), (other, second) in itertools.combinations(zip(firm, solids, strict=True), 2):
        pairs = [(i, k) for i, a in enumerate(first) for k, b in enumerate(second) if _near(a, b)]
        deep = (_depth_mm(first[i], second[k]) for i, k in pairs if not _bored(one, i, other, k))
        depth = max(deep, default=0.0)
        if depth > TOUCH_MM:
            yield Finding("parts", one.name, f"runs {depth:.2f} mm into {other.name}")
    for mount, mine in zip(firm, solids, strict=True):
        for face in bodies.get(mount.body, ()):
            area = max(_film_inside_mm2(box, face) for box in mine)
            if area > FILM_MM2:
                yield Finding("parts", mount.name, f"is cut by {area:.1f} mm² of {face.title}")
        yield from _holes(mount, bodies.get(mount.body, ()))


def stands_in(one: Mount, solid: Solid, other: Mount, held: Solid) -> bool:
    """Whether a cylinder of one part, a screw's shank, stands in a bore of a solid of another part."""
    if solid.kind != "cylinder" or not held.bores:
        return False
    onto = np.array(compose(inverse(compose(other.pose, held.pose)), one.pose, solid.pose))
    x, y, z = onto[:3, 3]
    if abs(onto[2, 2]) < PARALLEL or abs(z) >= (solid.size_mm[2] + held.size_mm[2]) / 2:
        return False
    return any(np.hypot(x - u, y - v) + solid.size_mm[0] / 2 <= wide / 2 + TOUCH_MM for u, v, wide in held.bores)


def _bored(one: Mount, i: int, other: Mount, k: int) -> bool:
    """Whether solid i of a part and solid k of another one are a shank and what it passes through."""
    if not one.solids or not other.solids:
        return False
    a, b = one.solids[i], other.solids[k]
    return stands_in(one, a, other, b) or stands_in(other, b, one, a)


def _box(mount: Mount) -> Box:
    """A part's box: centre (3,), axes as columns (3, 3), half sizes (3,), in mm in the car's frame."""
    pose = np.array(mount.pose)
    return pose[:3, 3], pose[:3, :3], np.array(mount.size_mm) / 2


def boxes(mount: Mount) -> list[Box]:
    """The boxes around a part's solids; its own box if it has none."""
    if not mount.solids:
        return [_box(mount)]
    poses = [np.array(compose(mount.pose, solid.pose)) for solid in mount.solids]
    halves = (np.array(solid.size_mm) / 2 for solid in mount.solids)
    return [(pose[:3, 3], pose[:3, :3], half) for pose, half in zip(poses, halves, strict=True)]


def _near(one: Box, other: Box) -> bool:
    """Whether the boxes that enclose two boxes along the car's axes overlap."""
    (c1, r1, h1), (c2, r2, h2) = one, other
    return bool((np.abs(c1 - c2) < np.abs(r1) @ h1 + np.abs(r2) @ h2).all())


def _depth_mm(one: Box, other: Box) -> float:
    """Depth (mm) by which two boxes overlap (separating-axis theorem), negative if they are apart."""
    (c1, r1, h1), (c2, r2, h2) = one, other
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


def _film_inside_mm2(box: Box, face: PlacedFace) -> float:
    """The area (mm²) of a face, without holes, inside a box slightly smaller than the part."""
    center, turn, half = box
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
    """Findings if a part's holes in the film are missing, or are neither under its middle nor under a bore of it.

    The holes of a part without bores lie evenly around its middle.
    """
    found = {hole.name: (face, hole) for face in faces for hole in face.face.holes}
    bores = [apply(mount.pose, *apply(one.pose, x, y)) for one in mount.solids for x, y, _ in one.bores]
    above = np.array([apply(mount.pose, 0.0, 0.0), *bores])
    offsets: dict[str, NDArray[np.float64]] = {}
    for name in mount.holes:
        if name not in found:
            yield Finding("parts", mount.name, f"there is no hole {name}")
            return
        face, hole = found[name]
        middle = shapely.Polygon(hole.outline_mm).centroid.coords[0]
        offsets[name] = face.in_face(above)[:, :2] - middle
    if offsets and not bores:
        offsets = {f"{next(iter(offsets))} …": np.mean(list(offsets.values()), axis=0)}
    for name, off in offsets.items():
        nearest = float(np.linalg.norm(off, axis=1).min())
        if nearest > FIT_MM:
            yield Finding("parts", mount.name, f"is {nearest:.2f} mm off its hole {name}, the limit is {FIT_MM:g} mm")
