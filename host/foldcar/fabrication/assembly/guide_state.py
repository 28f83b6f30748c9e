"""The car between two steps of its assembly: which folds are closed, what is in, and where everything then is.

Input: a FoldedCar and the steps so far. Output: poses and Shapes in the car's frame. What is fixed to a face follows
that face; the face of a beam that is nearest to the ground stays where it is in the finished car.
"""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from foldcar.car.assembly.step import Added, AssemblyStep
from foldcar.car.folded.model import FoldedCar, Mount, Piece, PlacedPiece
from foldcar.fabrication.assembly.facets import Shape, film_shape, mount_shape
from foldcar.fabrication.assembly.hidden_surfaces import Vector
from foldcar.fabrication.assembly.solids import Fraction, Matrix, face_poses, moved, piece_area_mm2

PARALLEL = 0.999
# Layers lie closer than this to the face that they are fixed to.
LAYER_MM = 1.5

Part = PlacedPiece | Mount
Folds = Mapping[str, Mapping[str, float]]


class State:
    """The car after some steps; ``take`` adds one more."""

    def __init__(self, car: FoldedCar) -> None:
        self.car = car
        self.pieces = {piece.name: piece for piece in car.pieces}
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

    @cached_property
    def mounts(self) -> dict[str, Mount]:
        """All mounts by their names."""
        return {mount.name: mount for mount in self.car.mounts}

    @cached_property
    def bases(self) -> dict[str, PlacedPiece]:
        """The largest piece of each segment, its beam, which the others follow."""
        found: dict[str, PlacedPiece] = {}
        for placed in sorted(self.car.placed, key=lambda one: -piece_area_mm2(self.pieces[one.piece])):
            if placed.body.startswith("segment"):
                found.setdefault(placed.body, placed)
        return found

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
        final = np.array(part.pose)
        base = self.bases.get(part.body)
        if base is None:
            return final
        piece = self.pieces[base.piece]
        whole, now = face_poses(piece), face_poses(piece, folds.get(piece.name, {}))
        still = self._still(base)
        root = np.array(base.pose) @ whole[still] @ np.linalg.inv(now[still])
        face = self.face_under(part)
        if part is base or face is None:
            return np.array(root) if part is base else final
        return np.array(root @ now[face] @ np.linalg.inv(np.array(base.pose) @ whole[face]) @ final)

    def face_under(self, part: Part) -> str | None:
        """The face of its body's base that a part is fixed to; None without one."""
        base = self.bases.get(part.body)
        if base is None:
            return None
        piece = self.pieces[base.piece]
        names = [face.name for face in piece.faces]
        if isinstance(part, Mount):
            return part.face if part.face in names else None
        return self._lies_on(base, piece, part) or self._joined_to(piece, part)

    def _lies_on(self, base: PlacedPiece, piece: Piece, part: PlacedPiece) -> str | None:
        """The face of the base that the root face of a layer lies on."""
        root = np.array(part.pose)
        middle = root @ np.array([*np.array(self.pieces[part.piece].faces[0].outline_mm).mean(axis=0), 0.0, 1.0])
        poses = face_poses(piece)
        for face in piece.faces:
            at = np.array(base.pose) @ poses[face.name]
            x, y, z, _ = np.linalg.inv(at) @ middle
            (low_x, low_y), (high_x, high_y) = np.min(face.outline_mm, axis=0), np.max(face.outline_mm, axis=0)
            inside = low_x < x < high_x and low_y < y < high_y and abs(z) < LAYER_MM
            if inside and face.role == "panel" and abs(float(root[:3, 2] @ at[:3, 2])) > PARALLEL:
                return face.name
        return None

    def _joined_to(self, piece: Piece, part: PlacedPiece) -> str | None:
        """The face of the base nearest to its root among those that the part is joined to."""
        faces = {j.b.face for j in self.car.joins if (j.piece_a, j.piece_b) == (part.piece, piece.name)}
        faces |= {j.a.face for j in self.car.joins if (j.piece_b, j.piece_a) == (part.piece, piece.name)}
        return next((face.name for face in piece.faces if face.name in faces), None)

    def _still(self, base: PlacedPiece) -> str:
        """The face of a base that stays where it is: the lowest of its level panels."""
        piece = self.pieces[base.piece]
        poses = {name: np.array(base.pose) @ at for name, at in face_poses(piece).items()}
        level = [f.name for f in piece.faces if f.role == "panel" and abs(poses[f.name][2, 2]) > PARALLEL]
        return min(level or [piece.faces[0].name], key=lambda name: float(poses[name][2, 3]))

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
