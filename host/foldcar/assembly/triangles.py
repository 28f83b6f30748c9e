"""Triangles of a face with its holes: points of the outline, then those of each hole; no others."""

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from foldcar.sheet.model import Face


def face_points(face: Face) -> tuple[NDArray[np.float64], list[int]]:
    """Points (n, 2) of outline and holes one after the other, and the end index of each of these rings."""
    rings = [np.array(face.outline_mm, dtype=np.float64)]
    rings += [np.array(hole.outline_mm, dtype=np.float64) for hole in face.holes]
    return np.concatenate(rings), list(np.cumsum([len(ring) for ring in rings]))


def face_triangles(face: Face) -> NDArray[np.int64]:
    """Indices (m, 3) into ``face_points``, counter-clockwise seen from the printed side."""
    points, ends = face_points(face)
    found = mapbox_earcut.triangulate_float64(points, np.array(ends, dtype=np.uint32))
    triangles = np.asarray(found, dtype=np.int64).reshape(-1, 3)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return triangles
