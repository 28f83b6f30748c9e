"""Splits pieces too large for a sheet along folds; a tab replaces the fold, and the parts are glued there.

Input: a FoldedCar, Options. Output: the car with pieces that fit, as far as their folds permit, and with the new joins.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from foldcar.car.folded.model import Crease, EdgeRef, Face, FoldedCar, Join, Piece
from foldcar.car.folded.pose import edge
from foldcar.fabrication.patterns.flat_piece import flat_piece
from foldcar.fabrication.patterns.nesting import fits
from foldcar.fabrication.patterns.options import Options


def as_cut(car: FoldedCar, chosen: Options) -> FoldedCar:
    """The car with too large pieces split; its ``placed`` still name the whole pieces."""
    pieces: list[Piece] = []
    joins = list(car.joins)
    numbers = itertools.count(max((join.number for join in joins), default=0) + 1)
    depth = car.parts.assembly.lap_flap_mm.value
    for piece in car.pieces:
        parts = _parts(piece, chosen, numbers, depth)
        pieces += [part.piece for part in parts]
        if len(parts) == 1:
            continue
        home = {face.name: part.piece.name for part in parts for face in part.piece.faces}
        joins = [
            replace(
                join,
                piece_a=home[join.a.face] if join.piece_a == piece.name else join.piece_a,
                piece_b=home[join.b.face] if join.piece_b == piece.name else join.piece_b,
            )
            for join in joins
        ]
        joins += [
            replace(part.join, piece_a=home[part.join.a.face], piece_b=home[part.join.b.face])
            for part in parts
            if part.join is not None
        ]
    return replace(car, pieces=tuple(pieces), joins=tuple(joins))


@dataclass(frozen=True, slots=True)
class _Part:
    """A part and its join to the part it was split from; the names of that join's pieces are not set yet."""

    piece: Piece
    join: Join | None


def _parts(piece: Piece, chosen: Options, numbers: "itertools.count[int]", depth_mm: float) -> list[_Part]:
    """The numbered parts of a piece, tabs of that depth; the whole piece if it fits or splitting does not help."""
    waiting, done = [_Part(piece, None)], []
    while waiting:
        part = waiting.pop(0)
        crease = None if _fits(part.piece, chosen) else _best_crease(part.piece, chosen, depth_mm)
        if crease is None:
            done.append(part)
            continue
        rest, taken = _cut(part.piece, crease, depth_mm)
        join = Join(
            next(numbers), "tab", "", EdgeRef(_tab_name(crease), 0), "", crease.child, _length_mm(part.piece, crease)
        )
        waiting += [_Part(rest, part.join), _Part(taken, join)]
    if len(done) == 1 or not all(_fits(part.piece, chosen) for part in done):
        return [_Part(piece, None)]
    count = len(done)
    return [
        replace(
            part,
            piece=replace(
                part.piece, name=f"{piece.name}, part {i}", label=f"{piece.label or piece.name}, {i} of {count}"
            ),
        )
        for i, part in enumerate(done, 1)
    ]


def _best_crease(piece: Piece, chosen: Options, depth_mm: float) -> Crease | None:
    """The fold between two panels whose parts exceed the sheet least, then are most equal in size; None without folds."""
    roles = {face.name: face.role for face in piece.faces}
    best = None
    for index, crease in enumerate(piece.creases):
        if crease.flexure or {roles[crease.parent.face], roles[crease.child.face]} != {"panel"}:
            continue
        parts = _cut(piece, crease, depth_mm)
        over = max(_excess_mm(part, chosen) for part in parts)
        sizes = [sum(_extent_mm(part, chosen)) for part in parts]
        key = (round(over, 3), round(max(sizes), 3), index)
        if best is None or key < best[0]:
            best = (key, crease)
    return None if best is None else best[1]


def _cut(piece: Piece, crease: Crease, depth: float) -> tuple[Piece, Piece]:
    """The two parts: the first with a tab in place of the fold, the second with the fold's child and its descendants."""
    members = {crease.child.face}
    # Creases of parents precede those of their children.
    for other in piece.creases:
        if other.parent.face in members:
            members.add(other.child.face)
    length = _length_mm(piece, crease)
    tab = Face(_tab_name(crease), ((0.0, 0.0), (length, 0.0), (length - depth / 4, depth), (depth / 4, depth)), (), "tab")
    fold = replace(crease, name=tab.name, child=EdgeRef(tab.name, 0))

    def part(faces: Sequence[Face], creases: Sequence[Crease]) -> Piece:
        return replace(piece, faces=tuple(faces), creases=tuple(creases))

    rest = part(
        [*(f for f in piece.faces if f.name not in members), tab],
        [*(c for c in piece.creases if c.child.face not in members), fold],
    )
    taken = part(
        [f for f in piece.faces if f.name == crease.child.face]
        + [f for f in piece.faces if f.name in members and f.name != crease.child.face],
        [c for c in piece.creases if c.parent.face in members],
    )
    return rest, taken


def _tab_name(crease: Crease) -> str:
    return f"{crease.name} splice"


def _length_mm(piece: Piece, crease: Crease) -> float:
    (ax, ay), (bx, by) = edge({face.name: face for face in piece.faces}, crease.parent)
    return float(((bx - ax) ** 2 + (by - ay) ** 2) ** 0.5)


def _extent_mm(piece: Piece, chosen: Options) -> tuple[float, float]:
    x0, y0, x1, y1 = flat_piece(piece, chosen).outline.bounds
    return x1 - x0 + chosen.kerf_mm, y1 - y0 + chosen.kerf_mm


def _fits(piece: Piece, chosen: Options) -> bool:
    # Strips are cut across instead (split_strip.py).
    is_strip = any(face.role == "rim" for face in piece.faces)
    return is_strip or fits(_extent_mm(piece, chosen), chosen.sheet_size_mm, chosen.margin_mm)


def _excess_mm(piece: Piece, chosen: Options) -> float:
    low, high = sorted(_extent_mm(piece, chosen))
    least, greatest = sorted(side - 2 * chosen.margin_mm for side in chosen.sheet_size_mm)
    return max(0.0, low - least, high - greatest)
