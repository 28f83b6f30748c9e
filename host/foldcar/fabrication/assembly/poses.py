"""Poses of a piece's faces as matrices, in millimetres."""

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.folding import folded
from foldcar.car.folded.model import Piece

Matrix = NDArray[np.float64]


def face_poses(piece: Piece, fraction: float = 1.0) -> dict[str, Matrix]:
    """The (4, 4) poses of all faces by name, in the root face's frame; ``fraction``: 0 is flat, 1 folded."""
    return {name: np.array(pose) for name, pose in folded(piece, fraction).items()}


def moved(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) or (n, 3) transformed by the pose, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    result: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
    return result


def glued_offset_mm(piece: Piece) -> dict[str, float]:
    """Offset of each tab from its middle plane (mm) when it is glued onto the inside of another face."""
    tabs = {face.name for face in piece.faces if face.role == "tab"}
    return {
        crease.child.face: piece.thickness_mm * (1 if crease.angle_rad > 0 else -1)
        for crease in piece.creases
        if crease.child.face in tabs
    }
