"""Nests pieces on few sheets in quarter turns, also into notches and gaps of each other.

Input: outlines in millimetres with counts, the sheet's size, margin and gap. Output: sheet and motion of every copy.

Pieces are placed one after the other, each as low and then as far left as possible on the first sheet with room. A local
search over their orders starts with the largest piece first, exchanges pieces and keeps orders that take less film. A
piece is a raster of the cells that it touches. The no-fit mask of two pieces is the correlation of their rasters, one of
them grown by the gap; it is computed once for each pair. The search has a fixed seed and ends after a fixed amount of
work, not time: the same pieces give the same layout.
"""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.drawing import Motion
from foldcar.fabrication.patterns.rasters import CELL_MM, Cells, RotatedPiece, SheetArea, Turns
from foldcar.fabrication.patterns.sheet_fit import too_large_message

MAX_SHEETS = 200
# The search ends after this number of orders or of positions examined: a second or two. It continues up to
# MAX_EXTENSIONS times as long while the last sheet is sparse and the pieces' area would fit on fewer sheets.
MAX_TRIES = 300
MAX_POSITIONS = 1e9
MAX_EXTENSIONS = 4
SPARSE_FRACTION = 0.25
SEED = 1
# Probability with which the search changes when the title is placed, instead of the order.
TITLE_CHANGE_PROBABILITY = 0.1


class NestingError(FoldcarError):
    """A piece that does not fit on a sheet, or pieces that need too many sheets."""


@dataclass(frozen=True, slots=True)
class NestedCopy:
    """The sheet of a copy and its motion from the piece's frame onto it."""

    sheet: int
    motion: Motion


@dataclass(frozen=True, slots=True)
class Nest:
    """A layout: ``placements[i]`` are the copies of piece i.

    ``titles`` and ``boxes`` are the motions of each sheet's title and box, None where there is no room for it.
    """

    placements: tuple[tuple[NestedCopy, ...], ...]
    titles: tuple[Motion | None, ...]
    boxes: tuple[Motion | None, ...]


class _Candidate(NamedTuple):
    """A possible place of a piece. The candidate with the lowest top is the best one, then the leftmost one."""

    top: int
    column: int
    turn: int
    row: int
    turned: RotatedPiece


@dataclass(slots=True)
class _Sheet:
    """The pieces on one sheet with their rows and columns, their highest row, and the blocked places of others."""

    area: SheetArea
    placed: list[tuple[RotatedPiece, int, int]] = field(default_factory=list)
    top: int = 0
    top_of_pieces: int = 0
    _blocked: dict[int, tuple[Cells, int]] = field(default_factory=dict)

    def blocked(self, turned: RotatedPiece) -> Cells:
        """Return a mask of the (row, column) at which the piece's first cell would bring it too near to another piece.

        The mask is kept for each piece, and updated by the pieces placed since the last call.
        """
        rows, columns = turned.place_rows, turned.place_columns
        # The mask of the last call, and how many pieces were placed then.
        if id(turned) not in self._blocked:
            self._blocked[id(turned)] = (np.zeros((rows, columns), dtype=bool), 0)
        blocked, placed_count = self._blocked[id(turned)]
        for other, row, column in self.placed[placed_count:]:
            mask = self.area.no_fit_mask(other, turned)
            # The place of the piece to which the mask's first element belongs; it may lie outside of the sheet.
            first_row = row - other.padding_cells - (turned.cells.shape[0] - 1)
            first_column = column - other.padding_cells - (turned.cells.shape[1] - 1)
            # The part of the mask that lies on the sheet.
            start_row, end_row = max(0, first_row), min(rows, first_row + mask.shape[0])
            start_column, end_column = max(0, first_column), min(columns, first_column + mask.shape[1])
            if start_row < end_row and start_column < end_column:
                mask_rows = slice(start_row - first_row, end_row - first_row)
                mask_columns = slice(start_column - first_column, end_column - first_column)
                blocked[start_row:end_row, start_column:end_column] |= mask[mask_rows, mask_columns]
        self._blocked[id(turned)] = (blocked, len(self.placed))
        return blocked

    def place(self, turns: Turns) -> Motion | None:
        """Place the piece, in one of its turns, where its top is lowest, then leftmost; return its motion.

        None if there is no room in any turn.
        """
        candidates = []
        for turned in turns:
            blocked = self.blocked(turned).ravel()
            # argmin returns the first False. If all are True, it returns 0.
            first_free = int(blocked.argmin())
            if not blocked[first_free]:
                row, column = divmod(first_free, turned.place_columns)
                top = row + turned.cells.shape[0]
                candidates.append(_Candidate(top, column, turned.turn, row, turned))
        if not candidates:
            return None
        best = min(candidates, key=lambda candidate: (candidate.top, candidate.column, candidate.turn))
        self.placed.append((best.turned, best.row, best.column))
        self.top = max(self.top, best.top)
        return self.area.motion(best.turned, best.row, best.column)


def nest(
    pieces: Sequence[tuple[str, Polygon, int]],
    size_mm: tuple[float, float],
    margin_mm: float,
    gap_mm: float,
    title_mm: tuple[float, float],
    box_mm: tuple[float, float] = (0.0, 0.0),
) -> Nest:
    """Lay out the copies of pieces on as few sheets as possible.

    Each piece is given by its name, its outline and the number of its copies. ``size_mm`` is the size of a sheet. If
    there is room, each sheet gets a title of the size ``title_mm``, and a box of the size ``box_mm`` for a QR code; with
    a size of 0 there is none. The last sheet is the one with most film left. Raises NestingError, which names the piece,
    its size and the size of the sheet, if a piece does not fit on a sheet.
    """
    area = SheetArea(size_mm, margin_mm, gap_mm)
    # A title that would have to be turned is left out, because it could not be read.
    title, box = _first_turn(area, title_mm), _first_turn(area, box_mm)
    if title and title[0].turn:
        title = []
    # The layout.
    turns = [area.turned(outline) for _, outline, _ in pieces]
    for (name, outline, _), turned in zip(pieces, turns, strict=True):
        if not turned:
            raise NestingError(too_large_message(name, outline, size_mm, margin_mm))
    best = _search_layout(area, title, turns, _first_orders(pieces), _min_sheets(area, pieces))
    # The sheets keep their order, but the one with most film left comes last.
    sheet_order = [number for number, sheet in enumerate(best.sheets) if sheet is not best.last]
    sheet_order += [number for number, sheet in enumerate(best.sheets) if sheet is best.last]
    # For each piece, the sheets and motions of its copies.
    placements: list[list[NestedCopy]] = [[] for _ in pieces]
    for copy in best.copies:
        placements[copy.piece].append(NestedCopy(sheet_order.index(copy.sheet), copy.motion))
    return Nest(
        placements=tuple(map(tuple, placements)),
        titles=tuple(best.titles[number] for number in sheet_order),
        boxes=tuple(best.sheets[number].place(box) for number in sheet_order),
    )


def _first_turn(area: SheetArea, size_mm: tuple[float, float]) -> Turns:
    """Return a rectangle in the first turn that fits; nothing for a size of 0, or if no turn fits."""
    return area.turned(shapely.box(0, 0, *size_mm))[:1] if min(size_mm) > 0 else []


def _min_sheets(area: SheetArea, pieces: Sequence[tuple[str, Polygon, int]]) -> int:
    """Return a lower bound of the number of sheets, from areas.

    Pieces grown by half the gap do not overlap, and lie in the usable area grown by as much.
    """
    occupied_mm2: float = sum(outline.buffer(area.gap_mm / 2).area * count for _, outline, count in pieces)
    return math.ceil(occupied_mm2 / math.prod(side + area.gap_mm for side in area.usable_mm))


class _LaidCopy(NamedTuple):
    """A copy of a piece: the indices of the piece and of its sheet, and its motion there."""

    piece: int
    sheet: int
    motion: Motion


@dataclass(frozen=True, slots=True)
class _Layout:
    """The copies of all pieces, the sheets on which they lie, and the motions of the sheets' titles."""

    copies: tuple[_LaidCopy, ...]
    sheets: tuple[_Sheet, ...]
    titles: tuple[Motion | None, ...]

    @property
    def last(self) -> _Sheet | None:
        """The sheet with most film left, on which pieces should be few and low."""
        return min(self.sheets, key=lambda sheet: sheet.top_of_pieces, default=None)

    @property
    def film_cost(self) -> tuple[int, ...]:
        """The cost to minimise: number of sheets, missing titles, height and area (cells) taken of the last sheet."""
        if self.last is None:
            return (0,)
        occupied_cells = sum(int(turned.cells.sum()) for turned, _, _ in self.last.placed)
        return len(self.sheets), self.titles.count(None), self.last.top_of_pieces, occupied_cells

    @property
    def cost(self) -> tuple[int, ...]:
        """The cost of a result: missing titles, then film. A title has the bar that proves the scale of the sheet."""
        return self.titles.count(None), *self.film_cost


class _Start(NamedTuple):
    """What a layout follows from: the order of the pieces, and whether titles are placed before them."""

    order: Sequence[int]
    title_first: bool


def _search_layout(
    area: SheetArea, title: Turns, turns: Sequence[Turns], orders: Sequence[list[int]], min_sheets: int
) -> _Layout:
    """Find the best layout by local search over the order of pieces and the time when the title is placed.

    ``orders`` are orders to start from, and ``min_sheets`` is a lower bound of the number of sheets. The search goes on
    from a changed layout if that does not cost more film. The result is the layout with the lowest ``cost`` of all.
    """
    rng = random.Random(SEED)
    # The layouts of all starts. The search begins with the one that needs the least film.
    starts = []
    for order in orders:
        starts += [_Start(order, True), _Start(order, False)]
    layouts = [_lay_out(area, title, turns, start) for start in starts]
    best = min(layouts, key=lambda layout: layout.cost)
    film_costs = [layout.film_cost for layout in layouts]
    first_index = film_costs.index(min(film_costs))
    current, start = layouts[first_index], starts[first_index]
    # The number of tries. It is limited so that the search does not examine too many positions of pieces.
    positions = 0
    for piece in start.order:
        positions += sum(turned.place_rows * turned.place_columns for turned in turns[piece])
    tries = min(MAX_TRIES, int(MAX_POSITIONS / positions)) if len(start.order) > 1 else 0
    sparse_cells = SPARSE_FRACTION * math.prod(area.usable_mm) / CELL_MM**2
    for number in range(MAX_EXTENSIONS * tries):
        # After these tries, the search goes on only while it might save a sheet: there are more sheets than the lower
        # bound, and the last one is nearly empty.
        might_save_sheet = len(best.sheets) > min_sheets and best.film_cost[-1] <= sparse_cells
        if number >= tries and not might_save_sheet:
            break
        if rng.random() < TITLE_CHANGE_PROBABILITY:
            changed = _Start(start.order, not start.title_first)
        else:
            changed = _Start(_changed_order(start.order, rng), start.title_first)
        layout = _lay_out(area, title, turns, changed)
        # A changed layout that needs no more film is changed further.
        if layout.film_cost <= current.film_cost:
            current, start = layout, changed
        best = min(best, layout, key=lambda layout: layout.cost)
    return best


def _changed_order(order: Sequence[int], rng: random.Random) -> list[int]:
    """Return the order with two different pieces exchanged, or one moved to another place."""
    changed = list(order)
    i, j = rng.sample(range(len(order)), 2)
    if rng.random() < 0.5:
        changed[i], changed[j] = changed[j], changed[i]
    else:
        changed.insert(j, changed.pop(i))
    return changed


def _first_orders(pieces: Sequence[tuple[str, Polygon, int]]) -> list[list[int]]:
    """Return two orders of the copies, each a list of indices of ``pieces`` (name, outline, count).

    They are sorted by decreasing area of the bounding box, and by its decreasing longer side.
    """
    boxes = [outline.bounds for _, outline, _ in pieces]
    sides = [(x1 - x0, y1 - y0) for x0, y0, x1, y1 in boxes]
    copies = [index for index, (_, _, count) in enumerate(pieces) for _ in range(count)]
    return [
        sorted(copies, key=lambda i: (-math.prod(sides[i]), i)),
        sorted(copies, key=lambda i: (-max(sides[i]), i)),
    ]


def _lay_out(area: SheetArea, title: Turns, turns: Sequence[Turns], start: _Start) -> _Layout:
    """Place the copies in the order of ``start``, each on the first sheet with room.

    ``turns`` has, for each piece, its rasters in all its turns. A sheet's title is placed before its pieces if ``start``
    says so, else where they leave room.
    """
    sheets: list[_Sheet] = []
    titles: list[Motion | None] = []
    copies: list[_LaidCopy] = []
    # For each piece, the first sheet that may have room for it. If a copy of a piece did not fit on a sheet, other copies
    # will not fit there later, because sheets only become fuller.
    first_candidate = [0] * len(turns)
    for piece in start.order:
        motion = None
        while motion is None and first_candidate[piece] < len(sheets):
            motion = sheets[first_candidate[piece]].place(turns[piece])
            if motion is None:
                first_candidate[piece] += 1
        if motion is None:
            if len(sheets) == MAX_SHEETS:
                raise NestingError(f"--sheet: the pieces need more than {MAX_SHEETS} sheets")
            sheet, title_motion, motion = _new_sheet(area, title if start.title_first else [], turns[piece])
            sheets.append(sheet)
            titles.append(title_motion)
        copies.append(_LaidCopy(piece, first_candidate[piece], motion))
    for number, sheet in enumerate(sheets):
        sheet.top_of_pieces = sheet.top
        if titles[number] is None:
            titles[number] = sheet.place(title)
    return _Layout(tuple(copies), tuple(sheets), tuple(titles))


def _new_sheet(area: SheetArea, title: Turns, piece: Turns) -> tuple[_Sheet, Motion | None, Motion]:
    """Return a sheet with the piece on it, and the motions of title and piece; without title if both do not fit."""
    sheet = _Sheet(area)
    title_motion = sheet.place(title)
    motion = sheet.place(piece)
    if motion is None:
        sheet, title_motion = _Sheet(area), None
        motion = sheet.place(piece)
    assert motion is not None, "pieces fit on an empty sheet"
    return sheet, title_motion, motion
