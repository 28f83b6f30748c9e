"""Triangulates a face with its holes, using the points of outline and holes only."""

import itertools

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from foldcar.car.folded.model import Face


def face_points(face: Face) -> tuple[NDArray[np.float64], list[int]]:
    """Points (n, 2) of outline and holes in sequence, and the end index of each of these rings."""
    rings = [np.array(face.outline_mm, dtype=np.float64)]
    rings += [np.array(hole.outline_mm, dtype=np.float64) for hole in face.holes]
    return np.concatenate(rings), list(np.cumsum([len(ring) for ring in rings]))


def face_triangles(face: Face) -> NDArray[np.int64]:
    """Indices (m, 3) into ``face_points``, counter-clockwise seen from the printed side.

    Every point is a corner of a triangle, also one inside a straight edge, because neighbouring faces share it.
    """
    points, ends = face_points(face)
    polygon = Polygon(points[: ends[0]], [points[a:b] for a, b in itertools.pairwise(ends)])
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    number = {(x, y): i for i, (x, y) in enumerate(points.tolist())}
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3].tolist()
    triangles = np.array([[number[x, y] for x, y in triangle] for triangle in corners], dtype=np.int64)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return triangles
