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
        """Return the rasters of a piece in all quarter turns in which it is not larger than the usable area.

        Turns with equal rasters are returned once.
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
        """Return the no-fit mask: for each offset of ``other`` relative to ``placed``, whether they come too near.

        They do if the raster of ``placed``, grown by the gap between pieces, and the raster of ``other`` have common
        cells. Element (0, 0) belongs to the lowest and leftmost offset with which the rasters can overlap: the last row
        and column of ``other`` lie on the first ones of ``placed``.
        """
        key = (id(placed), id(other))
        if key not in self._masks:
            # The correlation of two rasters counts their common cells for each offset. It is the convolution of one with
            # the mirror image of the other, which the product of their Fourier transforms gives.
            mirrored = other.cells[::-1, ::-1]
            rows = placed.grown.shape[0] + mirrored.shape[0] - 1
            columns = placed.grown.shape[1] + mirrored.shape[1] - 1
            size = [next_fast_len(rows, real=True), next_fast_len(columns, real=True)]
            transforms = [rfft2(raster.astype(np.float32), size) for raster in (placed.grown, mirrored)]
            common_cells = irfft2(transforms[0] * transforms[1], size)[:rows, :columns]
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
    columns, rows = math.ceil((x1 - corner_x) / CELL_MM - 1e-6), math.ceil((y1 - corner_y) / CELL_MM - 1e-6)
    # A cell touches the polygon if its centre is in the polygon, or if its square, around a point of an edge, contains
    # the centre. So each edge is drawn with a square pen: the hull of the pen at its start and the pen at its end.
    half = CELL_MM / 2 - TOUCH_MM
    pen = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    ring = np.asarray(outline.exterior.coords)
    pen_at_ends = np.concatenate([ring[:-1, None] + pen, ring[1:, None] + pen], axis=1)
    drawn_edges = shapely.convex_hull(shapely.multipoints(pen_at_ends))
    drawn = shapely.union_all([outline, *drawn_edges])
    shapely.prepare(drawn)
    centre_xs = corner_x + (np.arange(-padding_cells, columns) + 0.5) * CELL_MM
    centre_ys = corner_y + (np.arange(-padding_cells, rows) + 0.5) * CELL_MM
    return np.asarray(shapely.contains_xy(drawn, *np.meshgrid(centre_xs, centre_ys)))


def _places_along(spare_mm: float) -> int:
    """Return at how many cells along a side of the sheet a piece can begin, if it leaves this length free."""
    return max(0, math.floor(spare_mm / CELL_MM + 1e-6)) + 1
