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


class _PlacedPiece(NamedTuple):
    """A piece on a sheet, and the row and column of its first cell."""

    turned: RotatedPiece
    row: int
    column: int


@dataclass(slots=True)
class _BlockedPlaces:
    """The places (row, column) at which a piece may not begin, because of the first ``placed_count`` placed pieces."""

    mask: Cells
    placed_count: int = 0


@dataclass(slots=True)
class _Sheet:
    """The pieces on one sheet, their highest row, and the blocked places of other pieces by their ids."""

    area: SheetArea
    placed: list[_PlacedPiece] = field(default_factory=list)
    top: int = 0
    top_of_pieces: int = 0
    _blocked: dict[int, _BlockedPlaces] = field(default_factory=dict)

    def blocked(self, turned: RotatedPiece) -> Cells:
        """Return the places (rows, columns) at which the piece may not begin, too near to other pieces on the sheet.

        The result is kept for each piece. A further call adds the pieces that were placed since then.
        """
        if id(turned) not in self._blocked:
            nothing = np.zeros((turned.place_rows, turned.place_columns), dtype=bool)
            self._blocked[id(turned)] = _BlockedPlaces(nothing)
        blocked = self._blocked[id(turned)]
        height, width = turned.cells.shape
        for other in self.placed[blocked.placed_count :]:
            no_fit = self.area.no_fit_mask(other.turned, turned)
            # Where the piece begins at the first element of the mask: below and left of the other piece.
            first_row = other.row - other.turned.padding_cells - (height - 1)
            first_column = other.column - other.turned.padding_cells - (width - 1)
            _add_mask(blocked.mask, no_fit, first_row, first_column)
        blocked.placed_count = len(self.placed)
        return blocked.mask

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
        self.placed.append(_PlacedPiece(best.turned, best.row, best.column))
        self.top = max(self.top, best.top)
        return self.area.motion(best.turned, best.row, best.column)


def _add_mask(target: Cells, mask: Cells, first_row: int, first_column: int) -> None:
    """Set those elements of ``target`` that are set in ``mask``, whose first element is at this row and column.

    A part of the mask may lie outside of the target, even its first element.
    """
    rows, columns = target.shape
    start_row, end_row = max(0, first_row), min(rows, first_row + mask.shape[0])
    start_column, end_column = max(0, first_column), min(columns, first_column + mask.shape[1])
    if start_row < end_row and start_column < end_column:
        mask_rows = slice(start_row - first_row, end_row - first_row)
        mask_columns = slice(start_column - first_column, end_column - first_column)
        target[start_row:end_row, start_column:end_column] |= mask[mask_rows, mask_columns]


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
    turns = [area.turned(outline) for _, outline, _ in pieces]
    for (name, outline, _), turned in zip(pieces, turns, strict=True):
        if not turned:
            raise NestingError(too_large_message(name, outline, size_mm, margin_mm))
    best = _search_layout(area, title, turns, _first_orders(pieces), _min_sheets(area, pieces))
    # The sheets of the layout keep their order, but the one with most film left comes last.
    last = best.last
    sheet_order = sorted(range(len(best.sheets)), key=lambda number: best.sheets[number] is last)
    copies_of_pieces: list[list[NestedCopy]] = [[] for _ in pieces]
    for copy in best.copies:
        new_number = sheet_order.index(copy.sheet)
        copies_of_pieces[copy.piece].append(NestedCopy(new_number, copy.motion))
    return Nest(
        placements=tuple(map(tuple, copies_of_pieces)),
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
        occupied_cells = sum(int(placed.turned.cells.sum()) for placed in self.last.placed)
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
    starts = []
    for order in orders:
        starts += [_Start(order, title_first=True), _Start(order, title_first=False)]
    layouts = [_lay_out(area, title, turns, start) for start in starts]
    best = min(layouts, key=lambda layout: layout.cost)
    # The search begins with the layout that needs the least film.
    film_costs = [layout.film_cost for layout in layouts]
    first_index = film_costs.index(min(film_costs))
    current, start = layouts[first_index], starts[first_index]
    tries = _number_of_tries(turns, start.order)
    sparse_cells = SPARSE_FRACTION * math.prod(area.usable_mm) / CELL_MM**2
    for number in range(MAX_EXTENSIONS * tries):
        # After these tries, the search goes on only while it might save a sheet: there are more sheets than the lower
        # bound, and the last one is nearly empty.
        might_save_sheet = len(best.sheets) > min_sheets and best.film_cost[-1] <= sparse_cells
        if number >= tries and not might_save_sheet:
            break
        changed = _changed_start(start, rng)
        layout = _lay_out(area, title, turns, changed)
        # A changed layout that needs no more film is changed further.
        if layout.film_cost <= current.film_cost:
            current, start = layout, changed
        best = min(best, layout, key=lambda layout: layout.cost)
    return best


def _number_of_tries(turns: Sequence[Turns], order: Sequence[int]) -> int:
    """Return how many layouts the search tries, so that it does not examine too many positions of pieces.

    ``turns`` has the rasters of each piece. A single piece has one order only, so nothing is tried.
    """
    if len(order) <= 1:
        return 0
    positions = 0
    for piece in order:
        positions += sum(turned.place_rows * turned.place_columns for turned in turns[piece])
    return min(MAX_TRIES, int(MAX_POSITIONS / positions))


def _changed_start(start: _Start, rng: random.Random) -> _Start:
    """Return ``start`` with a random change: usually of the order, sometimes of when the titles are placed."""
    if rng.random() < TITLE_CHANGE_PROBABILITY:
        return _Start(start.order, not start.title_first)
    return _Start(_changed_order(start.order, rng), start.title_first)


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

    The first order is by decreasing area of the bounding box, the second one by decreasing longer side of this box.
    """
    sides = []
    copies: list[int] = []
    for index, (_, outline, count) in enumerate(pieces):
        x_min, y_min, x_max, y_max = outline.bounds
        sides.append((x_max - x_min, y_max - y_min))
        copies += [index] * count
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
    # For each piece, the number of full sheets: those on which a copy of it did not fit. Later copies will not fit there
    # either, because sheets only become fuller.
    full_sheets = [0] * len(turns)
    for piece in start.order:
        motion = None
        for sheet in sheets[full_sheets[piece] :]:
            motion = sheet.place(turns[piece])
            if motion is not None:
                break
            full_sheets[piece] += 1
        if motion is None:
            if len(sheets) == MAX_SHEETS:
                raise NestingError(f"--sheet: the pieces need more than {MAX_SHEETS} sheets")
            new_sheet, title_motion, motion = _new_sheet(area, title if start.title_first else [], turns[piece])
            sheets.append(new_sheet)
            titles.append(title_motion)
        # It was placed on the first sheet that is not full.
        copies.append(_LaidCopy(piece, full_sheets[piece], motion))
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
