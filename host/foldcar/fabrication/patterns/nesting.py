"""Nests pieces on few sheets in quarter turns, also into notches and gaps of each other.

Input: outlines in millimetres with counts, the sheet's size, margin and gap. Output: sheet and motion of every copy.

Pieces are placed one after the other, each as low and then as far left as possible on the first sheet with room. A local
search over their orders starts with the largest piece first, exchanges pieces and keeps orders that take less film. A
piece is a raster of the cells that it touches. The no-fit mask of two pieces is the correlation of their rasters, one of
them grown by the gap; it is computed once for each pair. The search has a fixed seed and ends after a fixed amount of
work, not time: the same pieces give the same layout.
"""

import itertools
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2
from shapely.geometry import Polygon

from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.drawing import Motion, Point
from foldcar.fabrication.patterns.sheet_fit import too_large_message

CELL_MM = 1.0
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
# Rounding errors of outlines: an overlap with a cell below this does not count.
TOUCH_MM = 1e-4

Cells = NDArray[np.bool_]


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


@dataclass(frozen=True, slots=True, eq=False)
class _RotatedPiece:
    """A piece in one of four turns, its lower left corner at the first cell's.

    ``cells`` are the cells that it touches, ``grown`` those that it touches when grown by the gap; ``grown`` has
    ``padding_cells`` more cells below and left. ``places`` are the numbers of rows and columns for its first cell.
    """

    turn: int
    cells: Cells
    grown: Cells
    padding_cells: int
    corner_mm: Point
    places: tuple[int, int]


# The turns of one piece.
_Turns = Sequence[_RotatedPiece]


class _Area:
    """A sheet's usable area as a raster, with the no-fit masks of pairs of pieces."""

    def __init__(self, size_mm: tuple[float, float], margin_mm: float, gap_mm: float) -> None:
        self.margin_mm = margin_mm
        self.gap_mm = gap_mm
        self.usable_mm = (size_mm[0] - 2 * margin_mm, size_mm[1] - 2 * margin_mm)
        self._masks: dict[tuple[int, int], tuple[_RotatedPiece, _RotatedPiece, Cells]] = {}

    def turned(self, outline: Polygon) -> list[_RotatedPiece]:
        """Return the piece's rasters in each of four quarter turns that fits into the empty area, without duplicates."""
        result: list[_RotatedPiece] = []
        for turn in range(4):
            motion = Motion(turn)
            turned_outline = Polygon([motion.apply((x, y)) for x, y in outline.exterior.coords])
            x0, y0, x1, y1 = turned_outline.bounds
            spare_mm = [side - length for side, length in zip(self.usable_mm, (x1 - x0, y1 - y0), strict=True)]
            if min(spare_mm) < -1e-6:
                continue
            cells = _touched(turned_outline, (x0, y0), 0)
            if any(np.array_equal(cells, other.cells) for other in result):
                continue
            padding_cells = math.ceil(self.gap_mm / CELL_MM - 1e-9)
            grown = _touched(turned_outline.buffer(self.gap_mm, quad_segs=16), (x0, y0), padding_cells)
            columns, rows = (max(0, math.floor(length / CELL_MM + 1e-6)) + 1 for length in spare_mm)
            result.append(_RotatedPiece(turn, cells, grown, padding_cells, (x0, y0), (rows, columns)))
        return result

    def no_fit_mask(self, placed: _RotatedPiece, other: _RotatedPiece) -> Cells:
        """Return the no-fit mask: for each offset of ``other`` relative to ``placed``, whether they come too near.

        ``placed`` is grown by the gap between pieces; they come too near where its raster overlaps the other one. The
        correlation of two rasters counts the common cells for every offset. It is computed by FFT, as a convolution with
        the mirrored raster. The first element is the lowest and leftmost offset (see `_Sheet.blocked`).
        """
        key = (id(placed), id(other))
        if key not in self._masks:
            rows, columns = (a + b - 1 for a, b in zip(placed.grown.shape, other.cells.shape, strict=True))
            size = [next_fast_len(rows, real=True), next_fast_len(columns, real=True)]
            rasters = placed.grown, other.cells[::-1, ::-1]
            grown, mirrored = (rfft2(raster.astype(np.float32), size) for raster in rasters)
            # Counts of cells: 0.5 is far above the rounding errors. The pieces are kept, so that no other gets their ids.
            self._masks[key] = (placed, other, irfft2(grown * mirrored, size)[:rows, :columns] > 0.5)
        _, _, mask = self._masks[key]
        return mask

    def motion(self, turned: _RotatedPiece, row: int, column: int) -> Motion:
        """Return the motion of a piece whose first cell is at that row and column."""
        x = self.margin_mm + column * CELL_MM - turned.corner_mm[0]
        y = self.margin_mm + row * CELL_MM - turned.corner_mm[1]
        return Motion(turned.turn, (x, y))


def _touched(outline: Polygon, corner_mm: Point, padding_cells: int) -> Cells:
    """Return the raster (rows, columns) of cells that the polygon touches.

    Cell (0, 0) begins at ``corner_mm``, after ``padding_cells`` rows and columns below and left of it.
    """
    _, _, x1, y1 = outline.bounds
    columns, rows = (math.ceil((high - low) / CELL_MM - 1e-6) for low, high in zip(corner_mm, (x1, y1), strict=True))
    # A square touches the polygon if its centre is in the polygon or in an edge drawn with the square as a pen.
    half = CELL_MM / 2 - TOUCH_MM
    ring = np.asarray(outline.exterior.coords)
    pen = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    strokes = np.concatenate([ring[:-1, None] + pen, ring[1:, None] + pen], axis=1)
    drawn = shapely.union_all([outline, *shapely.convex_hull(shapely.multipoints(strokes))])
    shapely.prepare(drawn)
    xs = corner_mm[0] + (np.arange(-padding_cells, columns) + 0.5) * CELL_MM
    ys = corner_mm[1] + (np.arange(-padding_cells, rows) + 0.5) * CELL_MM
    return np.asarray(shapely.contains_xy(drawn, *np.meshgrid(xs, ys)))


@dataclass(slots=True)
class _Sheet:
    """The pieces on one sheet with their rows and columns, their highest row, and the blocked places of others."""

    area: _Area
    placed: list[tuple[_RotatedPiece, int, int]] = field(default_factory=list)
    top: int = 0
    top_of_pieces: int = 0
    _blocked: dict[int, tuple[Cells, int]] = field(default_factory=dict)

    def blocked(self, turned: _RotatedPiece) -> Cells:
        """Return a mask of the (row, column) at which the piece's first cell would bring it too near to another piece.

        The mask is kept for each piece, and updated by the pieces placed since the last call.
        """
        blocked, placed_count = self._blocked.get(id(turned)) or (np.zeros(turned.places, dtype=bool), 0)
        rows, columns = turned.places
        for other, row, column in self.placed[placed_count:]:
            # The mask's first element is the piece at first_row and first_column, which may lie outside the sheet.
            mask = self.area.no_fit_mask(other, turned)
            first_row = row - other.padding_cells - turned.cells.shape[0] + 1
            first_column = column - other.padding_cells - turned.cells.shape[1] + 1
            end_row, end_column = min(rows, first_row + mask.shape[0]), min(columns, first_column + mask.shape[1])
            row_from, column_from = max(0, first_row), max(0, first_column)
            if row_from < end_row and column_from < end_column:
                blocked[row_from:end_row, column_from:end_column] |= mask[
                    row_from - first_row : end_row - first_row, column_from - first_column : end_column - first_column
                ]
        self._blocked[id(turned)] = (blocked, len(self.placed))
        return blocked

    def place(self, turns: _Turns) -> Motion | None:
        """Place the piece, in one of its turns, where its top is lowest, then leftmost; return its motion.

        None if there is no room in any turn.
        """
        candidates = []
        for turned in turns:
            blocked = self.blocked(turned).ravel()
            first_free = int(blocked.argmin())
            if not blocked[first_free]:
                row, column = divmod(first_free, turned.places[1])
                # Top, column and turn decide.
                candidates.append((row + turned.cells.shape[0], column, turned.turn, row, turned))
        if not candidates:
            return None
        top, column, _, row, turned = min(candidates, key=lambda place: place[:3])
        self.placed.append((turned, row, column))
        self.top = max(self.top, top)
        return self.area.motion(turned, row, column)


def nest(
    pieces: Sequence[tuple[str, Polygon, int]],
    size_mm: tuple[float, float],
    margin_mm: float,
    gap_mm: float,
    title_mm: tuple[float, float],
    box_mm: tuple[float, float] = (0.0, 0.0),
) -> Nest:
    """Lay out the copies of pieces (name, outline, count) on few sheets, each with a title and a box if there is room.

    ``size_mm`` is that of a sheet, ``title_mm`` and ``box_mm`` (for a QR code) are those of title and box; a size 0 means
    without it. Boxes take places that pieces and titles leave free. The last sheet is the one with most film left. Raises
    NestingError, which names the piece, its size and the sheet's, if a piece does not fit on a sheet.
    """
    area = _Area(size_mm, margin_mm, gap_mm)
    # In the first turn that fits, or [] if none does.
    title, box = (area.turned(shapely.box(0, 0, *size))[:1] if min(size) > 0 else [] for size in (title_mm, box_mm))
    if title and title[0].turn:
        # A title is not turned, so that it can be read.
        title = []
    turns = [area.turned(outline) for _, outline, _ in pieces]
    for (name, outline, _), turned in zip(pieces, turns, strict=True):
        if not turned:
            raise NestingError(too_large_message(name, outline, size_mm, margin_mm))
    best = _search_layout(area, title, turns, _first_orders(pieces), _min_sheets(area, pieces))
    sheet_order = sorted(range(len(best.sheets)), key=lambda k: (best.sheets[k] is best.last, k))
    placements: list[list[NestedCopy]] = [[] for _ in pieces]
    for index, sheet, motion in best.copies:
        placements[index].append(NestedCopy(sheet_order.index(sheet), motion))
    boxes = tuple(best.sheets[k].place(box) for k in sheet_order)
    return Nest(tuple(map(tuple, placements)), tuple(best.titles[k] for k in sheet_order), boxes)


def _min_sheets(area: _Area, pieces: Sequence[tuple[str, Polygon, int]]) -> int:
    """Return a lower bound of the number of sheets, from areas.

    Pieces grown by half the gap do not overlap, and lie in the usable area grown by as much.
    """
    occupied_mm2: float = sum(outline.buffer(area.gap_mm / 2).area * count for _, outline, count in pieces)
    return math.ceil(occupied_mm2 / math.prod(side + area.gap_mm for side in area.usable_mm))


@dataclass(frozen=True, slots=True)
class _Layout:
    """``copies``: piece's index, sheet and motion; the sheets and the motions of their titles."""

    copies: tuple[tuple[int, int, Motion], ...]
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


def _search_layout(
    area: _Area, title: _Turns, turns: Sequence[_Turns], orders: Sequence[list[int]], min_sheets: int
) -> _Layout:
    """Find the best layout by local search over the order of pieces and the time when the title is placed.

    A change is kept if it does not cost more film. The best layout has the fewest sheets without a title, because its
    bar proves the scale; then it takes the least film. ``min_sheets`` is a lower bound of the number of sheets.
    """
    rng = random.Random(SEED)
    # Each start is an order and whether the title is placed first; each first layout has its start.
    starts = itertools.product(orders, (True, False))
    first_layouts = [(_lay_out(area, title, turns, *start), *start) for start in starts]
    current, order, title_first = min(first_layouts, key=lambda start: start[0].film_cost)

    def search_cost(layout: _Layout) -> tuple[int, ...]:
        return layout.titles.count(None), *layout.film_cost

    best = min((layout for layout, _, _ in first_layouts), key=search_cost)
    positions = sum(math.prod(turned.places) for index in order for turned in turns[index])
    tries = min(MAX_TRIES, int(MAX_POSITIONS / positions)) if len(order) > 1 else 0
    sparse_cells = SPARSE_FRACTION * math.prod(area.usable_mm) / CELL_MM**2
    for number in range(MAX_EXTENSIONS * tries):
        # Search on only while a sheet might be saved: there are more than the bound, and the last is nearly empty.
        if number >= tries and (len(best.sheets) <= min_sheets or best.film_cost[-1] > sparse_cells):
            break
        change_title = rng.random() < TITLE_CHANGE_PROBABILITY
        changed = (order, not title_first) if change_title else (_changed_order(order, rng), title_first)
        layout = _lay_out(area, title, turns, *changed)
        if layout.film_cost <= current.film_cost:
            current, (order, title_first) = layout, changed
        best = min(best, layout, key=search_cost)
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


def _lay_out(area: _Area, title: _Turns, turns: Sequence[_Turns], order: Sequence[int], title_first: bool) -> _Layout:
    """Place the copies in that order, each on the first sheet with room. ``turns`` are the pieces' turned rasters.

    With ``title_first`` a sheet's title is placed before its pieces, else where they leave room.
    """
    sheets: list[_Sheet] = []
    titles: list[Motion | None] = []
    # Each copy's piece, sheet and motion.
    copies: list[tuple[int, int, Motion]] = []
    # By piece, the first sheet that may have room: a sheet on which the piece did not fit only fills up.
    first_candidate = [0] * len(turns)
    for index in order:
        motion = None
        while motion is None and first_candidate[index] < len(sheets):
            motion = sheets[first_candidate[index]].place(turns[index])
            first_candidate[index] += motion is None
        if motion is None:
            if len(sheets) == MAX_SHEETS:
                raise NestingError(f"--sheet: the pieces need more than {MAX_SHEETS} sheets")
            sheet, title_motion, motion = _new_sheet(area, title if title_first else [], turns[index])
            sheets.append(sheet)
            titles.append(title_motion)
        copies.append((index, first_candidate[index], motion))
    for number, sheet in enumerate(sheets):
        sheet.top_of_pieces = sheet.top
        titles[number] = titles[number] or sheet.place(title)
    return _Layout(tuple(copies), tuple(sheets), tuple(titles))


def _new_sheet(area: _Area, title: _Turns, piece: _Turns) -> tuple[_Sheet, Motion | None, Motion]:
    """Return a sheet with the piece on it, and the motions of title and piece; without title if both do not fit."""
    sheet = _Sheet(area)
    title_motion = sheet.place(title)
    motion = sheet.place(piece)
    if motion is None:
        sheet, title_motion = _Sheet(area), None
        motion = sheet.place(piece)
    assert motion is not None, "pieces fit on an empty sheet"
    return sheet, title_motion, motion
