"""The film that is left between two cuts of a piece: a bridge too narrow tears while it is cut or folded.

Input: a FlatPiece and Options. Output: the fold's cuts, which keep their distance, and the narrowest film of the piece.
The bridges between the cuts of one fold are an option of their own (``dash_bridge_mm``) and not counted.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import shapely
from shapely.geometry import LineString, MultiLineString, Polygon
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry.base import BaseGeometry

from foldcar.fabrication.patterns.dashes import Cut, dashes
from foldcar.fabrication.patterns.drawing import Point
from foldcar.fabrication.patterns.flat_piece import FlatPiece, Fold
from foldcar.fabrication.patterns.options import LEAST_FILM_MM, Options

EDGE, SLIT, DASHES = "its edge", "a slit", "a fold's dashes"
# What is as wide as the film between a fold's cuts, which is creased, does not tear while it is weeded.
NARROW_FILM_MM = 1.0
# Beside rounding errors of the buffers' arcs.
ROUNDING_MM = 0.01


@dataclass(frozen=True, slots=True)
class Film:
    """The narrowest film of a piece (mm), what it lies between, and where in the piece's frame."""

    width_mm: float
    between: tuple[str, str]
    at_mm: Point

    @property
    def narrow(self) -> bool:
        """Whether it may tear."""
        return self.width_mm < NARROW_FILM_MM - ROUNDING_MM

    @property
    def of_part(self) -> bool:
        """Whether it lies between two openings for bought parts, whose measures it follows from."""
        return not {EDGE, SLIT, DASHES} & {*self.between}


def fold_cuts(flat: FlatPiece, chosen: Options) -> tuple[tuple[Fold, tuple[Cut, ...]], ...]:
    """Each fold that is cut, with its cuts, which keep ``LEAST_FILM_MM`` from all other cuts of the piece."""
    if chosen.fold != "dash":
        return ()
    lines = [flat.outline.boundary, *(hole for _, hole in _openings(flat)), *(LineString(slit) for slit in flat.slits)]
    taken = shapely.union_all(lines).buffer(LEAST_FILM_MM + chosen.kerf_mm / 2, quad_segs=16)
    shapely.prepare(taken)
    return tuple(
        (fold, tuple(dashes(fold.a, fold.b, chosen.dash_cut_mm, chosen.dash_bridge_mm, chosen.kerf_mm, taken)))
        for fold in flat.folds
        if fold.kind != "flexure"
    )


def narrowest_film(flat: FlatPiece, chosen: Options) -> Film | None:
    """The narrowest film between two cuts; None for a piece with one cut."""
    half = chosen.kerf_mm / 2
    cuts: list[tuple[str, BaseGeometry, float]] = [(EDGE, flat.outline.exterior, 0.0)]
    cuts += [(name, hole, 0.0) for name, hole in _openings(flat)]
    cuts += [(SLIT, LineString(slit), half) for slit in flat.slits]
    cuts += [(DASHES, MultiLineString(cut), half) for _, cut in fold_cuts(flat, chosen) if cut]
    shapes, widths = [shape for _, shape, _ in cuts], [width for *_, width in cuts]
    best = None
    for i, shape in enumerate(shapes[:-1]):
        apart = shapely.distance(shape, shapes[i + 1 :])
        for k, distance in enumerate(apart.tolist(), i + 1):
            # Slits begin at edges and folds.
            if SLIT in (cuts[i][0], cuts[k][0]) and distance < ROUNDING_MM:
                continue
            width = distance - widths[i] - widths[k]
            if best is None or width < best[0]:
                best = (width, i, k)
    if best is None:
        return None
    width, i, k = best
    middle = shapely.shortest_line(shapes[i], shapes[k]).centroid
    return Film(width, (cuts[k][0], cuts[i][0]), (float(middle.x), float(middle.y)))


def _openings(flat: FlatPiece) -> Iterator[tuple[str, BaseGeometry]]:
    """Name and area of every opening and round hole."""
    named = [(name.rpartition(".")[2], Polygon([a for a, _ in ring]).centroid)
             for face in flat.faces for name, ring in face.holes.items()]  # fmt: skip

    def name(middle: ShapelyPoint) -> str:
        return min(named, key=lambda one: float(one[1].distance(middle)), default=("a hole", middle))[0]

    for ring in flat.outline.interiors:
        yield name(Polygon(ring).centroid), Polygon(ring)
    for (x, y), diameter in flat.circles:
        middle = ShapelyPoint(x, y)
        yield name(middle), middle.buffer(diameter / 2, quad_segs=32)
