"""Checks of parts and wheels: nothing overlaps but a screw in a bore, holes lie under their parts, wheels turn freely,
their hooks hold the discs, their running circle is round.

Input: a car and its placed faces; wheels are alike, so that the first one stands for all. Output: findings.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely
import shapely.affinity
from numpy.typing import NDArray

from foldcar.car.folded.model import Axle, FoldedCar, Join, Mount, Solid
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace
from foldcar.car.folded.pose import apply, compose, inverse

Points = NDArray[np.float64]
# Centre (3,), axes as columns (3, 3), half sizes (3,), in mm in the car's frame.
Box = tuple[Points, Points, Points]

# Parts may touch: overlaps of boxes up to this depth are contact.
TOUCH_MM = 0.1
# Film gives way: an area of a face inside a part up to this is contact.
FILM_MM2 = 0.5
# Screws fit with a part's holes off by this.
FIT_MM = 0.3
# Axes are parallel if their cosine is more.
PARALLEL = 0.999
# Least distance of what turns from what does not, less than between a servo's turret and the horn over it.
FREE_MM = 0.5
# What is as near to an axle as this is the spline that turns.
ON_AXIS_MM = 0.5
# The corners of a box of half sizes 1.
_CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)))


def check_parts(car: FoldedCar, bodies: Bodies) -> Iterator[Finding]:
    """Findings about parts in segments."""
    firm = _firm(car)
    solids = [list(zip(mount.shape, boxes(mount), strict=True)) for mount in firm]
    for (one, first), (other, second) in itertools.combinations(zip(firm, solids, strict=True), 2):
        depth = 0.0
        for (a, box_a), (b, box_b) in itertools.product(first, second):
            # A shank may stand in what it passes through.
            if _near(box_a, box_b) and not (stands_in(one, a, other, b) or stands_in(other, b, one, a)):
                depth = max(depth, _depth_mm(box_a, box_b))
        if depth > TOUCH_MM:
            yield Finding("parts", one.name, f"runs {depth:.2f} mm into {other.name}")
    for mount, mine in zip(firm, solids, strict=True):
        for face in bodies.get(mount.body, ()):
            area = max(_film_inside_mm2(box, face) for _, box in mine)
            if area > FILM_MM2:
                yield Finding("parts", mount.name, f"is cut by {area:.1f} mm² of {face.title}")
        yield from _holes(mount, bodies.get(mount.body, ()))


def _firm(car: FoldedCar) -> list[Mount]:
    """The parts in segments but for loose wires."""
    return [m for m in car.mounts if m.part != car.parts.wiring.name and m.body.startswith("segment")]


def stands_in(one: Mount, solid: Solid, other: Mount, held: Solid) -> bool:
    """Whether a cylinder of one part, a screw's shank, stands in a bore of a solid of another part."""
    if solid.kind != "cylinder" or not held.bores:
        return False
    onto = np.array(compose(inverse(compose(other.pose, held.pose)), one.pose, solid.pose))
    x, y, z = onto[:3, 3]
    if abs(onto[2, 2]) < PARALLEL or abs(z) >= (solid.size_mm[2] + held.size_mm[2]) / 2:
        return False
    return any(np.hypot(x - u, y - v) + solid.size_mm[0] / 2 <= wide / 2 + TOUCH_MM for u, v, wide in held.bores)


def boxes(mount: Mount) -> list[Box]:
    """The boxes around a part's solids; its own box if it has none."""
    poses = [np.array(compose(mount.pose, solid.pose)) for solid in mount.shape]
    halves = (np.array(solid.size_mm) / 2 for solid in mount.shape)
    return [(pose[:3, 3], pose[:3, :3], half) for pose, half in zip(poses, halves, strict=True)]


def _near(one: Box, other: Box) -> bool:
    """Whether the boxes that enclose two boxes along the car's axes overlap."""
    (c1, r1, h1), (c2, r2, h2) = one, other
    return bool((np.abs(c1 - c2) < np.abs(r1) @ h1 + np.abs(r2) @ h2).all())


def _depth_mm(one: Box, other: Box) -> float:
    """Depth (mm) by which two boxes overlap (separating-axis theorem), negative if they are apart."""
    (c1, r1, h1), (c2, r2, h2) = one, other
    between = c2 - c1
    depth = np.inf
    for axis in [*r1.T, *r2.T, *(np.cross(a, b) for a in r1.T for b in r2.T)]:
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
    points = face.in_face(_corners((center, turn, half)))
    # Points where the box's edges pass the face's plane; an edge joins two corners that differ in one sign.
    section = []
    for i, k in itertools.combinations(range(8), 2):
        a, b = points[i], points[k]
        if np.abs(_CORNERS[i] - _CORNERS[k]).sum() == 2 and a[2] * b[2] < 0:
            section.append((a + (b - a) * a[2] / (a[2] - b[2]))[:2])
    if len(section) < 3:
        return 0.0
    return float(shapely.MultiPoint(section).convex_hull.intersection(face.polygon).area)


def _corners(box: Box) -> Points:
    """The corners of a box, (8, 3) in mm."""
    center, turn, half = box
    corners: Points = _CORNERS * half @ turn.T + center
    return corners


def _holes(mount: Mount, faces: Sequence[PlacedFace]) -> Iterator[Finding]:
    """Findings if a part's holes in the film are missing, or are neither under its middle nor under a bore of it.

    The holes of a part without bores lie evenly around its middle.
    """
    found = {hole.name: (face, hole) for face in faces for hole in face.face.holes}
    bores = [apply(mount.pose, *apply(one.pose, x, y)) for one in mount.solids for x, y, _ in one.bores]
    above = np.array([apply(mount.pose, 0.0, 0.0), *bores])
    offsets: dict[str, Points] = {}
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


class Band(NamedTuple):
    """What turning points pass: distances from the axle, and from the wheel's middle outwards along it (mm)."""

    near: float
    far: float
    inside: float
    outside: float

    def meets(self, other: "Band") -> bool:
        """Whether two bands come closer than FREE_MM."""
        across = self.near < other.far + FREE_MM and other.near < self.far + FREE_MM
        along = self.inside < other.outside + FREE_MM and other.inside < self.outside + FREE_MM
        return across and along


def check_turning(car: FoldedCar, bodies: Bodies, distance_mm: float) -> Iterator[Finding]:
    """Findings about wheels: something is where a wheel's film, screws or tyre pass; tyres are nearer than that."""
    for one, other in itertools.combinations(car.axles, 2):
        widths = (one.tyre_width_mm + other.tyre_width_mm) / 2
        if abs(one.center_mm[1] - other.center_mm[1]) >= widths:
            continue
        gap = float(np.hypot(one.center_mm[0] - other.center_mm[0], one.center_mm[2] - other.center_mm[2]))
        gap -= one.radius_mm + other.radius_mm
        if gap < distance_mm - 1e-6:
            yield Finding("wheels", one.wheel, f"is {gap:.2f} mm from {other.wheel}, the limit is {distance_mm:g} mm")
    turning = _turning(car, bodies)
    walls = [face for faces in bodies.values() for face in faces if face.body.startswith("segment")]
    for axle in car.axles:
        for face in walls:
            still = _band(face.corners_mm, axle)
            if any(still.meets(one) for one in turning):
                yield Finding("wheels", axle.wheel, f"runs into {face.title}")
        for mount in _firm(car):
            bands = [_band(_corners(box), axle) for box in boxes(mount) if not _is_spline(box, axle)]
            if any(band.meets(one) for one in turning for band in bands):
                yield Finding("wheels", axle.wheel, f"runs into {mount.name}")


def _turning(car: FoldedCar, bodies: Bodies) -> list[Band]:
    """The bands of the first wheel's film and parts, each once."""
    axle = next((axle for axle in car.axles if axle.wheel in bodies), None)
    if axle is None:
        return []
    bands = [_band(face.corners_mm, axle) for face in bodies[axle.wheel]]
    for mount in (m for m in car.mounts if m.body == axle.wheel):
        # The centre screw sits in the spline.
        whole = np.array(mount.pose)
        if not _is_spline((whole[:3, 3], whole[:3, :3], np.array(mount.size_mm) / 2), axle):
            bands += [_band(_corners(box), axle) for box in boxes(mount)]
    return list({tuple(round(value, 1) for value in band): band for band in bands}.values())


def _band(corners: Points, axle: Axle) -> Band:
    """The band of the convex hull of these points, (n, 3) in mm."""
    x, y, z = (corners - axle.center_mm).T
    hull = shapely.MultiPoint(np.column_stack([x, z])).convex_hull
    near, far = float(hull.distance(shapely.Point(0, 0))), float(np.hypot(x, z).max())
    out = y if axle.side == "left" else -y
    return Band(near, far, float(out.min()), float(out.max()))


def _is_spline(box: Box, axle: Axle) -> bool:
    """Whether a box is a slender one around the axle."""
    center, turn, half = box
    reach = np.abs(turn) @ half
    off = float(np.hypot(center[0] - axle.center_mm[0], center[2] - axle.center_mm[2]))
    return off < ON_AXIS_MM and max(reach[0], reach[2]) < reach[1] + 1


ROUND_MM = 0.5
# A neck has at least this play on all sides and at most this where its head holds, which reaches so far beyond it.
PLAY_MM = (0.1, 0.3)
HOLD_MM = 0.8

Vector = NDArray[np.float64]


def check_wheels(car: FoldedCar, bodies: Bodies) -> Iterator[Finding]:
    """Findings about every hook of the placed wheel, and about its circle."""
    for body, faces in bodies.items():
        if not body.startswith("wheel"):
            continue
        index = {(face.piece.name, face.face.name): face for face in faces}
        for join in car.joins:
            a, b = index.get((join.piece_a, join.a.face)), index.get((join.piece_b, join.b.face))
            if join.kind in ("rim", "lock") and a is not None and b is not None:
                yield from _hook(join, a, b, index)
    off = roundness_mm(car, bodies)
    if off > ROUND_MM:
        yield Finding("round", "wheels", f"deviate from their circle by {off:.2f} mm, the limit is {ROUND_MM:g} mm")


def roundness_mm(car: FoldedCar, bodies: Bodies) -> float:
    """The largest deviation (mm) of a wheel's film from the circle that the tyre lies on; 0 without wheels.

    A stretched band, or flat ground, touches the convex hull of a section across the axle: there are sections in the
    middles of the two discs and of the rim. What stands out elsewhere counts as well.
    """
    worst = 0.0
    for axle in car.axles:
        faces = bodies.get(axle.wheel, ())
        radius = axle.radius_mm - car.parts.tyre.thickness_mm.value
        discs = [face.matrix[1, 3] for face in faces if abs(face.normal[1]) > 0.5]
        if discs:
            planes = (min(discs), (min(discs) + max(discs)) / 2, max(discs))
            worst = max(worst, *(_uneven_mm(faces, axle, y, radius) for y in planes))
            worst = max(worst, *(float(_outer(f, f.corners_mm, axle)[1] - radius) for f in faces))
    return worst


def _uneven_mm(faces: Sequence[PlacedFace], axle: Axle, y_mm: float, radius_mm: float) -> float:
    """The largest deviation (mm) from the circle of the convex hull of a section at that y."""
    points = []
    for face in faces:
        if abs(face.normal[1]) > 0.5:
            cut = face.corners_mm if abs(face.matrix[1, 3] - y_mm) < face.piece.thickness_mm / 2 else np.zeros((0, 3))
        else:
            cut = face.cut(np.array([0.0, 1.0, 0.0]), y_mm)
        if len(cut):
            points.append(_outer(face, cut, axle)[0])
    hull = shapely.MultiPoint(np.concatenate(points)).convex_hull
    inwards = radius_mm - float(hull.exterior.distance(shapely.Point(0, 0)))
    outwards = float(np.linalg.norm(np.array(hull.exterior.coords), axis=1).max()) - radius_mm
    return max(inwards, outwards)


def _outer(face: PlacedFace, points: Vector, axle: Axle) -> tuple[Vector, float]:
    """Points of a face seen along the axle, (n, 2) in mm from it, on the film's outer surface; the farthest one."""
    across = (points - axle.center_mm)[:, [0, 2]]
    normal = face.normal[[0, 2]]
    if np.linalg.norm(normal) > 0.5:
        across = across + face.piece.thickness_mm / 2 * np.sign(across.mean(axis=0) @ normal) * normal
    return across, float(np.linalg.norm(across, axis=1).max())


def _hook(join: Join, a: PlacedFace, b: PlacedFace, index: Mapping[tuple[str, str], PlacedFace]) -> Iterator[Finding]:
    """Findings about one neck in its notch or slot of face b, and the head behind it."""
    place = f"join {join.number}: {a.title} through {b.title}"
    height = float(b.normal @ b.matrix[:3, 3])
    # Of a tongue of several parts also the one that it grows from.
    parents = {crease.child.face: crease.parent.face for crease in a.piece.creases}
    several = [a, index[a.piece.name, parents[a.face.name]]] if a.face.name in parents else [a]
    necks = [(face, cut) for face in several if len(cut := face.cut(b.normal, height)) == 2]
    if not necks:
        yield Finding("hook", place, "no neck passes its notch or slot")
        return
    neck, cut = necks[0]
    ends = b.in_face(cut)[:, :2]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    # A film that passes at an angle takes more room than its thickness.
    half = neck.piece.thickness_mm / 2 / np.sqrt(1 - float(neck.normal @ b.normal) ** 2)
    section = shapely.LineString(ends).buffer(half, cap_style="flat")
    play = float(section.distance(b.polygon))
    if play < PLAY_MM[0] - 1e-6:
        yield Finding("hook", place, f"its neck has {play:.2f} mm of play, the limit is {PLAY_MM[0]:g} mm")
    local = b.in_face(a.corners_mm)
    beyond = local[local[:, 2] * local[join.a.index, 2] > 0][:, :2] @ along
    low, high = ends @ along
    held = {-1: low - beyond.min(), 1: beyond.max() - high}
    most = max(held.values())
    if most < HOLD_MM - 1e-6:
        yield Finding("hook", place, f"its head reaches {most:.2f} mm beyond its neck, the limit is {HOLD_MM:g} mm")
    for side in (side for side, length in held.items() if length >= HOLD_MM - 1e-6):
        step = side * (PLAY_MM[1] + 1e-6) * along
        if not shapely.affinity.translate(section, *step).intersects(b.polygon):
            yield Finding("hook", place, f"its neck has more than {PLAY_MM[1]:g} mm of play towards its hook")
