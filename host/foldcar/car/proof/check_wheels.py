"""Checks of wheels: hooks hold the discs in their notches and slots, the running circle is round.

Input: a car and its placed faces. Output: findings; the roundness in mm.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
import shapely.affinity
from numpy.typing import NDArray

from foldcar.car.folded.model import Axle, FoldedCar, Join
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace

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
