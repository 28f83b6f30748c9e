"""Splits pieces that are too large for a sheet along folds.

Input: a FoldedCar, Options. Output: the car with a tab in place of each fold that is cut, and new joins; the parts are
labelled "1 of 3" and so on.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Join, Piece, Point
from foldcar.car.folded.pose import edge
from foldcar.fabrication.patterns.flat_piece import flat_piece
from foldcar.fabrication.patterns.options import Options
from foldcar.fabrication.patterns.sheet_fit import fits

# Film of a tab keeps this distance from the holes of the face below it; a notch leaves so much of it at its fold.
NOTCH_MM = 1.0


def split_to_fit(car: FoldedCar, options: Options) -> FoldedCar:
    """Return the car with pieces that are too large split; its ``placed`` still name the whole pieces."""
    pieces: list[Piece] = []
    joins = list(car.joins)
    numbers = itertools.count(max((join.number for join in joins), default=0) + 1)
    depth = car.parts.assembly.lap_flap_mm.value
    for piece in car.pieces:
        parts, new_joins = _split_pieces(piece, options, numbers, depth)
        pieces += parts
        if new_joins:
            part_of_face = {face.name: part.name for part in parts for face in part.faces}
            joins = [
                replace(
                    join,
                    piece_a=part_of_face[join.a.face] if join.piece_a == piece.name else join.piece_a,
                    piece_b=part_of_face[join.b.face] if join.piece_b == piece.name else join.piece_b,
                )
                for join in (*joins, *new_joins)
            ]
    return replace(car, pieces=tuple(pieces), joins=tuple(joins))


def _split_pieces(
    piece: Piece, options: Options, numbers: "itertools.count[int]", depth_mm: float
) -> tuple[list[Piece], list[Join]]:
    """Split a piece with tabs of that depth; return its numbered parts and the joins between them.

    If the piece fits, or splitting does not help, return the whole piece and no joins.
    """
    waiting = [piece]
    done: list[Piece] = []
    # Each join by the child face of the fold that the join replaces.
    joins: dict[str, Join] = {}
    while waiting:
        part = waiting.pop(0)
        crease = None if _fits(part, options) else _best_crease(part, options, depth_mm)
        if crease is None:
            done.append(part)
            continue
        root_part, child_part = _cut_along(part, crease, depth_mm)
        waiting += [root_part, child_part]
        tab_edge = EdgeRef(_tab_name(crease), 0)
        length_mm = _length_mm(part, crease)
        # split_to_fit replaces the whole piece's name by those of the parts.
        joins[crease.child.face] = Join(next(numbers), "tab", piece.name, tab_edge, piece.name, crease.child, length_mm)
    if len(done) == 1 or not all(_fits(part, options) for part in done):
        return [piece], []
    numbered = [
        replace(part, name=f"{piece.name}, part {i}", label=f"{piece.label or piece.name}, {i} of {len(done)}")
        for i, part in enumerate(done, 1)
    ]
    # The first face of a part that was split off is the child of its fold.
    return numbered, [joins[part.faces[0].name] for part in done if part.faces[0].name in joins]


def _best_crease(piece: Piece, options: Options, depth_mm: float) -> Crease | None:
    """Return the fold between panels along which to split the piece; None if it has none.

    It is the fold whose larger part exceeds the sheet least; of equal ones, the one whose larger part is smallest.
    """
    roles = {face.name: face.role for face in piece.faces}
    best_crease: Crease | None = None
    best_cost = (math.inf, math.inf)
    for crease in piece.creases:
        if crease.flexure or {roles[crease.parent.face], roles[crease.child.face]} != {"panel"}:
            continue
        parts = _cut_along(piece, crease, depth_mm)
        excess_mm = max(_excess_mm(part, options) for part in parts)
        sizes_mm = [sum(_extent_mm(part, options)) for part in parts]
        cost = (round(excess_mm, 3), round(max(sizes_mm), 3))
        # Of folds with the same cost the first is kept.
        if cost < best_cost:
            best_cost, best_crease = cost, crease
    return best_crease


def _cut_along(piece: Piece, crease: Crease, depth: float) -> tuple[Piece, Piece]:
    """Split a piece at a fold: return the part with its root, and the part with the fold's child and its descendants.

    The first part has a tab of that depth (mm) in place of the fold, by which it is taped to the second.
    """
    cut_off = {crease.child.face}
    # Creases of parents precede those of their children.
    for other in piece.creases:
        if other.parent.face in cut_off:
            cut_off.add(other.child.face)
    tab = Face(_tab_name(crease), _tab_outline_mm(piece, crease, depth), (), "tab")
    fold = replace(crease, name=tab.name, child=EdgeRef(tab.name, 0))

    root_faces = (*(f for f in piece.faces if f.name not in cut_off), tab)
    root_creases = (*(c for c in piece.creases if c.child.face not in cut_off), fold)
    # The root face of a part comes first.
    child_faces = sorted((f for f in piece.faces if f.name in cut_off), key=lambda f: f.name != crease.child.face)
    child_creases = tuple(c for c in piece.creases if c.parent.face in cut_off)
    return (
        replace(piece, faces=root_faces, creases=root_creases),
        replace(piece, faces=tuple(child_faces), creases=child_creases),
    )


def _tab_outline_mm(piece: Piece, crease: Crease, depth: float) -> tuple[Point, ...]:
    """Return the outline (mm) of a tab in place of a fold, its folded edge first, from the origin along x.

    The tab has a notch for each hole of the face that it is taped to.
    """
    length = _length_mm(piece, crease)
    shape = shapely.Polygon([(0.0, 0.0), (length, 0.0), (length - depth / 4, depth), (depth / 4, depth)])
    faces = {face.name: face for face in piece.faces}
    a, b = (np.array(end) for end in edge(faces, crease.child))
    along = (b - a) / np.linalg.norm(b - a)
    for hole in faces[crease.child.face].holes:
        # The tab covers the face's film beside the fold: its frame is that of the face's edge.
        points = (np.array(hole.outline_mm) - a) @ np.array([along, (-along[1], along[0])]).T
        (left, low), (right, _) = points.min(axis=0) - NOTCH_MM, points.max(axis=0) + NOTCH_MM
        if low < depth:
            shape = shape.difference(shapely.box(left, max(low, NOTCH_MM), right, 2 * depth))
    corners = [(float(x), float(y)) for x, y in orient(shape).exterior.coords[:-1]]
    start = corners.index((0.0, 0.0))
    return (*corners[start:], *corners[:start])


def _tab_name(crease: Crease) -> str:
    return f"{crease.name} splice"


def _length_mm(piece: Piece, crease: Crease) -> float:
    return math.dist(*edge({face.name: face for face in piece.faces}, crease.parent))


def _extent_mm(piece: Piece, options: Options) -> tuple[float, float]:
    x0, y0, x1, y1 = flat_piece(piece, options).outline.bounds
    return x1 - x0 + options.kerf_mm, y1 - y0 + options.kerf_mm


def _fits(piece: Piece, options: Options) -> bool:
    return fits(_extent_mm(piece, options), options.sheet_size_mm, options.margin_mm)


def _excess_mm(piece: Piece, options: Options) -> float:
    low, high = sorted(_extent_mm(piece, options))
    usable_low, usable_high = sorted(side - 2 * options.margin_mm for side in options.sheet_size_mm)
    return max(0.0, low - usable_low, high - usable_high)
