"""Shapes of the guide's pictures: one body of the car, partly folded, with the parts fixed to each face.

Input: a FoldedCar, the name of a body (``segment0``, ``wheel0``). Output: Shapes in the car's frame.
"""

from collections.abc import Callable, Iterable

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, Piece, PlacedPiece, Pose
from foldcar.fabrication.assembly.facets import Shape, film_shape, mount_shape, together
from foldcar.fabrication.assembly.hidden_surfaces import Camera, Vector, camera
from foldcar.fabrication.assembly.poses import Matrix, face_poses
from foldcar.fabrication.assembly.skin import piece_area_mm2

PARALLEL = 0.999
FROM_FRONT = camera(38, 30)


class Body:
    """One rigid body: its base piece, other pieces with the base's face they are fixed to, bought parts."""

    def __init__(self, folded: FoldedCar, name: str) -> None:
        self.folded, self.name = folded, name
        self.pieces = {piece.name: piece for piece in folded.pieces}
        self.placed = [placed for placed in folded.placed if placed.body == name]
        self.mounts = [mount for mount in folded.mounts if mount.body == name]
        self.base = max(self.placed, key=lambda placed: piece_area_mm2(self.pieces[placed.piece]))
        self.base_piece = self.pieces[self.base.piece]
        self._flat_to_car = np.array(self.base.pose)
        self._assembled = face_poses(self.base_piece, 1.0)

    @property
    def others(self) -> list[PlacedPiece]:
        """The pieces fixed to the base."""
        return [placed for placed in self.placed if placed is not self.base]

    def base_shape(self, fraction: float = 1.0, creases: bool = True) -> Shape:
        """The base piece, folded by ``fraction`` (0 to 1)."""
        return film_shape(self.base_piece, self._flat_to_car, fraction, key(self.base), creases=creases)

    def piece_shape(
        self, placed: PlacedPiece, fraction: float = 1.0, apart: Vector | None = None, tabs: bool = True
    ) -> Shape:
        """Another piece, folded, at its pose with the base folded by ``fraction``; ``apart`` (mm) shifts it."""
        pose = self.follow(self.face_of(placed), placed.pose, fraction)
        if apart is not None:
            pose[:3, 3] += apart
        return film_shape(self.pieces[placed.piece], pose, 1.0, key(placed), tabs, creases=False)

    def mount_shapes(self, fraction: float = 1.0, wanted: Callable[[Mount], bool] = lambda mount: True) -> list[Shape]:
        """The bought parts for which ``wanted``, at their poses with the base folded by ``fraction``."""
        found = []
        for mount in self.mounts:
            if wanted(mount):
                face = mount.face if mount.face in self._assembled else None
                found.append(mount_shape(mount, self.follow(face, mount.pose, fraction)))
        return found

    def follow(self, face: str | None, pose: Pose, fraction: float) -> Matrix:
        """The pose of something fixed to that face, when the base is folded by ``fraction``."""
        if face is None:
            return np.array(pose)
        then = self._flat_to_car @ face_poses(self.base_piece, fraction)[face]
        now = self._flat_to_car @ self._assembled[face]
        return np.array(then @ np.linalg.inv(now) @ np.array(pose))

    def face_of(self, placed: PlacedPiece) -> str | None:
        """The face of the base on which a piece lies; None without one."""
        pose = np.array(placed.pose)
        nearest: tuple[float, str] | None = None
        for face in self.base_piece.faces:
            at = self._flat_to_car @ self._assembled[face.name]
            distance = abs(float((pose[:3, 3] - at[:3, 3]) @ at[:3, 2]))
            if face.role == "panel" and abs(float(pose[:3, 2] @ at[:3, 2])) > PARALLEL and distance < 1.0:
                nearest = min(nearest or (distance, face.name), (distance, face.name))
        return nearest[1] if nearest else None


def key(placed: PlacedPiece) -> str:
    """The prefix of the keys of a copy's facets."""
    return f"{placed.piece} {placed.copy} "


def outside(shape: Shape, view: Camera) -> Shape:
    """The visible faces of closed film: those whose printed side, which is inside, faces away from the camera."""
    facets = tuple(facet for facet in shape.facets if facet.normal @ view.toward < 0)
    return Shape(facets, shape.lines, shape.materials)


def whole_car(folded: FoldedCar, view: Camera, apart_mm: float = 0.0) -> Shape:
    """The closed car from outside: film without tabs, servos; wheels moved sideways by ``apart_mm``."""
    pieces = {piece.name: piece for piece in folded.pieces}
    sides = {axle.wheel: 1.0 if axle.side == "left" else -1.0 for axle in folded.axles}
    shapes = []
    for placed in folded.placed:
        pose = np.array(placed.pose)
        pose[1, 3] += apart_mm * sides.get(placed.body, 0.0)
        film = film_shape(pieces[placed.piece], pose, 1.0, key(placed), tabs=False, creases=False)
        shapes.append(outside(film, view))
    driving = {axle.servo for axle in folded.axles}
    shapes += [mount_shape(mount) for mount in folded.mounts if mount.name in driving]
    return together(shapes)


def same_shapes(pieces: Iterable[Piece]) -> list[list[Piece]]:
    """Pieces in groups of equal geometry."""
    groups: dict[object, list[Piece]] = {}
    for piece in pieces:
        outlines = tuple(
            (face.outline_mm, tuple(hole.outline_mm for hole in face.holes)) for face in piece.faces
        )
        order = {face.name: i for i, face in enumerate(piece.faces)}
        folds = tuple((order[c.parent.face], c.parent.index, order[c.child.face], c.angle_rad) for c in piece.creases)
        groups.setdefault((outlines, folds), []).append(piece)
    return list(groups.values())
