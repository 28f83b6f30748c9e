"""Poses of a piece's faces as matrices, in millimetres."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import Piece
from foldcar.car.folded.pose import folded

Matrix = NDArray[np.float64]


# 0 is flat, 1 folded: one number for a piece, or one for each crease by its name (0 for those not named).
Fraction = float | Mapping[str, float]


def face_poses(piece: Piece, fraction: Fraction = 1.0) -> dict[str, Matrix]:
    """The (4, 4) poses of all faces by name, in the root face's frame."""
    if isinstance(fraction, Mapping):
        creases = tuple(replace(c, angle_rad=c.angle_rad * fraction.get(c.name, 0.0)) for c in piece.creases)
        piece, fraction = replace(piece, creases=creases), 1.0
    return {name: np.array(pose) for name, pose in folded(piece, fraction).items()}


def share_of(fraction: Fraction, crease: str) -> float:
    """The fraction of one crease."""
    return fraction.get(crease, 0.0) if isinstance(fraction, Mapping) else fraction


def moved(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) or (n, 3) transformed by the pose, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    result: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
    return result


def glued_offset_mm(piece: Piece, fraction: Fraction = 1.0) -> dict[str, float]:
    """Offset of each tab from its middle plane (mm) when it is fixed to the inside of another face."""
    tabs = {face.name for face in piece.faces if face.role == "tab"}
    return {
        crease.child.face: piece.thickness_mm * (1 if crease.angle_rad > 0 else -1) * share_of(fraction, crease.name)
        for crease in piece.creases
        if crease.child.face in tabs
    }
