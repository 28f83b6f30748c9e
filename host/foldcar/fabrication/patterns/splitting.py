"""Splits pieces that are too large for a sheet along folds.

Input: a FoldedCar, Options. Output: the car with a tab in place of each fold that is cut, and new joins; the parts are
labelled "1 of 3" and so on.
"""

import itertools
import math
from collections.abc import Sequence
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
    """Return the car with each piece split into parts that is too large for a sheet.

    A join is a place where two edges are glued or locked to each other. The parts of a split piece get new joins, and its
    old joins name the part instead of the piece. Nothing else of the car changes: the piece keeps its name in
    ``car.placed``, the list of the pieces with their places in the car.
    """
    pieces: list[Piece] = []
    joins = list(car.joins)
    last_number = max((join.number for join in joins), default=0)
    numbers = itertools.count(last_number + 1)
    for piece in car.pieces:
        parts, new_joins = _split_pieces(piece, options, numbers, car.parts.assembly.lap_flap_mm.value)
        pieces += parts
        if new_joins:
            joins = [_with_parts(join, piece, parts) for join in (*joins, *new_joins)]
    return replace(car, pieces=tuple(pieces), joins=tuple(joins))


def _with_parts(join: Join, piece: Piece, parts: Sequence[Piece]) -> Join:
    """Return a join that names the parts of a piece that was split, in place of the whole piece."""
    part_of_face = {face.name: part.name for part in parts for face in part.faces}
    piece_a = part_of_face[join.a.face] if join.piece_a == piece.name else join.piece_a
    piece_b = part_of_face[join.b.face] if join.piece_b == piece.name else join.piece_b
    return replace(join, piece_a=piece_a, piece_b=piece_b)


def _split_pieces(
    piece: Piece, options: Options, numbers: "itertools.count[int]", depth_mm: float
) -> tuple[list[Piece], list[Join]]:
    """Split a piece until all its parts fit on the sheet; return the parts, and the joins between them.

    Two parts are joined by a tab of ``depth_mm``; ``numbers`` gives the numbers of the joins. If the piece fits, or if
    splitting does not help, the result is the whole piece and no joins.
    """
    parts_to_check = [piece]
    parts: list[Piece] = []
    # A join stands in place of a fold. Its key is the child face of this fold.
    join_by_child: dict[str, Join] = {}
    while parts_to_check:
        part = parts_to_check.pop(0)
        crease = None if _fits(part, options) else _best_crease(part, options, depth_mm)
        if crease is None:
            parts.append(part)
            continue
        parts_to_check += _cut_along(part, crease, depth_mm)
        # The join names the whole piece; split_to_fit replaces this by the names of the parts.
        join_by_child[crease.child.face] = Join(
            number=next(numbers),
            kind="tab",
            piece_a=piece.name,
            a=EdgeRef(_tab_name(crease), 0),
            piece_b=piece.name,
            b=crease.child,
            length_mm=_length_mm(part, crease),
        )
    if len(parts) == 1 or not all(_fits(part, options) for part in parts):
        return [piece], []
    numbered_parts = []
    joins = []
    for number, part in enumerate(parts, 1):
        label = f"{piece.label or piece.name}, {number} of {len(parts)}"
        numbered_parts.append(replace(part, name=f"{piece.name}, part {number}", label=label))
        # The first face of a part that was split off is the child of the fold that was cut.
        first_face = part.faces[0].name
        if first_face in join_by_child:
            joins.append(join_by_child[first_face])
    return numbered_parts, joins


def _best_crease(piece: Piece, options: Options, depth_mm: float) -> Crease | None:
    """Return the fold along which to split the piece; None if no fold lies between two panels.

    The parts should exceed the sheet as little as possible. If two folds are equal in this, the one whose larger part is
    smaller is better.
    """
    role_by_face = {face.name: face.role for face in piece.faces}
    best_crease: Crease | None = None
    best_cost = (math.inf, math.inf)
    for crease in piece.creases:
        is_between_panels = role_by_face[crease.parent.face] == role_by_face[crease.child.face] == "panel"
        if crease.flexure or not is_between_panels:
            continue
        parts = _cut_along(piece, crease, depth_mm)
        excess_mm = max(_excess_mm(part, options) for part in parts)
        larger_size_mm = max(sum(_extent_mm(part, options)) for part in parts)
        cost = (round(excess_mm, 3), round(larger_size_mm, 3))
        # If two folds have the same cost, the first one is kept.
        if cost < best_cost:
            best_cost, best_crease = cost, crease
    return best_crease


def _cut_along(piece: Piece, crease: Crease, depth: float) -> tuple[Piece, Piece]:
    """Split a piece at a fold, and return its two parts.

    The faces of a piece are a tree: each fold, or crease, leads from a parent face to a child face. The first part has
    the root of the tree. It gets a tab of the given depth (mm), by which it is taped to the second part. The second
    part has the child of the fold, and all faces that hang on it.
    """
    cut_off = {crease.child.face}
    # Creases of parents precede those of their children.
    for other in piece.creases:
        if other.parent.face in cut_off:
            cut_off.add(other.child.face)
    tab = Face(_tab_name(crease), _tab_outline_mm(piece, crease, depth), role="tab")
    tab_fold = replace(crease, name=tab.name, child=EdgeRef(tab.name, 0))
    root_faces = [face for face in piece.faces if face.name not in cut_off]
    root_creases = [other for other in piece.creases if other.child.face not in cut_off]
    root_part = replace(piece, faces=(*root_faces, tab), creases=(*root_creases, tab_fold))
    # The root face of a part comes first: of the second part, it is the child of the fold.
    first_faces = [face for face in piece.faces if face.name == crease.child.face]
    other_faces = [face for face in piece.faces if face.name in cut_off and face not in first_faces]
    child_creases = [other for other in piece.creases if other.parent.face in cut_off]
    child_part = replace(piece, faces=(*first_faces, *other_faces), creases=tuple(child_creases))
    return root_part, child_part


def _tab_outline_mm(piece: Piece, crease: Crease, depth: float) -> tuple[Point, ...]:
    """Return the outline (mm) of a tab that takes the place of a fold.

    In its frame, x runs along the fold from the origin, and y across it. The edge along the fold comes first. The tab is
    taped to the child's face, and has a notch for each hole of that face.
    """
    length = _length_mm(piece, crease)
    # The tab is a trapezium: its outer edge is shorter than the fold.
    shape = shapely.Polygon([(0.0, 0.0), (length, 0.0), (length - depth / 4, depth), (depth / 4, depth)])
    faces = {face.name: face for face in piece.faces}
    # The holes are given in the child's frame. In this frame, the tab's x runs along the child's edge, and the tab's y at
    # right angles to it into the child.
    start, end = (np.array(point) for point in edge(faces, crease.child))
    tab_x = (end - start) / np.linalg.norm(end - start)
    tab_y = (-tab_x[1], tab_x[0])
    tab_axes = np.array([tab_x, tab_y])
    for hole in faces[crease.child.face].holes:
        hole_in_tab = (np.array(hole.outline_mm) - start) @ tab_axes.T
        # The rectangle around the hole, with a margin.
        left, bottom = hole_in_tab.min(axis=0) - NOTCH_MM
        right, _ = hole_in_tab.max(axis=0) + NOTCH_MM
        if bottom < depth:
            # The notch leaves film at the fold, and is open at the outer edge, so it reaches far beyond it.
            notch = shapely.box(left, max(bottom, NOTCH_MM), right, 2 * depth)
            shape = shape.difference(notch)
    # The outline starts at the origin, with the edge along the fold.
    corners = [(float(x), float(y)) for x, y in orient(shape).exterior.coords[:-1]]
    origin_index = corners.index((0.0, 0.0))
    return (*corners[origin_index:], *corners[:origin_index])


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
