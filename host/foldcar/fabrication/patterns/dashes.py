"""A fold as a row of cuts with bridges between them, because cutters ignore dashed line styles."""

import math

from foldcar.fabrication.patterns.drawing import Point


def dashes(a: Point, b: Point, cut_mm: float, bridge_mm: float, kerf_mm: float = 0.0) -> list[tuple[Point, Point]]:
    """The cuts along the fold from ``a`` to ``b``, with a bridge at both ends.

    The finished cuts, kerf included, have the length ``cut_mm``; bridges are at least ``bridge_mm`` and equal. A fold
    too short for one cut gets one of half its length.
    """
    length = math.dist(a, b)
    count = math.floor((length - bridge_mm) / (cut_mm + bridge_mm) + 1e-9)
    if count < 1:
        count, cut_mm = 1, length / 2
    bridge_mm = (length - count * cut_mm) / (count + 1)
    drawn = max(cut_mm - kerf_mm, cut_mm / 2)

    def at(distance: float) -> Point:
        share = distance / length
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    middles = [bridge_mm + cut_mm / 2 + i * (cut_mm + bridge_mm) for i in range(count)]
    return [(at(middle - drawn / 2), at(middle + drawn / 2)) for middle in middles]
