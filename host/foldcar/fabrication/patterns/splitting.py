"""Parts pieces that are too large for a sheet: along folds first, then by straight cuts across with overlaps to glue.

Input: a FoldedCar, a FlatPiece, Options. Output: the car with a tab in place of each fold that is cut, and new joins; the
parts of a flat piece, labelled "1 of 3" and so on. A cut across runs along x or y through faces and across folds, clear
of openings, of folds beside it and of short tabs; each face that it passes has an overlap of its own, so that folds stay
free. A strip is cut between two facets of its bend and overlaps by whole facets.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon, box

from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Join, Piece
from foldcar.car.folded.pose import edge
from foldcar.fabrication.patterns.drawing import Motion
from foldcar.fabrication.patterns.flat_piece import (
    GRID_MM,
    STRAIGHT_MM,
    Edge,
    FlatFace,
    FlatPiece,
    Fold,
    flat_piece,
    moved,
    moved_to_origin,
)
from foldcar.fabrication.patterns.nesting import fits
from foldcar.fabrication.patterns.options import Options

# Depth of an overlap between two flat faces: makers' double-sided tape is 12 mm wide. A strip's is at least the second.
OVERLAP_MM = 12.0
LEAST_FACETS_MM = 8.0
# An overlap stays this far inside its face, clear of folds and teeth, and this far from openings.
STEP_MM = 0.5
CLEAR_MM = 2.0
# Distance of a cut from a fold beside it.
FOLD_MM = 3.0
# The narrowest overlap that holds, and the share of the cut faces that must have one.
LEAST_WIDTH_MM = 5.0
LEAST_SHARE = 0.5
# A tab shorter than this along the piece is not cut in two.
SHORT_TAB_MM = 36.0
BEVEL_MM = 2.0
RASTER_MM = 2.0
Interval = tuple[float, float]


def as_cut(car: FoldedCar, chosen: Options) -> FoldedCar:
    """The car with too large pieces split; its ``placed`` still name the whole pieces."""
    pieces: list[Piece] = []
    joins = list(car.joins)
    numbers = itertools.count(max((join.number for join in joins), default=0) + 1)
    depth = car.parts.assembly.lap_flap_mm.value
    for piece in car.pieces:
        parts, new = _parts_along(piece, chosen, numbers, depth)
        pieces += parts
        if new:
            home = {face.name: part.name for part in parts for face in part.faces}
            joins = [
                replace(
                    join,
                    piece_a=home[join.a.face] if join.piece_a == piece.name else join.piece_a,
                    piece_b=home[join.b.face] if join.piece_b == piece.name else join.piece_b,
                )
                for join in (*joins, *new)
            ]
    return replace(car, pieces=tuple(pieces), joins=tuple(joins))


def _parts_along(
    piece: Piece, chosen: Options, numbers: "itertools.count[int]", depth_mm: float
) -> tuple[list[Piece], list[Join]]:
    """The numbered parts of a piece, tabs of that depth, and the whole piece's joins between them.

    The whole piece and no joins if it fits or splitting does not help.
    """
    waiting, done, joins = [piece], list[Piece](), dict[str, Join]()
    while waiting:
        part = waiting.pop(0)
        crease = None if _fits(part, chosen) else _best_crease(part, chosen, depth_mm)
        if crease is None:
            done.append(part)
            continue
        rest, taken = _cut_along(part, crease, depth_mm)
        waiting += [rest, taken]
        ends = EdgeRef(_tab_name(crease), 0), crease.child
        length = _length_mm(part, crease)
        joins[crease.child.face] = Join(next(numbers), "tab", piece.name, ends[0], piece.name, ends[1], length)
    if len(done) == 1 or not all(_fits(part, chosen) for part in done):
        return [piece], []
    named = [
        replace(part, name=f"{piece.name}, part {i}", label=f"{piece.label or piece.name}, {i} of {len(done)}")
        for i, part in enumerate(done, 1)
    ]
    # The first face of a part that was taken off is the child of its fold.
    return named, [joins[part.faces[0].name] for part in done if part.faces[0].name in joins]


def _best_crease(piece: Piece, chosen: Options, depth_mm: float) -> Crease | None:
    """The fold between two panels whose parts exceed the sheet least, then are most equal in size; None without folds."""
    roles = {face.name: face.role for face in piece.faces}
    best = None
    for index, crease in enumerate(piece.creases):
        if crease.flexure or {roles[crease.parent.face], roles[crease.child.face]} != {"panel"}:
            continue
        parts = _cut_along(piece, crease, depth_mm)
        over = max(_excess_mm(part, chosen) for part in parts)
        sizes = [sum(_extent_mm(part, chosen)) for part in parts]
        key = (round(over, 3), round(max(sizes), 3), index)
        if best is None or key < best[0]:
            best = (key, crease)
    return None if best is None else best[1]


def _cut_along(piece: Piece, crease: Crease, depth: float) -> tuple[Piece, Piece]:
    """The two parts: the first with a tab in place of the fold, the second with the fold's child and its descendants."""
    members = {crease.child.face}
    # Creases of parents precede those of their children.
    for other in piece.creases:
        if other.parent.face in members:
            members.add(other.child.face)
    length = _length_mm(piece, crease)
    tab = Face(_tab_name(crease), ((0.0, 0.0), (length, 0.0), (length - depth / 4, depth), (depth / 4, depth)), (), "tab")
    fold = replace(crease, name=tab.name, child=EdgeRef(tab.name, 0))

    kept = (*(f for f in piece.faces if f.name not in members), tab)
    rest = replace(piece, faces=kept, creases=(*(c for c in piece.creases if c.child.face not in members), fold))
    off = sorted((f for f in piece.faces if f.name in members), key=lambda face: face.name != crease.child.face)
    creases = tuple(c for c in piece.creases if c.parent.face in members)
    return rest, replace(piece, faces=tuple(off), creases=creases)


def _tab_name(crease: Crease) -> str:
    return f"{crease.name} splice"


def _length_mm(piece: Piece, crease: Crease) -> float:
    return math.dist(*edge({face.name: face for face in piece.faces}, crease.parent))


def _extent_mm(piece: Piece, chosen: Options) -> tuple[float, float]:
    x0, y0, x1, y1 = flat_piece(piece, chosen).outline.bounds
    return x1 - x0 + chosen.kerf_mm, y1 - y0 + chosen.kerf_mm


def _fits(piece: Piece, chosen: Options) -> bool:
    # Strips are cut across instead.
    is_strip = any(face.role == "rim" for face in piece.faces)
    return is_strip or fits(_extent_mm(piece, chosen), chosen.sheet_size_mm, chosen.margin_mm)


def _excess_mm(piece: Piece, chosen: Options) -> float:
    low, high = sorted(_extent_mm(piece, chosen))
    least, greatest = sorted(side - 2 * chosen.margin_mm for side in chosen.sheet_size_mm)
    return max(0.0, low - least, high - greatest)


@dataclass(frozen=True, slots=True)
class _Cut:
    """A cut at x, through a piece whose overlaps are ``laps`` (y intervals), ``deep`` mm deep towards +x."""

    x: float
    deep: float
    laps: tuple[Interval, ...]
    badness: float


def split_to_fit(flat: FlatPiece, chosen: Options, numbers: Iterator[int]) -> tuple[FlatPiece, ...]:
    """The piece itself if it fits or cannot be parted, else its parts; each cut takes one of the joins' ``numbers``."""
    waiting, done = [moved_to_origin(flat)], list[FlatPiece]()
    while waiting:
        part = waiting.pop(0)
        if _needed(part.outline.bounds, chosen) == 1:
            done.append(part)
            continue
        halves = _halves(part, chosen, numbers)
        if halves is None:
            return (moved_to_origin(flat),)
        waiting[:0] = halves
    if len(done) == 1:
        return tuple(done)
    return tuple(
        replace(moved_to_origin(part), name=f"{flat.name}, part {i}", label=f"{flat.label}, {i} of {len(done)}")
        for i, part in enumerate(done, 1)
    )


def _needed(bounds: Sequence[float], chosen: Options) -> int:
    """The least number of parts for a box of these bounds; 1 if it fits."""
    size = (bounds[2] - bounds[0] + chosen.kerf_mm, bounds[3] - bounds[1] + chosen.kerf_mm)
    if fits(size, chosen.sheet_size_mm, chosen.margin_mm):
        return 1
    usable = [max(side - 2 * chosen.margin_mm - OVERLAP_MM, 1.0) for side in chosen.sheet_size_mm]
    counts = (
        math.prod(max(1, math.ceil((length - OVERLAP_MM) / room)) for length, room in zip(size, rooms, strict=True))
        for rooms in (usable, usable[::-1])
    )
    return max(2, min(counts))


def _halves(flat: FlatPiece, chosen: Options, numbers: Iterator[int]) -> tuple[FlatPiece, FlatPiece] | None:
    """The two parts of the best cut along either axis, their seam with the next number; None if there is none."""
    found = []
    for turns in (0, 1):
        turned = moved_to_origin(moved(flat, Motion(turns)))
        for cut in _cuts(turned):
            parts = _windows(turned, cut)
            count = sum(_needed(part, chosen) for part in parts)
            sizes = [part[2] - part[0] for part in parts]
            key = (count, cut.badness, round(abs(sizes[0] - sizes[1])), turns, cut.x)
            found.append((key, turned, turns, cut))
    for key, turned, turns, cut in sorted(found, key=lambda one: one[0]):
        if key[0] > 2 * _needed(flat.outline.bounds, chosen) + 2:
            break
        halves = _parts(turned, cut, numbers)
        if halves is not None:
            return moved(halves[0], Motion(-turns)), moved(halves[1], Motion(-turns))
    return None


def _cuts(flat: FlatPiece) -> Iterator[_Cut]:
    """The possible cuts at an x of the piece, whose corner is the origin."""
    length = flat.outline.bounds[2]
    bends = sorted({round(x, 3) for x in (_upright(bend) for bend in flat.bends) if x is not None})
    for i, x in enumerate(bends):
        after = next((b for b in bends[i + 1 :] if b - x > LEAST_FACETS_MM), None)
        if after is not None:
            yield from _cut(flat, x, after - x)
    if not flat.bends:
        for x in np.arange(OVERLAP_MM, length - 2 * OVERLAP_MM, RASTER_MM):
            yield from _cut(flat, float(x), OVERLAP_MM)


def _upright(edge: Edge) -> float | None:
    """The x of an edge along y; None for others."""
    (ax, ay), (bx, by) = edge
    return (ax + bx) / 2 if abs(bx - ax) < 1e-3 * abs(by - ay) else None


def _cut(flat: FlatPiece, x: float, deep: float) -> Iterator[_Cut]:
    """The cut at x with its overlaps, unless something is in its way."""
    for fold in flat.folds:
        low, high = sorted((fold.a[0], fold.b[0]))
        if high - low < abs(fold.a[1] - fold.b[1]) and low - deep - FOLD_MM < x < high + FOLD_MM:
            # A fold of a neighbour that ends beside the cut's way is not in it.
            return
    line = LineString([(x, -1.0), (x, flat.outline.bounds[3] + 1.0)])
    shapes = _openings(flat)
    if any(shape.bounds[0] - CLEAR_MM < x < shape.bounds[2] + CLEAR_MM for shape in shapes):
        return
    passed, laps = 0.0, list[Interval]()
    for face in flat.faces:
        left, _, right, _ = face.outline.bounds
        # A strip is cut where a facet begins.
        if not left - STRAIGHT_MM < x < right - STRAIGHT_MM:
            continue
        if face.role == "tab":
            if right - left < SHORT_TAB_MM:
                return
            continue
        passed += line.intersection(face.outline).length
        laps += _laps(face, x, deep, shapes)
    if not laps:
        return
    share = sum(high - low for low, high in laps) / max(passed, 1e-6)
    if share >= LEAST_SHARE:
        yield _Cut(x, deep, tuple(laps), round(4 * (1 - share)) + round(line.intersection(flat.outline).length / 20))


def _openings(flat: FlatPiece) -> list[Polygon]:
    shapes = [Polygon(ring) for ring in flat.outline.interiors]
    shapes += [box(x - d / 2, y - d / 2, x + d / 2, y + d / 2) for (x, y), d in flat.circles]
    return shapes


def _laps(face: FlatFace, x: float, deep: float, openings: Sequence[Polygon]) -> list[Interval]:
    """The y intervals in which the face and its neighbour behind the cut have room for an overlap."""
    strip = face.role == "rim"
    low, high = (float(side) for side in (face.outline.bounds[1] + STEP_MM, face.outline.bounds[3] - STEP_MM))
    blocked = [(shape.bounds[1] - CLEAR_MM, shape.bounds[3] + CLEAR_MM) for shape in openings
               if x - CLEAR_MM < shape.bounds[2] and shape.bounds[0] < x + deep + CLEAR_MM]  # fmt: skip
    if not strip:
        missing = box(x, low, x + deep + STEP_MM, high).difference(face.outline)
        blocked += [(part.bounds[1] - STEP_MM, part.bounds[3] + STEP_MM)
                    for part in shapely.get_parts(missing) if part.area > GRID_MM]  # fmt: skip
    free, start = [], low
    for one, other in sorted(blocked):
        free.append((start, min(one, high)))
        start = max(start, other)
    return [(a, b) for a, b in [*free, (start, high)] if b - a >= LEAST_WIDTH_MM]


def _lap(cut: _Cut, interval: Interval) -> Polygon:
    """An overlap with bevelled corners, which do not catch."""
    (low, high), x, end = interval, cut.x, cut.x + cut.deep
    bevel = min(BEVEL_MM, (high - low) / 4)
    return Polygon([(x - 1e-3, low), (x, low), (end, low + bevel), (end, high - bevel), (x, high), (x - 1e-3, high)])


def _windows(flat: FlatPiece, cut: _Cut) -> list[tuple[float, float, float, float]]:
    """The bounds of the two parts, the first with its overlap."""
    _, low, right, high = flat.outline.bounds
    return [(0.0, low, cut.x + cut.deep, high), (cut.x, low, right, high)]


def _parts(flat: FlatPiece, cut: _Cut, numbers: Iterator[int]) -> tuple[FlatPiece, FlatPiece] | None:
    """The parts before and behind the cut; None if one is not in one piece."""
    low, high = flat.outline.bounds[1] - 1, flat.outline.bounds[3] + 1
    seams = tuple(((cut.x, a), (cut.x, b)) for a, b in sorted(cut.laps, key=lambda lap: lap[0] - lap[1]))
    first = _clipped(flat, box(-1.0, low, cut.x, high))
    second = _clipped(flat, box(cut.x, low, flat.outline.bounds[2] + 1, high))
    outline = shapely.union_all([first.outline, *(_lap(cut, lap) for lap in cut.laps)], grid_size=GRID_MM)
    if not isinstance(outline, Polygon) or not isinstance(second.outline, Polygon):
        return None
    number = next(numbers)
    first = replace(
        first,
        outline=shapely.geometry.polygon.orient(outline),
        marks=(*first.marks, *seams),
        seams=(*first.seams, (number, seams)),
    )
    return first, replace(second, seams=(*second.seams, (number, tuple((b, a) for a, b in seams))))


def _clipped(flat: FlatPiece, window: Polygon) -> FlatPiece:
    """What lies inside the window."""

    def inside(edge: Edge) -> Edge | None:
        line = LineString(edge).intersection(window)
        if not isinstance(line, LineString) or line.length < STEP_MM:
            return None
        (a, b) = line.coords
        return (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))

    def all_inside(edges: Sequence[Edge]) -> tuple[Edge, ...]:
        return tuple(edge for edge in map(inside, edges) if edge is not None)

    def ordered(edge: Edge, old: Edge) -> Edge:
        along = (edge[1][0] - edge[0][0]) * (old[1][0] - old[0][0]) + (edge[1][1] - edge[0][1]) * (old[1][1] - old[0][1])
        return edge if along > 0 else edge[::-1]

    faces = []
    for face in flat.faces:
        kept = face.outline.intersection(window)
        if isinstance(kept, Polygon) and kept.area > 1e-3:
            edges = {i: ordered(part, edge) for i, edge in face.edges.items() if (part := inside(edge)) is not None}
            rings = {name: ring for name, ring in face.holes.items() if window.contains(LineString(ring[0]))}
            laid = {name: tuple(filter(None, map(inside, around))) for name, around in face.laid.items()}
            faces.append(replace(face, outline=kept, edges=edges, holes=rings, laid=laid))
    outline = flat.outline.intersection(window)
    # A slit on the cut itself is part of the outline now.
    slits = (LineString(slit).intersection(window.buffer(-GRID_MM)) for slit in flat.slits)
    return replace(
        flat,
        outline=shapely.geometry.polygon.orient(outline) if isinstance(outline, Polygon) else outline,
        circles=tuple(((x, y), d) for (x, y), d in flat.circles if window.contains(shapely.Point(x, y))),
        slits=tuple(tuple(slit.coords) for slit in slits if isinstance(slit, LineString) and slit.length > STEP_MM / 10),
        folds=tuple(Fold(f.kind, *edge) for f in flat.folds if (edge := inside((f.a, f.b))) is not None),
        faces=tuple(faces),
        marks=all_inside(flat.marks),
        bends=all_inside(flat.bends),
        seams=tuple((number, kept) for number, edges in flat.seams if (kept := all_inside(edges))),
    )
