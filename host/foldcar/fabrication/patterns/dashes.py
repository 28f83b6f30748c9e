"""A fold as a row of cuts with bridges between them, because cutters ignore dashed line styles."""

import math
from collections.abc import Iterator

import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from foldcar.fabrication.patterns.drawing import Point

# No machine cuts less in one piece.
SHORTEST_CUT_MM = 0.3
# A fold with no room for a cut between its ends' films has one of this share of its length, but none below this length:
# a fold so short bends without one.
SHORT_FOLD_SHARE = 1 / 3
LEAST_CUT_MM = 1.0

Cut = tuple[Point, Point]


def dashes(
    a: Point, b: Point, cut_mm: float, bridge_mm: float, kerf_mm: float = 0.0, taken: BaseGeometry | None = None
) -> list[Cut]:
    """The cuts along the fold from ``a`` to ``b``, outside of ``taken``: other cuts and the film that they must keep.

    Without ``taken`` the fold has a bridge at both ends. The finished cuts, kerf included, have the length ``cut_mm``;
    bridges are at least ``bridge_mm``, equal between two cuts. A short fold has a shorter cut, a tiny one none.
    """
    length = math.dist(a, b)

    def at(distance: float) -> Point:
        share = distance / length
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    free = [(bridge_mm, length - bridge_mm)] if taken is None else list(_free(a, b, taken))
    cuts = [cut for low, high in free for cut in _row(low, high, cut_mm, bridge_mm)]
    half = length * SHORT_FOLD_SHARE / 2
    if not cuts and 2 * half >= LEAST_CUT_MM:
        cuts = [(length / 2 - half, length / 2 + half)]
    # The beam or blade is as wide as the kerf at both ends of its way.
    trims = ((low, high, min(kerf_mm, (high - low) / 2) / 2) for low, high in cuts)
    return [(at(low + trim), at(high - trim)) for low, high, trim in trims]


def _free(a: Point, b: Point, taken: BaseGeometry) -> Iterator[tuple[float, float]]:
    """The parts of the fold outside of ``taken`` by their distances from ``a`` (mm)."""
    for part in shapely.get_parts(LineString([a, b]).difference(taken)):
        if part.length > 0:
            low, high = sorted(math.dist(a, p) for p in (part.coords[0], part.coords[-1]))
            yield low, high


def _row(low: float, high: float, cut_mm: float, bridge_mm: float) -> Iterator[tuple[float, float]]:
    """Cuts from ``low`` to ``high``, the first and last at the ends; a single one in the middle."""
    room = high - low
    count = math.floor((room + bridge_mm) / (cut_mm + bridge_mm) + 1e-9)
    if count < 2:
        cut = min(cut_mm, room)
        if cut >= SHORTEST_CUT_MM:
            yield (low + high - cut) / 2, (low + high + cut) / 2
        return
    step = (room - cut_mm) / (count - 1)
    for i in range(count):
        yield low + i * step, low + i * step + cut_mm
