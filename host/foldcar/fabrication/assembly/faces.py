"""Poses, points and triangles of a folded piece's faces, in millimetres; the material of a bought part."""

import itertools
from collections.abc import Mapping
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from foldcar.car.folded.model import Face, Mount, Piece
from foldcar.car.folded.pose import folded
from foldcar.car.folded.weight import area_mm2

Matrix = NDArray[np.float64]
# 0 is flat, 1 folded: one number for a piece, or one for each crease by its name (0 for those not named).
Fraction = float | Mapping[str, float]
Material = Literal["film", "tyre", "servo", "board", "battery", "other"]
# The material by the first of these words that occurs in the part's name in the catalogue.
MATERIAL_OF: dict[str, Material] = {
    "featherwing": "board", "servo": "servo", "aa": "battery", "lipo": "battery", "feather": "board", "tyre": "tyre",
}  # fmt: skip


def face_poses(piece: Piece, fraction: Fraction = 1.0) -> dict[str, Matrix]:
    """Return the (4, 4) poses of all faces by name, in the root face's frame."""
    return {name: np.array(pose) for name, pose in folded(piece, fraction).items()}


def moved(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points, (n, 2) or (n, 3), transformed by the pose, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    result: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
    return result


def glued_offset_mm(piece: Piece, fraction: Fraction = 1.0) -> dict[str, float]:
    """Return how far (mm) each tab that is taped to another face is moved along its normal, by the name of the tab.

    A folded tab would lie in the plane of the other face. It is moved inwards by the thickness of the film, times the
    ``fraction`` to which its fold is closed: one number for all folds, or a number by the name of the fold.
    """
    tabs = {face.name for face in piece.faces if face.role == "tab"}
    offsets = {}
    for crease in piece.creases:
        if crease.child.face in tabs:
            closed = fraction.get(crease.name, 0.0) if isinstance(fraction, Mapping) else fraction
            direction = 1 if crease.angle_rad > 0 else -1
            offsets[crease.child.face] = piece.thickness_mm * direction * closed
    return offsets


def face_points(face: Face) -> tuple[NDArray[np.float64], list[int]]:
    """Return all points of a face (n, 2), and where each of its rings ends.

    The first ring is the outline, and the others are the holes. The end of a ring is the index after its last point.
    """
    rings = [np.array(ring, dtype=np.float64) for ring in (face.outline_mm, *(hole.outline_mm for hole in face.holes))]
    return np.concatenate(rings), list(np.cumsum([len(ring) for ring in rings]))


def face_triangles(face: Face) -> NDArray[np.int64]:
    """Divide a face into triangles. Return the indices of their corners (m, 3) in the points of :func:`face_points`.

    The corners run counter-clockwise as seen from the printed side. Every point of the face is a corner of a triangle,
    also a point in the middle of a straight edge. A neighbouring face has a corner there, so there must be no gap.
    """
    points, ends = face_points(face)
    holes = [points[start:end] for start, end in itertools.pairwise(ends)]
    polygon = Polygon(points[: ends[0]], holes)
    index_of = {(x, y): index for index, (x, y) in enumerate(points.tolist())}
    triangles = []
    for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)):
        # The outline of a triangle has four points, because the last one repeats the first.
        a, b, c, _ = triangle.exterior.coords
        indices = [index_of[corner] for corner in (a, b, c)]
        # Twice the signed area of the triangle, which is negative if its corners run clockwise.
        doubled_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        triangles.append(indices[::-1] if doubled_area < 0 else indices)
    return np.array(triangles, dtype=np.int64)


def piece_area_mm2(piece: Piece) -> float:
    """Return the area of film in one copy of the piece (mm²)."""
    outlines = [(face.outline_mm, [hole.outline_mm for hole in face.holes]) for face in piece.faces]
    return sum(abs(area_mm2(outer)) - sum(abs(area_mm2(hole)) for hole in holes) for outer, holes in outlines)


def mount_material(mount: Mount) -> Material:
    """Return the material of a bought part."""
    name = mount.part.lower()
    return next((material for word, material in MATERIAL_OF.items() if word in name), "other")
