"""The lid of a beam: what opens of it without harm.

Input: a FoldedCar and one of its beams. Output: the faces that move, the folds that open and the joins that shut.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from foldcar.car.folded.model import Crease, Face, FoldedCar, Piece

# Joins that hold for good; locks and tucks open again.
GLUED = frozenset({"lap", "tab", "rim", "laminate"})


@dataclass(frozen=True)
class Lid:
    """The part of a beam that opens: faces, the folds that open it, its hinge first, and the joins that shut it.

    ``gripped`` are those of the faces that fingers press or hold to open it.
    """

    faces: frozenset[str]
    creases: tuple[str, ...]
    joins: tuple[int, ...]
    gripped: tuple[Face, ...] = ()


def lid_of(car: FoldedCar, base: Piece) -> Lid:
    """The lid of a beam: the faces between a lock and the first face that is glued to something; none without a lock.

    Climbs from the tongue of a lock within the beam towards the root, and stops before a face from which glue leads to
    what does not move with it.
    """
    faces = {face.name: face for face in base.faces}
    parents = {crease.child.face: crease for crease in base.creases}
    locks = [j for j in car.joins if j.kind == "lock" and j.piece_a == j.piece_b == base.name]
    moving: set[str] = set()
    opening: list[str] = []
    for lock in locks:
        still = _ancestors(parents, lock.b.face)
        at, folds = lock.a.face, []
        while at in parents and at not in still:
            crease = parents[at]
            below = _subtree(base, at)
            if _glued_elsewhere(car, base, below):
                break
            moving |= below
            if faces[at].role == "panel":
                folds.append(crease.name)
            at = crease.parent.face
        opening += [name for name in reversed(folds) if name not in opening]
    order = [crease.name for crease in base.creases if crease.name in opening]
    ends = {(base.name, face) for face in moving}
    shutting = {
        j.number
        for j in car.joins
        if j.kind in ("lock", "tuck") and len(ends & {(j.piece_a, j.a.face), (j.piece_b, j.b.face)}) == 1
    }
    gripped = tuple(face for face in base.faces if face.name in moving and face.accesses)
    return Lid(frozenset(moving), tuple(order), tuple(sorted(shutting)), gripped)


def _ancestors(parents: Mapping[str, Crease], face: str) -> set[str]:
    found = {face}
    while face in parents:
        face = parents[face].parent.face
        found.add(face)
    return found


def _subtree(piece: Piece, top: str) -> set[str]:
    """A face and all that hang on it."""
    found = {top}
    for crease in piece.creases:
        if crease.parent.face in found:
            found.add(crease.child.face)
    return found


def _glued_elsewhere(car: FoldedCar, base: Piece, faces: set[str]) -> bool:
    """Whether glue joins these faces of a beam to faces that do not move with them.

    A flat piece laminated to the faces alone moves with them.
    """
    layers = {piece.name for piece in car.pieces if not piece.creases}
    for join in car.joins:
        ends = ((join.piece_a, join.a.face), (join.piece_b, join.b.face))
        inside = [piece == base.name and face in faces for piece, face in ends]
        if join.kind not in GLUED or not any(inside) or all(inside):
            continue
        if join.kind != "laminate" or ends[inside.index(False)][0] not in layers:
            return True
    return False
