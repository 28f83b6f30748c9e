"""Offsets each edge of a polygon inwards by its own distance; corners stay sharp."""

import math
from collections.abc import Sequence

from foldcar.fabrication.patterns.drawing import Point

# Two edges with a smaller sine of their angle are collinear.
PARALLEL = 1e-6


def offset_edges(outline_mm: Sequence[Point], inward_mm: Sequence[float]) -> list[list[Point]]:
    """The corner points after edge i (from corner i to i + 1) moved by ``inward_mm[i]``, outline counter-clockwise.

    One point per corner; two where collinear edges move by different distances, the first on the edge that ends there.
    """
    count = len(outline_mm)
    lines = []
    for i in range(count):
        (ax, ay), (bx, by) = outline_mm[i], outline_mm[(i + 1) % count]
        length = math.hypot(bx - ax, by - ay)
        ux, uy = (bx - ax) / length, (by - ay) / length
        nx, ny = -uy * inward_mm[i], ux * inward_mm[i]
        lines.append(((ax + nx, ay + ny), (bx + nx, by + ny), (ux, uy)))
    corners: list[list[Point]] = []
    for i in range(count):
        _, end, before = lines[i - 1]
        start, _, after = lines[i]
        cross = before[0] * after[1] - before[1] * after[0]
        if abs(cross) < PARALLEL:
            same = math.dist(end, start) < PARALLEL
            corners.append([end] if same else [end, start])
            continue
        along = ((start[0] - end[0]) * after[1] - (start[1] - end[1]) * after[0]) / cross
        corners.append([(end[0] + along * before[0], end[1] + along * before[1])])
    return corners
