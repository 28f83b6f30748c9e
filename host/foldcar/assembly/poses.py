"""Where the faces of a piece are when it is folded: flat, half-way or as assembled.

Input: a Piece and how far it is folded. Output: 4x4 matrices from each face's frame to the root face's frame, in
millimetres. All creases fold together, each in proportion to its assembled angle.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from foldcar.sheet.model import Crease, Face, Piece, Point

Matrix = NDArray[np.float64]


def face_poses(piece: Piece, fraction: float | Mapping[str, float] = 1.0) -> dict[str, Matrix]:
    """Pose of every face by name, in the root face's frame.

    ``fraction`` is 0 for flat and 1 for folded; a mapping gives it by the crease's name, 0 where it has none.
    """
    faces = {face.name: face for face in piece.faces}
    poses = {piece.faces[0].name: np.eye(4)}
    waiting = list(piece.creases)
    while waiting:
        ready = [crease for crease in waiting if crease.parent.face in poses]
        for crease in ready:
            share = fraction.get(crease.name, 0.0) if isinstance(fraction, Mapping) else fraction
            fold = turn_about_crease(faces[crease.parent.face], crease, share * crease.angle_rad)
            poses[crease.child.face] = poses[crease.parent.face] @ fold @ flat_step(faces, crease)
        waiting = [crease for crease in waiting if crease not in ready]
    return poses


def flat_step(faces: Mapping[str, Face], crease: Crease) -> Matrix:
    """From the child's frame to the parent's with the crease flat: the shared edges lie on each other."""
    a, b = edge_points(faces[crease.parent.face], crease.parent.index)
    c, d = edge_points(faces[crease.child.face], crease.child.index)
    turn = math.atan2(a[1] - b[1], a[0] - b[0]) - math.atan2(d[1] - c[1], d[0] - c[0])
    cos, sin = math.cos(turn), math.sin(turn)
    step = np.eye(4)
    step[:2, :2] = [[cos, -sin], [sin, cos]]
    step[:2, 3] = np.array(b) - step[:2, :2] @ np.array(c)
    return step


def turn_about_crease(parent: Face, crease: Crease, angle_rad: float) -> Matrix:
    """The rotation that folds the child by ``angle_rad``, positive towards the parent's printed side."""
    a, b = (np.array([*point, 0.0]) for point in edge_points(parent, crease.parent.index))
    # The child lies to the right of the parent's edge, so it rises when it turns about the reversed edge.
    x, y, _ = (a - b) / np.linalg.norm(a - b)
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    turn = np.eye(4)
    turn[:3, :3] = [
        [cos + x * x * (1 - cos), x * y * (1 - cos), y * sin],
        [x * y * (1 - cos), cos + y * y * (1 - cos), -x * sin],
        [-y * sin, x * sin, cos],
    ]
    turn[:3, 3] = a - turn[:3, :3] @ a
    return turn


def edge_points(face: Face, index: int) -> tuple[Point, Point]:
    """Ends of edge ``index`` of a face."""
    outline = face.outline_mm
    return outline[index % len(outline)], outline[(index + 1) % len(outline)]


def moved(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) or (n, 3) after the pose, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    result: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
    return result
