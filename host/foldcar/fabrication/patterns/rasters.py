"""Rasters of pieces on a sheet: the cells that each touches, and where two pieces come too near to each other.

Input: outlines in millimetres, the sheet's size, margin and gap. Output: rasters in quarter turns, and no-fit masks.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2
from shapely.geometry import Polygon

from foldcar.fabrication.patterns.drawing import Motion, Point

CELL_MM = 1.0
# Rounding errors of outlines: an overlap with a cell below this does not count.
TOUCH_MM = 1e-4
# Rounding errors of lengths in cells, and of the gap in cells.
ROUNDING, GAP_ROUNDING = 1e-6, 1e-9

Cells = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class RotatedPiece:
    """A piece in one of four turns, its lower left corner at the first cell's.

    ``cells`` are the cells that it touches, ``grown`` those that it touches when grown by the gap; ``grown`` has
    ``padding_cells`` more cells below and left. The first cell may be in ``place_rows`` rows and ``place_columns``
    columns of the sheet.
    """

    turn: int
    cells: Cells
    grown: Cells
    padding_cells: int
    corner_mm: Point
    place_rows: int
    place_columns: int


# The turns of one piece.
Turns = Sequence[RotatedPiece]


class SheetArea:
    """A sheet's usable area as a raster, with the no-fit masks of pairs of pieces."""

    def __init__(self, size_mm: tuple[float, float], margin_mm: float, gap_mm: float) -> None:
        self.margin_mm = margin_mm
        self.gap_mm = gap_mm
        self.usable_mm = (size_mm[0] - 2 * margin_mm, size_mm[1] - 2 * margin_mm)
        self._masks: dict[tuple[int, int], tuple[RotatedPiece, RotatedPiece, Cells]] = {}

    def turned(self, outline: Polygon) -> list[RotatedPiece]:
        """Return the rasters of a piece in all quarter turns in which it fits on a sheet.

        A raster says which cells of a grid the piece touches. A second raster, of the piece grown by the gap between
        pieces, needs more cells on all sides: ``padding_cells``. Turns with equal rasters are returned once.
        """
        # The gap in cells, rounded up.
        padding_cells = math.ceil(self.gap_mm / CELL_MM - GAP_ROUNDING)
        usable_x, usable_y = self.usable_mm
        rotated_pieces: list[RotatedPiece] = []
        for turn in range(4):
            motion = Motion(turn)
            turned_outline = Polygon([motion.apply((x, y)) for x, y in outline.exterior.coords])
            left, bottom, right, top = turned_outline.bounds
            # The length that the piece leaves free along each side of the sheet.
            free_x, free_y = usable_x - (right - left), usable_y - (top - bottom)
            if min(free_x, free_y) < -ROUNDING:
                continue
            cells = _touched(turned_outline, (left, bottom), padding_cells=0)
            if any(np.array_equal(cells, other.cells) for other in rotated_pieces):
                continue
            grown_outline = turned_outline.buffer(self.gap_mm, quad_segs=16)
            rotated_pieces.append(
                RotatedPiece(
                    turn=turn,
                    cells=cells,
                    grown=_touched(grown_outline, (left, bottom), padding_cells),
                    padding_cells=padding_cells,
                    corner_mm=(left, bottom),
                    place_rows=_places_along(free_y),
                    place_columns=_places_along(free_x),
                )
            )
        return rotated_pieces

    def no_fit_mask(self, placed: RotatedPiece, other: RotatedPiece) -> Cells:
        """Return the *no-fit mask* of two pieces: where ``other`` may not lie, relative to ``placed``.

        Each element stands for an offset of ``other``. It is true if the pieces are then nearer to each other than the
        gap, which means that ``other`` touches a cell of ``placed``, grown by the gap. At element (0, 0), the uppermost
        row and the rightmost column of ``other`` lie on the lowest row and the leftmost column of the grown ``placed``.
        With the row and the column of the element, ``other`` moves up and right.
        """
        key = (id(placed), id(other))
        if key not in self._masks:
            # Counts are whole numbers: 0.5 is far above the rounding errors.
            mask = _common_cells(placed.grown, other.cells) > 0.5
            # The pieces are kept with the mask, so that they stay alive and no other pieces get their ids.
            self._masks[key] = (placed, other, mask)
        _, _, mask = self._masks[key]
        return mask

    def motion(self, turned: RotatedPiece, row: int, column: int) -> Motion:
        """Return the motion of a piece whose first cell is at that row and column."""
        x = self.margin_mm + column * CELL_MM - turned.corner_mm[0]
        y = self.margin_mm + row * CELL_MM - turned.corner_mm[1]
        return Motion(turned.turn, (x, y))


def _common_cells(fixed: Cells, moved: Cells) -> NDArray[np.float32]:
    """Return how many cells two rasters have in common, for each offset of ``moved`` at which they overlap.

    This is the correlation of the rasters, which is the convolution of one with the mirror image of the other. The
    Fourier transform of a convolution is the product of the transforms.
    """
    mirrored = moved[::-1, ::-1]
    rows = fixed.shape[0] + mirrored.shape[0] - 1
    columns = fixed.shape[1] + mirrored.shape[1] - 1
    # Some sizes that are a little larger are transformed faster.
    size = [next_fast_len(rows, real=True), next_fast_len(columns, real=True)]
    fixed_transform = rfft2(fixed.astype(np.float32), size)
    mirrored_transform = rfft2(mirrored.astype(np.float32), size)
    return np.asarray(irfft2(fixed_transform * mirrored_transform, size)[:rows, :columns])


def _touched(outline: Polygon, corner_mm: Point, padding_cells: int) -> Cells:
    """Return the raster (rows, columns) of cells that the polygon touches.

    The cell that begins at ``corner_mm`` is the first one, except that ``padding_cells`` rows are added below it, and as
    many columns on its left.
    """
    _, _, right, top = outline.bounds
    corner_x, corner_y = corner_mm
    columns = math.ceil((right - corner_x) / CELL_MM - ROUNDING)
    rows = math.ceil((top - corner_y) / CELL_MM - ROUNDING)
    # A cell touches the polygon if the cell's centre is in it, or if an edge passes through the cell. An edge passes
    # through a cell if the centre is in the area that a square pen, as large as a cell, draws along the edge.
    touching_centres = shapely.union_all([outline, *_drawn_by_square_pen(outline)])
    shapely.prepare(touching_centres)
    centre_xs = corner_x + (np.arange(-padding_cells, columns) + 0.5) * CELL_MM
    centre_ys = corner_y + (np.arange(-padding_cells, rows) + 0.5) * CELL_MM
    return np.asarray(shapely.contains_xy(touching_centres, *np.meshgrid(centre_xs, centre_ys)))


def _drawn_by_square_pen(outline: Polygon) -> Any:
    """Return an array of polygons, one for each edge of ``outline``: the area that a square pen draws along the edge.

    The pen is nearly as large as a cell. The area is the convex hull of the pen at the start of the edge and the pen at
    its end.
    """
    half = CELL_MM / 2 - TOUCH_MM
    pen = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    points = np.asarray(outline.exterior.coords)
    # The corners of the pen at each start and at each end: (edges, 4, 2).
    pen_at_starts = points[:-1, np.newaxis] + pen
    pen_at_ends = points[1:, np.newaxis] + pen
    return shapely.convex_hull(shapely.multipoints(np.concatenate([pen_at_starts, pen_at_ends], axis=1)))


def _places_along(spare_mm: float) -> int:
    """Return at how many cells along a side of the sheet a piece can begin, if it leaves this length free."""
    return max(0, math.floor(spare_mm / CELL_MM + ROUNDING)) + 1
