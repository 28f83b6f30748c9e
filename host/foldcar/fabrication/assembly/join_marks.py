"""Positions of joins' numbers on a piece in the guide: on the tab, and beside the edge that it is glued along."""

from itertools import permutations

import numpy as np
from shapely.geometry import Point, Polygon

from foldcar.car.folded.folding import edge
from foldcar.car.folded.model import FoldedCar, Join, Piece
from foldcar.fabrication.assembly.drawing import Mark
from foldcar.fabrication.assembly.hidden_surfaces import Vector
from foldcar.fabrication.assembly.poses import Fraction, Matrix, face_poses, glued_offset_mm, moved

BESIDE_EDGE_MM = 7.0


def join_marks(folded: FoldedCar, piece: Piece, pose: Matrix, fraction: Fraction, prefix: str = "") -> list[Mark]:
    """The numbers on one copy of a piece; the joins around a rim have their number once on each side."""
    poses = {name: pose @ at for name, at in face_poses(piece, fraction).items()}
    offsets = glued_offset_mm(piece, fraction)
    places: dict[tuple[int, str], list[Mark]] = {}
    for join in folded.joins:
        for side in ("a", "b"):
            if (join.piece_a if side == "a" else join.piece_b) != piece.name:
                continue
            found = _place(join, piece, side)
            if found is None:
                continue
            face, at = found
            once = (join.number, side if join.kind in ("rim", "laminate") else f"{side} {face}")
            point = moved(poses[face], np.array([[*at, offsets.get(face, 0.0)]]))[0]
            places.setdefault(once, []).append(Mark(str(join.number), point, prefix + face))
    marks: list[Mark] = []
    # What has one place comes first; of the teeth around a rim the one farthest from all other numbers is taken.
    for several in sorted(places.values(), key=len):
        marks.append(max(several, key=lambda mark: round(_apart_mm(mark, marks), 3)))
    return marks


def _apart_mm(mark: Mark, others: list[Mark]) -> float:
    return min((float(np.linalg.norm(mark.at_mm - other.at_mm)) for other in others), default=0.0)


def _place(join: Join, piece: Piece, side: str) -> tuple[str, Vector] | None:
    """The face and the point (mm) on it; None if the join is not numbered there."""
    faces = {face.name: face for face in piece.faces}
    reference = join.a if side == "a" else join.b
    # The joins of merged copies name the faces of the first copy.
    face = faces.get(reference.face, piece.faces[0])
    outline = np.array(face.outline_mm)
    if join.kind == "laminate" and side == "a":
        # Off the centre, where hubs and openings are.
        return face.name, outline.mean(axis=0) * 0.4 + outline[0] * 0.6
    if join.kind == "laminate":
        return None
    hole = next((hole for hole in face.holes if side == "b" and hole.name == join.slot), None)
    if hole is not None:
        middle = np.array(hole.outline_mm).mean(axis=0)
        inward = outline.mean(axis=0) - middle
        apart = float(np.linalg.norm(inward))
        if apart > BESIDE_EDGE_MM:
            step = inward * BESIDE_EDGE_MM / apart
            opened = any(Polygon(one.outline_mm).covers(Point(*(middle + step))) for one in face.holes)
            return face.name, middle - step if opened else middle + step
        # A wound strip's faces are short: the next one has the number.
        ends = [(crease.parent.face, crease.child.face) for crease in piece.creases]
        beside = [faces[b] for pair in ends for a, b in permutations(pair) if a == face.name]
        found = max(beside, key=lambda one: float(np.ptp(one.outline_mm, axis=0).prod()), default=face)
        return found.name, np.array(found.outline_mm).mean(axis=0)
    if side == "a" and join.kind in ("tab", "lap", "rim"):
        return face.name, outline.mean(axis=0)
    a, b = (np.array(point) for point in edge(faces, reference))
    inward = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    reach = min(BESIDE_EDGE_MM, float(((outline - a) @ inward).max()) / 2)
    return face.name, (a + b) / 2 + inward * reach
