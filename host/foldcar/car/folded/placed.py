"""A folded car's faces in space, the input of the checks: polygon, pose, corner points.

Input: a FoldedCar. Output: placed faces by body; wheels of a unit are equal, so by default only the first is placed.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.model import Face, FoldedCar, Piece, Point, Pose
from foldcar.car.folded.pose import compose, folded


@dataclass(frozen=True)
class PlacedFace:
    """A face of one copy of a piece, with its pose in the car (mm)."""

    piece: Piece
    copy: int
    body: str
    face: Face
    pose: Pose

    @property
    def title(self) -> str:
        """The readable name: piece and face."""
        return f"{self.piece.name}: {self.face.name}"

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The pose, (4, 4), in mm."""
        return np.array(self.pose)

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """Outline and holes (mm) in the face's frame."""
        return polygon(self.face)

    @cached_property
    def corners_mm(self) -> NDArray[np.float64]:
        """The outline's points in the car's frame, (n, 3), in mm."""
        return self.in_car(self.face.outline_mm)

    def edge_mm(self, index: int) -> NDArray[np.float64]:
        """Return the ends of an edge of the outline in the car's frame, (2, 3), in mm."""
        return self.corners_mm[[index, (index + 1) % len(self.corners_mm)]]

    @property
    def normal(self) -> NDArray[np.float64]:
        """The unit normal of the printed side in the car's frame, (3,)."""
        return self.matrix[:3, 2]

    def in_car(self, points: Iterable[Point]) -> NDArray[np.float64]:
        """Return points (x, y) of the face's plane in the car's frame, (n, 3), in mm."""
        flat = np.array(list(points), dtype=np.float64)
        moved: NDArray[np.float64] = flat @ self.matrix[:3, :2].T + self.matrix[:3, 3]
        return moved

    def in_face(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of the car, (n, 3) in mm, in the face's frame: z is their height above the face."""
        return (points - self.matrix[:3, 3]) @ self.matrix[:3, :3]


# Placed faces by the body's name.
Bodies = Mapping[str, Sequence[PlacedFace]]


def polygon(face: Face) -> shapely.Polygon:
    """Return a face's outline with its holes (mm); an invalid outline, which check_flat reports, is made valid."""
    shape = shapely.Polygon(face.outline_mm, [hole.outline_mm for hole in face.holes])
    return shape if shape.is_valid else shape.buffer(0)


def place(car: FoldedCar, bodies: Collection[str] = ()) -> dict[str, list[PlacedFace]]:
    """Return the placed faces of ``bodies``, by body. By default these are all segments and the first wheel of each unit.

    A face beyond a flexure belongs to the segment behind it.
    """
    pieces = {piece.name: piece for piece in car.pieces}
    rear_of_front = {hinge.front: hinge.rear for hinge in car.hinges}
    on_wheels = [placed for placed in car.placed if placed.body.startswith("wheel")]
    # The wheels of a unit are copies of the same pieces: the first stands for all. In reverse, it overwrites the others.
    first_wheel = {placed.piece: placed.body for placed in reversed(on_wheels)}
    skipped_wheels = {placed.body for placed in on_wheels} - set(first_wheel.values())
    shapes: dict[str, dict[str, Pose]] = {}
    placed: dict[str, list[PlacedFace]] = {}
    for copy in car.placed:
        piece = pieces[copy.piece]
        body_of_face = {piece.faces[0].name: copy.body}
        for crease in piece.creases:
            body = body_of_face[crease.parent.face]
            body_of_face[crease.child.face] = rear_of_front.get(body, body) if crease.flexure else body
        if bodies:
            faces = [face for face in piece.faces if body_of_face[face.name] in bodies]
        else:
            faces = [] if copy.body in skipped_wheels else list(piece.faces)
        if faces and piece.name not in shapes:
            shapes[piece.name] = folded(piece)
        for face in faces:
            body, pose = body_of_face[face.name], compose(copy.pose, shapes[piece.name][face.name])
            placed.setdefault(body, []).append(PlacedFace(piece, copy.copy, body, face, pose))
    return placed


@dataclass(frozen=True, slots=True)
class Finding:
    """One defect: the check that found it, its place, and a message with value and limit."""

    check: str
    place: str
    message: str

    def __str__(self) -> str:
        return f"{self.check}: {self.place}: {self.message}"
