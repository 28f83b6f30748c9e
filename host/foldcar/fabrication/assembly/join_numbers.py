"""Marks with the numbers of joins on the faces of a piece in a picture.

Input: a FoldedCar and one of its pieces, folded in any way. Output: a mark for each number, at a point of a face. The
sheets have numbers of their own (patterns/join_marks.py).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from shapely.geometry import Point, Polygon

from foldcar.car.folded.model import FoldedCar, Join, Piece
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.drawing import DrawnText
from foldcar.fabrication.assembly.faces import Fraction, Matrix, face_poses, glued_offset_mm, moved
from foldcar.fabrication.assembly.hidden_surfaces import Vector

# How far a join's number stands from its slot or edge. On a layer, how far along the way from the middle to a corner.
BESIDE_EDGE_MM, NEAR_CORNER = 7.0, 0.6


def box_area_mm2(outline_mm: Sequence[tuple[float, float]]) -> float:
    """Return the area of the box around an outline, along the axes of its frame."""
    return float(np.prod(np.ptp(np.array(outline_mm), axis=0)))


def join_marks(folded: FoldedCar, piece: Piece, pose: Matrix, fraction: Fraction, prefix: str = "") -> list[DrawnText]:
    """Return marks with the numbers of all joins of one copy of a piece, whose root face is at ``pose``.

    A mark is a number at a place of a face. ``fraction`` says how far the folds of the piece are closed. A join around a
    rim has many teeth, and so many places; its number is written once on the strip and once on the disc.
    """
    poses = {name: pose @ face_pose for name, face_pose in face_poses(piece, fraction).items()}
    offsets = glued_offset_mm(piece, fraction)
    # The marks among which one is chosen. The key is the number of the join and the side of the join to which the piece
    # belongs. If the number is written on every face, the key also has the name of the face.
    candidates_by_key: dict[tuple[int, str, str], list[DrawnText]] = {}
    for join in folded.joins:
        is_written_once = join.kind in ("rim", "laminate")
        for side in _sides_on(piece, join):
            place = _number_place(join, piece, side)
            if place is None:
                continue
            x, y = place.point_mm
            position = moved(poses[place.face], np.array([[x, y, offsets.get(place.face, 0.0)]]))[0]
            mark = DrawnText(str(join.number), position, prefix + place.face)
            key = (join.number, side, "" if is_written_once else place.face)
            candidates_by_key.setdefault(key, []).append(mark)
    marks: list[DrawnText] = []
    # Numbers with a single place come first. Of several places, the one is taken that is farthest from all numbers so
    # far.
    for candidates in sorted(candidates_by_key.values(), key=len):
        marks.append(max(candidates, key=lambda mark: round(_min_distance_mm(mark, marks), 3)))
    return marks


def _sides_on(piece: Piece, join: Join) -> list[str]:
    """Return the sides of a join, "a" and "b", that are on a piece."""
    return [side for side, name in (("a", join.piece_a), ("b", join.piece_b)) if name == piece.name]


class _NumberPlace(NamedTuple):
    """Where the number of a join stands: the name of the face, and the point (2,) in its frame (mm)."""

    face: str
    point_mm: Vector


def _min_distance_mm(mark: DrawnText, others: list[DrawnText]) -> float:
    return min((float(np.linalg.norm(mark.at_mm - other.at_mm)) for other in others), default=0.0)


def _number_place(join: Join, piece: Piece, side: str) -> _NumberPlace | None:
    """Return where the number of a join stands on its side "a" or "b".

    The point is inside the film: on a tab, beside a slot, or beside the joined edge. The result is None if this side
    has no number.
    """
    faces = {face.name: face for face in piece.faces}
    reference = join.a if side == "a" else join.b
    # The joins of merged copies name the faces of the first copy.
    face = faces.get(reference.face, piece.faces[0])
    outline = np.array(face.outline_mm)
    if join.kind == "laminate" and side == "a":
        # The number stands near the first corner, because hubs and openings are in the middle.
        return _NumberPlace(face.name, outline.mean(axis=0) * (1 - NEAR_CORNER) + outline[0] * NEAR_CORNER)
    if join.kind == "laminate":
        return None
    # A slot: the number stands beside it, towards the middle of the face.
    hole = next((hole for hole in face.holes if side == "b" and hole.name == join.slot), None)
    if hole is not None:
        middle = np.array(hole.outline_mm).mean(axis=0)
        inward = outline.mean(axis=0) - middle
        distance_mm = float(np.linalg.norm(inward))
        if distance_mm > BESIDE_EDGE_MM:
            step = inward * BESIDE_EDGE_MM / distance_mm
            is_in_hole = any(Polygon(hole.outline_mm).covers(Point(*(middle + step))) for hole in face.holes)
            return _NumberPlace(face.name, middle - step if is_in_hole else middle + step)
        # The slot is in the middle of a short face, as in a wound strip. So the number stands on its largest neighbour.
        neighbours = []
        for crease in piece.creases:
            if crease.parent.face == face.name:
                neighbours.append(faces[crease.child.face])
            if crease.child.face == face.name:
                neighbours.append(faces[crease.parent.face])
        neighbour = max(neighbours, key=lambda other: box_area_mm2(other.outline_mm), default=face)
        return _NumberPlace(neighbour.name, np.array(neighbour.outline_mm).mean(axis=0))
    # A tab: the number stands in its middle.
    if side == "a" and join.kind in ("tab", "lap", "rim"):
        return _NumberPlace(face.name, outline.mean(axis=0))
    # The joined edge from a to b: the number stands beside its middle, inside the face.
    a, b = (np.array(point) for point in edge(faces, reference))
    inward = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    depth_mm = min(BESIDE_EDGE_MM, float(((outline - a) @ inward).max()) / 2)
    return _NumberPlace(face.name, (a + b) / 2 + inward * depth_mm)
