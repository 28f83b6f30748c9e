"""Checks of parts and wheels: holes lie under their parts, wheels turn freely, their hooks hold, their circle is round.

Input: a car and its placed faces; wheels are alike, so that the first one stands for all. Output: findings. That parts
do not overlap is proved with the assembly (prove.py).
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
import shapely.affinity
from numpy.typing import NDArray

from foldcar.car.folded.model import Axle, FoldedCar, Join, Mount, Solid
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace
from foldcar.car.folded.pose import apply, compose, inverse

Points = NDArray[np.float64]
# What turning points pass: least and largest distance from the axle, and outwards from the wheel's middle along it (mm).
Band = tuple[float, float, float, float]

# A shank stands in a bore if it reaches no farther into its wall than this.
TOUCH_MM = 0.1
# Screws fit with a part's holes off by this.
FIT_MM = 0.3
# Axes are parallel if their cosine is more.
PARALLEL = 0.999
# Least distance of what turns from what does not, less than between a servo's turret and the horn over it.
FREE_MM = 0.5
# What is as near to an axle as this is the spline that turns.
ON_AXIS_MM = 0.5


def stands_in(one: Mount, solid: Solid, other: Mount, held: Solid) -> bool:
    """Whether a cylinder of one part, a screw's shank, stands in a bore of a solid of another part."""
    if solid.kind != "cylinder" or not held.bores:
        return False
    onto = np.array(compose(inverse(compose(other.pose, held.pose)), one.pose, solid.pose))
    x, y, z = onto[:3, 3]
    if abs(onto[2, 2]) < PARALLEL or abs(z) >= (solid.size_mm[2] + held.size_mm[2]) / 2:
        return False
    return any(np.hypot(x - u, y - v) + solid.size_mm[0] / 2 <= wide / 2 + TOUCH_MM for u, v, wide in held.bores)


def corners_mm(mount: Mount) -> Iterator[Points]:
    """The corners of the box around each of a part's solids, (8, 3) in mm in the car."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    for solid in mount.shape:
        pose = np.array(compose(mount.pose, solid.pose))
        yield signs * solid.size_mm @ pose[:3, :3].T + pose[:3, 3]


def check_holes(car: FoldedCar, bodies: Bodies) -> Iterator[Finding]:
    """Findings if a part's holes in the film are missing, or are neither under its middle nor under a bore of it.

    The holes of a part without bores lie evenly around its middle.
    """
    for mount in (mount for mount in car.mounts if mount.holes):
        found = {hole.name: (face, hole) for face in bodies.get(mount.body, ()) for hole in face.face.holes}
        if missing := [name for name in mount.holes if name not in found]:
            yield Finding("parts", mount.name, f"there is no hole {missing[0]}")
            continue
        bores = [apply(mount.pose, *apply(one.pose, x, y)) for one in mount.solids for x, y, _ in one.bores]
        above, offsets = np.array([apply(mount.pose, 0.0, 0.0), *bores]), {}
        for name in mount.holes:
            face, hole = found[name]
            offsets[name] = face.in_face(above)[:, :2] - shapely.Polygon(hole.outline_mm).centroid.coords[0]
        if not bores:
            offsets = {f"{mount.holes[0]} …": np.mean(list(offsets.values()), axis=0)}
        for name, off in offsets.items():
            nearest = float(np.linalg.norm(off, axis=1).min())
            if nearest > FIT_MM:
                told = f"is {nearest:.2f} mm off its hole {name}, the limit is {FIT_MM:g} mm"
                yield Finding("parts", mount.name, told)


def check_turning(car: FoldedCar, bodies: Bodies, distance_mm: float) -> Iterator[Finding]:
    """Findings about wheels: something is where a wheel's film, screws or tyre pass; tyres are nearer than that."""
    for one, other in itertools.combinations(car.axles, 2):
        (x, y, z), (u, v, w) = one.center_mm, other.center_mm
        gap = math.hypot(x - u, z - w) - one.radius_mm - other.radius_mm
        if abs(y - v) < (one.tyre_width_mm + other.tyre_width_mm) / 2 and gap < distance_mm - 1e-6:
            yield Finding("wheels", one.wheel, f"is {gap:.2f} mm from {other.wheel}, the limit is {distance_mm:g} mm")
    firm = [m for m in car.mounts if m.part != car.parts.wiring.name and m.body.startswith("segment")]
    walls = [face for faces in bodies.values() for face in faces if face.body.startswith("segment")]
    still = [(face.title, face.corners_mm) for face in walls]
    still += [(mount.name, corners) for mount in firm for corners in corners_mm(mount)]
    wheel = car.axles[0]
    mounts = [list(corners_mm(mount)) for mount in car.mounts if mount.body == wheel.wheel]
    points = [face.corners_mm for face in bodies.get(wheel.wheel, ())]
    # The centre screw sits in the spline.
    points += [box for boxes in mounts if not _is_spline(np.vstack(boxes), wheel) for box in boxes]
    turning = np.array([_band(some, wheel) for some in points])
    for axle in car.axles:
        bands = [(title, _band(corners, axle)) for title, corners in still if not _is_spline(corners, axle)]
        for title in dict.fromkeys(title for title, band in bands if _meets(band, turning)):
            yield Finding("wheels", axle.wheel, f"runs into {title}")


def _meets(band: Band, others: Points) -> bool:
    """Whether a band comes closer than FREE_MM to one of others, (n, 4), across and along the axle."""
    near, far, inside, outside = others.T
    across = (band[0] < far + FREE_MM) & (near < band[1] + FREE_MM)
    return bool((across & (band[2] < outside + FREE_MM) & (inside < band[3] + FREE_MM)).any())


def _band(corners: Points, axle: Axle) -> Band:
    """The band of the convex hull of these points, (n, 3) in mm."""
    x, y, z = (corners - axle.center_mm).T
    hull = shapely.MultiPoint(np.column_stack([x, z])).convex_hull
    out = y if axle.side == "left" else -y
    ends = hull.distance(shapely.Point(0, 0)), np.hypot(x, z).max(), out.min(), out.max()
    near, far, inside, outside = (float(value) for value in ends)
    return near, far, inside, outside


def _is_spline(corners: Points, axle: Axle) -> bool:
    """Whether points lie in a slender box around the axle."""
    off = (corners.min(axis=0) + corners.max(axis=0)) / 2 - axle.center_mm
    reach = np.ptp(corners, axis=0) / 2
    return bool(np.hypot(off[0], off[2]) < ON_AXIS_MM and max(reach[0], reach[2]) < reach[1] + 1)


ROUND_MM = 0.5
# A neck has at least this play on all sides and at most this where its head holds, which reaches so far beyond it.
PLAY_MM = (0.1, 0.3)
HOLD_MM = 0.8


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
            outer = np.vstack([_outer(face, face.corners_mm, axle) for face in faces])
            worst = max(worst, float(np.linalg.norm(outer, axis=1).max()) - radius)
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
            points.append(_outer(face, cut, axle))
    hull = shapely.MultiPoint(np.concatenate(points)).convex_hull
    inwards = radius_mm - float(hull.exterior.distance(shapely.Point(0, 0)))
    outwards = float(np.linalg.norm(np.array(hull.exterior.coords), axis=1).max()) - radius_mm
    return max(inwards, outwards)


def _outer(face: PlacedFace, points: Points, axle: Axle) -> Points:
    """Points of a face seen along the axle, (n, 2) in mm from it, on the film's outer surface."""
    across: Points = (points - axle.center_mm)[:, [0, 2]]
    normal = face.normal[[0, 2]]
    if np.linalg.norm(normal) > 0.5:
        across = across + face.piece.thickness_mm / 2 * np.sign(across.mean(axis=0) @ normal) * normal
    return across


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
