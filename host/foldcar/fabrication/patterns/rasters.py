"""Rasters of pieces on a sheet: the cells that each touches, and where two pieces come too near to each other.

Input: outlines in millimetres, the sheet's size, margin and gap. Output: rasters in quarter turns, and no-fit masks.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2
from shapely.geometry import Polygon

from foldcar.fabrication.patterns.drawing import Motion, Point

CELL_MM = 1.0
# Rounding errors of outlines: an overlap with a cell below this does not count.
TOUCH_MM = 1e-4

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
        padding_cells = math.ceil(self.gap_mm / CELL_MM - 1e-9)
        usable_x, usable_y = self.usable_mm
        rotated_pieces: list[RotatedPiece] = []
        for turn in range(4):
            motion = Motion(turn)
            turned_outline = Polygon([motion.apply((x, y)) for x, y in outline.exterior.coords])
            x0, y0, x1, y1 = turned_outline.bounds
            spare_x, spare_y = usable_x - (x1 - x0), usable_y - (y1 - y0)
            if min(spare_x, spare_y) < -1e-6:
                continue
            cells = _touched(turned_outline, (x0, y0), padding_cells=0)
            if any(np.array_equal(cells, other.cells) for other in rotated_pieces):
                continue
            grown_outline = turned_outline.buffer(self.gap_mm, quad_segs=16)
            rotated_piece = RotatedPiece(
                turn=turn,
                cells=cells,
                grown=_touched(grown_outline, (x0, y0), padding_cells),
                padding_cells=padding_cells,
                corner_mm=(x0, y0),
                place_rows=_places_along(spare_y),
                place_columns=_places_along(spare_x),
            )
            rotated_pieces.append(rotated_piece)
        return rotated_pieces

    def no_fit_mask(self, placed: RotatedPiece, other: RotatedPiece) -> Cells:
        """Return the *no-fit mask* of two pieces: where ``other`` may not lie, relative to ``placed``.

        Each element stands for an offset of ``other``. It is true if the distance of the pieces is then smaller than the
        gap: if the raster of ``placed``, grown by the gap, and the raster of ``other`` have common cells. Element (0, 0)
        is for the offset at which ``other`` lies farthest below and left of ``placed``, so that only one cell of each can
        meet: the last cell of ``other`` and the first cell of ``placed``.
        """
        key = (id(placed), id(other))
        if key not in self._masks:
            # The correlation of two rasters counts their common cells for each offset. It is the convolution of one with
            # the mirror image of the other. The Fourier transform of a convolution is the product of the transforms.
            mirrored = other.cells[::-1, ::-1]
            rows = placed.grown.shape[0] + mirrored.shape[0] - 1
            columns = placed.grown.shape[1] + mirrored.shape[1] - 1
            size = [next_fast_len(rows, real=True), next_fast_len(columns, real=True)]
            placed_transform = rfft2(placed.grown.astype(np.float32), size)
            mirrored_transform = rfft2(mirrored.astype(np.float32), size)
            common_cells = irfft2(placed_transform * mirrored_transform, size)[:rows, :columns]
            # Counts are whole numbers: 0.5 is far above the rounding errors.
            mask = common_cells > 0.5
            # The pieces are kept with the mask, so that they stay alive and no other pieces get their ids.
            self._masks[key] = (placed, other, mask)
        _, _, mask = self._masks[key]
        return mask

    def motion(self, turned: RotatedPiece, row: int, column: int) -> Motion:
        """Return the motion of a piece whose first cell is at that row and column."""
        x = self.margin_mm + column * CELL_MM - turned.corner_mm[0]
        y = self.margin_mm + row * CELL_MM - turned.corner_mm[1]
        return Motion(turned.turn, (x, y))


def _touched(outline: Polygon, corner_mm: Point, padding_cells: int) -> Cells:
    """Return the raster (rows, columns) of cells that the polygon touches.

    The cell that begins at ``corner_mm`` is the first one, except that ``padding_cells`` rows are added below it, and as
    many columns on its left.
    """
    _, _, x1, y1 = outline.bounds
    corner_x, corner_y = corner_mm
    columns = math.ceil((x1 - corner_x) / CELL_MM - 1e-6)
    rows = math.ceil((y1 - corner_y) / CELL_MM - 1e-6)
    # A cell touches the polygon if the cell's centre is in it, or if an edge passes through the cell. An edge passes
    # through a cell if the centre is in the area that a square pen, as large as a cell, draws along the edge.
    half = CELL_MM / 2 - TOUCH_MM
    pen = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    # The drawn area of an edge is the convex hull of the pen at its start and the pen at its end: eight points.
    ring = np.asarray(outline.exterior.coords)
    pen_at_starts = ring[:-1, np.newaxis] + pen
    pen_at_ends = ring[1:, np.newaxis] + pen
    drawn_edges = shapely.convex_hull(shapely.multipoints(np.concatenate([pen_at_starts, pen_at_ends], axis=1)))
    drawn = shapely.union_all([outline, *drawn_edges])
    shapely.prepare(drawn)
    # The centres of all cells.
    centre_xs = corner_x + (np.arange(-padding_cells, columns) + 0.5) * CELL_MM
    centre_ys = corner_y + (np.arange(-padding_cells, rows) + 0.5) * CELL_MM
    return np.asarray(shapely.contains_xy(drawn, *np.meshgrid(centre_xs, centre_ys)))


def _places_along(spare_mm: float) -> int:
    """Return at how many cells along a side of the sheet a piece can begin, if it leaves this length free."""
    return max(0, math.floor(spare_mm / CELL_MM + 1e-6)) + 1
