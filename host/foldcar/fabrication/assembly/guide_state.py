"""The car between two steps of its assembly: which folds are closed, what is in, and where everything then is.

Input: a FoldedCar and the steps so far. Output: poses and Shapes in the car's frame. What is fixed to a face follows
that face; the face of a beam that is nearest to the ground stays where it is in the finished car.
"""

from collections.abc import Mapping

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.step import Added, AssemblyStep
from foldcar.fabrication.assembly.faces import Fraction, Matrix, face_poses, moved
from foldcar.fabrication.assembly.facets import Shape, film_shape, mount_shape
from foldcar.fabrication.assembly.hidden_surfaces import Vector

PARALLEL = 0.999

Part = PlacedPiece | Mount
Folds = Mapping[str, Mapping[str, float]]


class State:
    """The car after some steps; ``take`` adds one more."""

    def __init__(self, car: FoldedCar) -> None:
        self.car = car
        self.roles = roles_of(car)
        self.pieces = self.roles.pieces
        self.mounts = {mount.name: mount for mount in car.mounts}
        self.closed: dict[str, dict[str, float]] = {}
        self.before: dict[str, dict[str, float]] = {}
        self.there: list[Part] = []
        self._units: dict[tuple[str, str], list[Part]] = {}

    def take(self, step: AssemblyStep) -> None:
        """The state after ``step``; ``before`` keeps its folds. What belongs to a unit comes with the unit."""
        self.before = {piece: dict(creases) for piece, creases in self.closed.items()}
        for piece, creases in step.folds.items():
            self.closed.setdefault(piece, {}).update(creases)
        for added in step.adds:
            if step.unit:
                self._units.setdefault((step.unit, added.body), []).extend(self.parts(added))
            else:
                self.there.extend(self.parts(added))

    def parts(self, added: Added) -> list[Part]:
        """The copies of pieces and the mounts that come in."""
        if added.kind == "unit":
            return list(self._units.get((added.name, added.body), []))
        if added.kind == "mount":
            return [self.mounts[added.name]]
        return [p for p in self.car.placed if (p.piece, p.copy) == (added.name, added.copy)]

    def unit_bodies(self, name: str) -> list[str]:
        """The bodies that have a unit of that name, in the order in which they were begun."""
        return [body for unit, body in self._units if unit == name]

    def unit(self, name: str, body: str) -> list[Part]:
        """What there is of a unit so far."""
        return list(self._units.get((name, body), []))

    def fraction(self, piece: str) -> Fraction:
        """How far the piece is folded."""
        return self.closed.get(piece, {})

    def face_centres(self, placed: PlacedPiece, folds: Folds | None = None) -> dict[str, Vector]:
        """The middle of each face of a copy, (3,) in mm, with these folds instead of those closed now."""
        folds = self.closed if folds is None else folds
        piece, root = self.pieces[placed.piece], self.pose(placed, folds)
        poses = face_poses(piece, folds.get(placed.piece, {}))
        return {f.name: moved(root @ poses[f.name], np.array([f.outline_mm]).mean(axis=1))[0] for f in piece.faces}

    def pose(self, part: Part, folds: Folds | None = None) -> Matrix:
        """The pose of a part, of a piece that of its root face, as far as the ``folds`` are closed (default: now)."""
        folds = self.closed if folds is None else folds
        final, base = np.array(part.pose), self.roles.base.get(part.body)
        if base is None:
            return final
        piece, place = self.pieces[base.piece], np.array(base.pose)
        whole, now = face_poses(piece), face_poses(piece, folds.get(piece.name, {}))
        # The lowest of its level panels stays where it is.
        heights = {f.name: place @ whole[f.name] for f in piece.faces}
        level = [f.name for f in piece.faces if f.role == "panel" and abs(heights[f.name][2, 2]) > PARALLEL]
        still = min(level or [piece.faces[0].name], key=lambda name: float(heights[name][2, 3]))
        root = place @ whole[still] @ np.linalg.inv(now[still])
        if part is base:
            return np.array(root)
        face = part.face if isinstance(part, Mount) else self.roles.face_under(part)
        if face not in whole:
            return final
        return np.array(root @ now[face] @ np.linalg.inv(place @ whole[face]) @ final)

    def shape(self, part: Part, shift: Vector | None = None, creases: bool = False) -> Shape:
        """A part as it is now, moved by ``shift`` (mm)."""
        pose = self.pose(part)
        if shift is not None:
            pose[:3, 3] += shift
        if isinstance(part, Mount):
            return mount_shape(part, pose)
        return film_shape(self.pieces[part.piece], pose, self.fraction(part.piece), key(part), creases=creases)


def key(placed: PlacedPiece) -> str:
    """The prefix of the keys of a copy's facets."""
    return f"{placed.piece} {placed.copy} "
