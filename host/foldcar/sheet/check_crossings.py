"""Checks that no film runs through other film when the car is folded, except where a slot lets it.

Input: placed faces of one body. Output: findings.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.sheet.finding import Finding
from foldcar.sheet.placed import PlacedFace

# Faces that meet at edges are shrunk by this before they are looked at.
SHRINK_MM = 0.3
LEAST_MM = 0.2
PARALLEL = 1e-3


def check_crossings(faces: Sequence[PlacedFace]) -> Iterator[Finding]:
    """Each pair of faces that crosses, once."""
    low = np.array([face.corners_mm.min(axis=0) for face in faces]) + SHRINK_MM / 2
    high = np.array([face.corners_mm.max(axis=0) for face in faces]) - SHRINK_MM / 2
    # Flat boxes stay as they are.
    low, high = np.minimum(low, high), np.maximum(low, high)
    normals = np.array([face.normal for face in faces])
    for i, face in enumerate(faces):
        near = (low[i + 1 :] <= high[i]).all(axis=1) & (high[i + 1 :] >= low[i]).all(axis=1)
        near &= np.linalg.norm(np.cross(normals[i + 1 :], normals[i]), axis=1) > PARALLEL
        for k in np.flatnonzero(near) + i + 1:
            length = _crossing_mm(face, faces[k])
            if length > LEAST_MM:
                yield Finding("crossing", face.title, f"runs through {faces[k].title} over {length:.2f} mm")


def _crossing_mm(a: PlacedFace, b: PlacedFace) -> float:
    """Length of the line along which the insides of two faces cross."""
    heights_a, heights_b = b.in_face(a.corners_mm)[:, 2], a.in_face(b.corners_mm)[:, 2]
    # One that lies on one side of the other cannot cross it.
    if any(h.min() > -SHRINK_MM or h.max() < SHRINK_MM for h in (heights_a, heights_b)):
        return 0.0
    direction = np.cross(a.normal, b.normal)
    direction /= np.linalg.norm(direction)
    # A point of both planes.
    origin_a, origin_b = a.matrix[:3, 3], b.matrix[:3, 3]
    equations = np.array([a.normal, b.normal, direction])
    values = np.array([a.normal @ origin_a, b.normal @ origin_b, direction @ origin_a])
    through = np.linalg.solve(equations, values)
    first, second = (_inside(face, through, direction) for face in (a, b))
    return float(first.intersection(second).length)


def _inside(face: PlacedFace, through: NDArray[np.float64], direction: NDArray[np.float64]) -> shapely.Geometry:
    """Where along the line it is inside the shrunk face: intervals on an axis."""
    reach = 2 * float(np.abs(face.corners_mm - through).max()) + 10
    ends = face.in_face(np.array([through - reach * direction, through + reach * direction]))[:, :2]
    line = shapely.LineString(ends)
    shape = face.polygon.buffer(-SHRINK_MM)
    parts = shapely.get_parts(line.intersection(shape))
    spans = [sorted(line.project(shapely.Point(p)) - reach for p in part.coords[:: len(part.coords) - 1]) for part in parts
             if part.length > 0]  # fmt: skip
    return shapely.union_all([shapely.LineString([(start, 0), (end, 0)]) for start, end in spans])
