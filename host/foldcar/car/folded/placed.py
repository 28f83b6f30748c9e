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


def placed_faces(car: FoldedCar, bodies: Collection[str] = ()) -> dict[str, list[PlacedFace]]:
    """Return the faces of the rigid bodies with these names, with their poses in the car, by body.

    Without ``bodies``, these are the faces of all segments, and of one wheel of each unit. A *unit* is a group of equal
    wheels, so one of them stands for all. The strip of a hinge is one piece of two bodies: its front half belongs to the
    segment before the hinge, and its rear half to the segment behind it.
    """
    pieces = {piece.name: piece for piece in car.pieces}
    skipped = set() if bodies else _repeated_wheels(car)
    poses_of_piece: dict[str, dict[str, Pose]] = {}
    placed: dict[str, list[PlacedFace]] = {}
    for copy in car.placed:
        if copy.body in skipped:
            continue
        piece = pieces[copy.piece]
        body_of_face = _bodies_of_faces(car, piece, copy.body)
        for face in piece.faces:
            body = body_of_face[face.name]
            if bodies and body not in bodies:
                continue
            if piece.name not in poses_of_piece:
                poses_of_piece[piece.name] = folded(piece)
            pose = compose(copy.pose, poses_of_piece[piece.name][face.name])
            placed.setdefault(body, []).append(PlacedFace(piece, copy.copy, body, face, pose))
    return placed


def _repeated_wheels(car: FoldedCar) -> set[str]:
    """Return the wheels that are not the first of their unit. The wheels of a unit are copies of the same pieces."""
    first_wheel: dict[str, str] = {}
    wheels = set()
    for placed in car.placed:
        if placed.body.startswith("wheel"):
            wheels.add(placed.body)
            first_wheel.setdefault(placed.piece, placed.body)
    return wheels - set(first_wheel.values())


def _bodies_of_faces(car: FoldedCar, piece: Piece, body: str) -> dict[str, str]:
    """Return the body of each face of a piece, by the face's name. The first face belongs to ``body``."""
    rear_of_front = {hinge.front: hinge.rear for hinge in car.hinges}
    body_of_face = {piece.faces[0].name: body}
    for crease in piece.creases:
        parent_body = body_of_face[crease.parent.face]
        is_hinge = crease.flexure and parent_body in rear_of_front
        body_of_face[crease.child.face] = rear_of_front[parent_body] if is_hinge else parent_body
    return body_of_face


@dataclass(frozen=True, slots=True)
class Finding:
    """One defect: the check that found it, its place, and a message with value and limit."""

    check: str
    place: str
    message: str

    def __str__(self) -> str:
        return f"{self.check}: {self.place}: {self.message}"
