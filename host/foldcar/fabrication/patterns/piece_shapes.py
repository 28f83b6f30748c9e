"""A flat piece as shapes on layers: kerf-compensated cuts, fold dashes or score lines, labels; its narrowest film.

Input: a FlatPiece and Options. Output: shapes; the narrowest film between two cuts, because a bridge too narrow tears
while it is cut or folded. The bridges between the cuts of one fold (``dash_bridge_mm``) are not counted.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

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
    flat: FlatPiece, options: Options, marks: Iterable[EdgeMark], quarter_turns: int = 0
) -> tuple[list[Shape], list[str]]:
    """Return the piece's shapes in its own frame, and a warning for each label that does not fit.

    Texts are upright after the piece is turned by ``quarter_turns`` · 90°.
    """
    name = flat.label if flat.count == 1 else f"{flat.label} (x{flat.count})"
    labels, missing = label_paths(flat, name, marks, quarter_turns)
    warnings = [f'{flat.label}: no room for the label "{text}"' for text in missing]
    shapes: list[Shape] = list(labels)
    shapes += [Path("SCORE", mark) for mark in flat.marks]
    shapes += _folds(flat, options)
    shapes += cut_shapes(flat, options.kerf_mm)
    return shapes, warnings


def cut_shapes(flat: FlatPiece, kerf_mm: float) -> list[Shape]:
    """Return the cuts of a piece: its outline, openings and slits.

    The kerf is the width of the material that the cutter removes. So the cuts of outline and openings are moved by half
    of it into the waste. Then the piece has its nominal size.
    """
    half = kerf_mm / 2
    shapes: list[Shape] = [Circle("CUT_INNER", centre, diameter / 2 - half) for centre, diameter in flat.circles]
    shapes += [Path("CUT_INNER", slit) for slit in flat.slits]
    for ring in flat.outline.interiors:
        hole = Polygon(ring).buffer(-half, join_style="mitre", mitre_limit=3) if half else Polygon(ring)
        # Where an opening is narrower than the kerf, nothing of it is left. The rest may have several parts.
        parts = [part for part in shapely.get_parts(hole) if not part.is_empty]
        shapes += [_path("CUT_INNER", part.exterior.coords[:-1]) for part in parts]
    return [*shapes, _path("CUT_OUTER", outer_cut(flat, kerf_mm).exterior.coords[:-1])]


def outer_cut(flat: FlatPiece, kerf_mm: float) -> Polygon:
    """Return the polygon along which the piece is cut out: its outline, grown by half a kerf."""
    outer = Polygon(flat.outline.exterior)
    return outer.buffer(kerf_mm / 2, join_style="mitre", mitre_limit=3) if kerf_mm else outer


def _path(layer: LayerName, points: Iterable[tuple[float, ...]]) -> Path:
    return Path(layer, tuple((float(x), float(y)) for x, y in points), closed=True)


def _folds(flat: FlatPiece, options: Options) -> Iterator[Shape]:
    """Yield score lines or dashes of folds, and a line on the label layer for each fold without either."""
    for fold in flat.folds:
        # A cut or a score would weaken a flexure. So a line on the label layer shows its place.
        if fold.kind == "flexure":
            yield Path("LABEL", (fold.a, fold.b))
        elif options.fold == "score":
            yield Path(FOLD_LAYERS[fold.kind], (fold.a, fold.b))
    for fold, cuts in fold_cuts(flat, options):
        yield from (Path(FOLD_LAYERS[fold.kind], cut) for cut in cuts)
        if not cuts:
            yield Path("LABEL", (fold.a, fold.b))


def dashes(
    a: Point, b: Point, cut_mm: float, bridge_mm: float, kerf_mm: float = 0.0, occupied: BaseGeometry | None = None
) -> list[Cut]:
    """Return the paths of the dashes that are cut along the fold from ``a`` to ``b``.

    A finished dash is ``cut_mm`` long. Between dashes are equal *bridges* of film, at least ``bridge_mm`` long, and there
    are as many dashes as fit. ``occupied`` is an area that no dash may touch, other cuts with some film around them. If
    it is None, the fold begins and ends with a bridge. A short fold has one shorter dash, and a tiny fold has none. The
    path of a dash is shorter than the dash by the kerf, because the tool removes film beyond the ends of its path.
    """
    length = math.dist(a, b)
    # Intervals and dashes are pairs of distances from a, along the fold.
    free_intervals = [(bridge_mm, length - bridge_mm)]
    if occupied is not None:
        free_intervals = list(_free_intervals(a, b, occupied))
    finished_dashes: list[tuple[float, float]] = []
    for start, end in free_intervals:
        finished_dashes += _spaced_cuts(start, end, cut_mm, bridge_mm)
    half = length * SHORT_FOLD_FRACTION / 2
    if not finished_dashes and 2 * half >= MIN_FOLD_CUT_MM:
        finished_dashes = [(length / 2 - half, length / 2 + half)]

    def point_at(distance: float) -> Point:
        """Return the point of the fold at this distance from ``a``."""
        fraction = distance / length
        return a[0] + fraction * (b[0] - a[0]), a[1] + fraction * (b[1] - a[1])

    paths = []
    for start, end in finished_dashes:
        # The path is shorter by half a kerf at each end, but never shorter than half of the dash.
        shortening = min(kerf_mm, (end - start) / 2)
        paths.append((point_at(start + shortening / 2), point_at(end - shortening / 2)))
    return paths


def _free_intervals(a: Point, b: Point, occupied: BaseGeometry) -> Iterator[tuple[float, float]]:
    """Yield the intervals of the line from ``a`` to ``b`` outside of ``occupied``: distances of both ends from ``a``."""
    for part in shapely.get_parts(LineString([a, b]).difference(occupied)):
        if part.length > 0:
            low, high = sorted(math.dist(a, p) for p in (part.coords[0], part.coords[-1]))
            yield low, high


def _spaced_cuts(start: float, end: float, cut_mm: float, bridge_mm: float) -> Iterator[tuple[float, float]]:
    """Yield as many cuts as fit into an interval of a fold, evenly spaced from end to end.

    A cut is its start and end, in mm along the fold. If only one cut fits, it lies in the middle and is not longer than
    the interval. A cut shorter than MIN_CUT_MM is left out.
    """
    length = end - start
    count = math.floor((length + bridge_mm) / (cut_mm + bridge_mm) + 1e-9)
    if count < 2:
        cut = min(cut_mm, length)
        if cut >= MIN_CUT_MM:
            yield (start + end - cut) / 2, (start + end + cut) / 2
        return
    step = (length - cut_mm) / (count - 1)
    for i in range(count):
        yield start + i * step, start + i * step + cut_mm


@dataclass(frozen=True, slots=True)
class NarrowestFilm:
    """The narrowest film of a piece (mm), and what it lies between."""

    width_mm: float
    between: tuple[str, str]

    @property
    def narrow(self) -> bool:
        """Whether it may tear."""
        return self.width_mm < NARROW_FILM_MM - ROUNDING_MM


def fold_cuts(flat: FlatPiece, options: Options) -> tuple[tuple[Fold, tuple[Cut, ...]], ...]:
    """Return each fold with its dashes; () if folds are scored.

    The dashes stay at least ``MIN_FILM_MM`` away from all other cuts. A flexure, which is the strip of a hinge, is not
    cut, so it is left out.
    """
    if options.fold != "dash":
        return ()
    openings = [opening for _, opening in _openings(flat)]
    slits = [LineString(slit) for slit in flat.slits]
    other_cuts = shapely.union_all([flat.outline.boundary, *openings, *slits])
    occupied = other_cuts.buffer(MIN_FILM_MM + options.kerf_mm / 2, quad_segs=16)
    shapely.prepare(occupied)
    folds_with_cuts = []
    for fold in flat.folds:
        if fold.kind != "flexure":
            cuts = dashes(fold.a, fold.b, options.dash_cut_mm, options.dash_bridge_mm, options.kerf_mm, occupied)
            folds_with_cuts.append((fold, tuple(cuts)))
    return tuple(folds_with_cuts)


class _NamedCut(NamedTuple):
    """A cut with its name for readers, and the film that is lost on each side of its line (mm)."""

    name: str
    shape: BaseGeometry
    lost_mm: float


def narrowest_film(flat: FlatPiece, options: Options) -> NarrowestFilm | None:
    """Return the narrowest film between two cuts; None for a piece with one cut.

    Outlines and openings are cut beside their line, in the waste, so that the film keeps its width. Slits and dashes are
    cut on their line and take half a kerf of film on each side.
    """
    half_kerf = options.kerf_mm / 2
    cuts = [_NamedCut(EDGE, flat.outline.exterior, lost_mm=0.0)]
    cuts += [_NamedCut(name, opening, lost_mm=0.0) for name, opening in _openings(flat)]
    cuts += [_NamedCut(SLIT, LineString(slit), lost_mm=half_kerf) for slit in flat.slits]
    for _, fold_cut in fold_cuts(flat, options):
        if fold_cut:
            cuts.append(_NamedCut(DASHES, MultiLineString(fold_cut), lost_mm=half_kerf))
    narrowest = None
    # Each cut is compared with all later ones.
    for index, cut in enumerate(cuts[:-1]):
        later_cuts = cuts[index + 1 :]
        distances = shapely.distance(cut.shape, [later.shape for later in later_cuts])
        for later, distance in zip(later_cuts, distances.tolist(), strict=True):
            # A slit may begin at an edge or a fold: then there is no film between them.
            if SLIT in (cut.name, later.name) and distance < ROUNDING_MM:
                continue
            width = distance - cut.lost_mm - later.lost_mm
            if narrowest is None or width < narrowest.width_mm:
                narrowest = NarrowestFilm(width, (later.name, cut.name))
    return narrowest


def _openings(flat: FlatPiece) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield the name and the polygon of every opening and round hole of a piece.

    The outline of the piece has openings without names. So each gets the name of the hole of a face that is nearest.
    """
    centre_and_name: list[tuple[ShapelyPoint, str]] = []
    for face in flat.faces:
        for name, ring in face.holes.items():
            corners = [start for start, _ in ring]
            centre_and_name.append((Polygon(corners).centroid, name.rpartition(".")[2]))

    def nearest_name(centre: ShapelyPoint) -> str:
        """Return the name of the hole whose centre is nearest to this one."""
        if not centre_and_name:
            return "a hole"
        _, name = min(centre_and_name, key=lambda hole: float(hole[0].distance(centre)))
        return name

    for ring in flat.outline.interiors:
        yield nearest_name(Polygon(ring).centroid), Polygon(ring)
    for (x, y), diameter in flat.circles:
        centre = ShapelyPoint(x, y)
        yield nearest_name(centre), centre.buffer(diameter / 2, quad_segs=32)
