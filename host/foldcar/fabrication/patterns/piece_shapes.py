"""A flat piece as shapes on layers: kerf-compensated cuts, fold dashes or score lines, labels; its narrowest film.

Input: a FlatPiece and Options. Output: shapes; the narrowest film between two cuts, because a bridge too narrow tears
while it is cut or folded. The bridges between the cuts of one fold (``dash_bridge_mm``) are not counted.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import shapely
from shapely.geometry import LineString, MultiLineString, Polygon
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry.base import BaseGeometry

from foldcar.fabrication.patterns.drawing import Circle, LayerName, Path, Point, Shape
from foldcar.fabrication.patterns.flat_piece import FlatPiece, Fold
from foldcar.fabrication.patterns.labels import EdgeMark, label_paths
from foldcar.fabrication.patterns.options import MIN_FILM_MM, Options

FOLD_LAYERS: dict[str, LayerName] = {"mountain": "FOLD_MOUNTAIN", "valley": "FOLD_VALLEY"}
# The shortest cut that a machine makes.
MIN_CUT_MM = 0.3
# A fold without room for a cut between the films at its ends has a cut of this fraction of its length. A cut below the
# minimum is left out, because a fold so short bends without it.
SHORT_FOLD_FRACTION = 1 / 3
MIN_FOLD_CUT_MM = 1.0

Cut = tuple[Point, Point]
EDGE, SLIT, DASHES = "its edge", "a slit", "a fold's dashes"
# Film as wide as the bridges between a fold's cuts, which are creased, does not tear during weeding.
NARROW_FILM_MM = 1.0
# Rounding errors of the buffers' arcs.
ROUNDING_MM = 0.01


def piece_shapes(
    flat: FlatPiece, chosen: Options, marks: Iterable[EdgeMark], quarter_turns: int = 0
) -> tuple[list[Shape], list[str]]:
    """Return the piece's shapes in its own frame, with texts upright after the quarter turns, and warnings."""
    name = flat.label if flat.count == 1 else f"{flat.label} (x{flat.count})"
    labels, missing = label_paths(flat, name, marks, quarter_turns)
    warnings = [f'{flat.label}: no room for the label "{text}"' for text in missing]
    shapes: list[Shape] = list(labels)
    shapes += [Path("SCORE", mark) for mark in flat.marks]
    shapes += _folds(flat, chosen)
    shapes += cut_shapes(flat, chosen.kerf_mm)
    return shapes, warnings


def cut_shapes(flat: FlatPiece, kerf_mm: float) -> list[Shape]:
    """Return outline and openings, offset by half a kerf so that the cut piece has its nominal size."""
    half = kerf_mm / 2
    shapes: list[Shape] = [Circle("CUT_INNER", middle, diameter / 2 - half) for middle, diameter in flat.circles]
    shapes += [Path("CUT_INNER", slit) for slit in flat.slits]
    for ring in flat.outline.interiors:
        hole = Polygon(ring).buffer(-half, join_style="mitre", mitre_limit=3) if half else Polygon(ring)
        # An opening narrower than the kerf vanishes; part of it may remain.
        parts = [part for part in shapely.get_parts(hole) if not part.is_empty]
        shapes += [_path("CUT_INNER", part.exterior.coords[:-1]) for part in parts]
    return [*shapes, _path("CUT_OUTER", outer_cut(flat, kerf_mm).exterior.coords[:-1])]


def outer_cut(flat: FlatPiece, kerf_mm: float) -> Polygon:
    """The polygon along which the piece is cut out."""
    outer = Polygon(flat.outline.exterior)
    return outer.buffer(kerf_mm / 2, join_style="mitre", mitre_limit=3) if kerf_mm else outer


def _path(layer: LayerName, points: Iterable[tuple[float, ...]]) -> Path:
    return Path(layer, tuple((float(x), float(y)) for x, y in points), closed=True)


def _folds(flat: FlatPiece, chosen: Options) -> Iterator[Shape]:
    """Yield the lines or cuts of folds, and lines on the label layer for folds that are neither cut nor scored."""
    for fold in flat.folds:
        # A flexure is neither cut nor scored, which would weaken it; a line on the label layer shows its place.
        if fold.kind == "flexure":
            yield Path("LABEL", (fold.a, fold.b))
        elif chosen.fold == "score":
            yield Path(FOLD_LAYERS[fold.kind], (fold.a, fold.b))
    for fold, cuts in fold_cuts(flat, chosen):
        yield from (Path(FOLD_LAYERS[fold.kind], cut) for cut in cuts)
        if not cuts:
            yield Path("LABEL", (fold.a, fold.b))


def dashes(
    a: Point, b: Point, cut_mm: float, bridge_mm: float, kerf_mm: float = 0.0, occupied: BaseGeometry | None = None
) -> list[Cut]:
    """Return the cuts along the fold from ``a`` to ``b``, outside of ``occupied``: other cuts with the film around them.

    Without ``occupied`` the fold has a bridge at both ends. The finished cuts, kerf included, have the length ``cut_mm``;
    bridges are at least ``bridge_mm``, equal between two cuts. A short fold has a shorter cut, a tiny fold none.
    """
    length = math.dist(a, b)

    def at(distance: float) -> Point:
        fraction = distance / length
        return a[0] + fraction * (b[0] - a[0]), a[1] + fraction * (b[1] - a[1])

    free = [(bridge_mm, length - bridge_mm)] if occupied is None else list(_free(a, b, occupied))
    cuts = [cut for low, high in free for cut in _row(low, high, cut_mm, bridge_mm)]
    half = length * SHORT_FOLD_FRACTION / 2
    if not cuts and 2 * half >= MIN_FOLD_CUT_MM:
        cuts = [(length / 2 - half, length / 2 + half)]
    # The beam or blade is as wide as the kerf at both ends of its way.
    trims = ((low, high, min(kerf_mm, (high - low) / 2) / 2) for low, high in cuts)
    return [(at(low + trim), at(high - trim)) for low, high, trim in trims]


def _free(a: Point, b: Point, occupied: BaseGeometry) -> Iterator[tuple[float, float]]:
    """Yield the parts of the fold outside of ``occupied`` by their distances from ``a`` (mm)."""
    for part in shapely.get_parts(LineString([a, b]).difference(occupied)):
        if part.length > 0:
            low, high = sorted(math.dist(a, p) for p in (part.coords[0], part.coords[-1]))
            yield low, high


def _row(low: float, high: float, cut_mm: float, bridge_mm: float) -> Iterator[tuple[float, float]]:
    """Yield cuts from ``low`` to ``high``, the first and last at the ends; a single cut in the middle."""
    room = high - low
    count = math.floor((room + bridge_mm) / (cut_mm + bridge_mm) + 1e-9)
    if count < 2:
        cut = min(cut_mm, room)
        if cut >= MIN_CUT_MM:
            yield (low + high - cut) / 2, (low + high + cut) / 2
        return
    step = (room - cut_mm) / (count - 1)
    for i in range(count):
        yield low + i * step, low + i * step + cut_mm


@dataclass(frozen=True, slots=True)
class Film:
    """The narrowest film of a piece (mm), and what it lies between."""

    width_mm: float
    between: tuple[str, str]

    @property
    def narrow(self) -> bool:
        """Whether it may tear."""
        return self.width_mm < NARROW_FILM_MM - ROUNDING_MM


def fold_cuts(flat: FlatPiece, chosen: Options) -> tuple[tuple[Fold, tuple[Cut, ...]], ...]:
    """Return each fold that is cut, with its cuts, which keep ``MIN_FILM_MM`` from all other cuts of the piece."""
    if chosen.fold != "dash":
        return ()
    lines = [flat.outline.boundary, *(hole for _, hole in _openings(flat)), *(LineString(slit) for slit in flat.slits)]
    occupied = shapely.union_all(lines).buffer(MIN_FILM_MM + chosen.kerf_mm / 2, quad_segs=16)
    shapely.prepare(occupied)
    return tuple(
        (fold, tuple(dashes(fold.a, fold.b, chosen.dash_cut_mm, chosen.dash_bridge_mm, chosen.kerf_mm, occupied)))
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
        distances = shapely.distance(shape, shapes[i + 1 :])
        for k, distance in enumerate(distances.tolist(), i + 1):
            # Slits begin at edges and folds.
            if SLIT in (cuts[i][0], cuts[k][0]) and distance < ROUNDING_MM:
                continue
            width = distance - widths[i] - widths[k]
            if best is None or width < best[0]:
                best = (width, i, k)
    if best is None:
        return None
    width, i, k = best
    return Film(width, (cuts[k][0], cuts[i][0]))


def _openings(flat: FlatPiece) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield name and area of every opening and round hole."""
    named = [(name.rpartition(".")[2], Polygon([a for a, _ in ring]).centroid)
             for face in flat.faces for name, ring in face.holes.items()]  # fmt: skip

    def name(middle: ShapelyPoint) -> str:
        return min(named, key=lambda entry: float(entry[1].distance(middle)), default=("a hole", middle))[0]

    for ring in flat.outline.interiors:
        yield name(Polygon(ring).centroid), Polygon(ring)
    for (x, y), diameter in flat.circles:
        middle = ShapelyPoint(x, y)
        yield name(middle), middle.buffer(diameter / 2, quad_segs=32)
