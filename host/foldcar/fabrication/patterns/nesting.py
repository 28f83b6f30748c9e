"""Nests pieces on few sheets in quarter turns, also into notches and gaps of each other (bottom-left heuristic).

Input: outlines in millimetres with counts, the sheet's size, margin and gap. Output: sheet and motion of every copy. The
largest pieces come first, each as low and then as far left as possible. The occupied area of a sheet is a raster; the
free positions of a piece are the zeros of its correlation with the piece's raster, computed by FFT. Deterministic.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2
from shapely.geometry import Polygon

from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.drawing import Motion

CELL_MM = 1.0
MAX_SHEETS = 200


class NestingError(FoldcarError):
    """A piece that does not fit on a sheet, or pieces that need too many sheets."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The sheet of a copy and its motion from the piece's frame onto it."""

    sheet: int
    motion: Motion


@dataclass(frozen=True, slots=True)
class Nest:
    """A layout: ``placements[i]`` are the copies of piece i; ``reserved``: whether each sheet's corner is kept free.

    ``free`` is the motion of the box that was to find room on each sheet, None where there is none.
    """

    placements: tuple[tuple[Placement, ...], ...]
    reserved: tuple[bool, ...]
    free: tuple[Motion | None, ...] = ()


@dataclass(frozen=True, slots=True)
class _Turned:
    """A piece in one of four turns: its cells (gap included), their spectrum, its corner relative to the first cell."""

    turn: int
    cells: NDArray[np.bool_]
    spectrum: NDArray[np.complexfloating]
    corner_mm: tuple[float, float]


class _Area:
    """A sheet's usable area as a raster, with a border for the gaps of pieces at its edge."""

    def __init__(self, size_mm: tuple[float, float], margin_mm: float, gap_mm: float) -> None:
        self.margin_mm = margin_mm
        usable = [side - 2 * margin_mm for side in size_mm]
        self.counts = [math.ceil(side / CELL_MM - 1e-9) for side in usable]
        self.cell_mm = [side / count for side, count in zip(usable, self.counts, strict=True)]
        # A cell is occupied if its centre is within half the gap plus half its diagonal of a piece.
        self.reach_mm = gap_mm / 2 + math.hypot(*self.cell_mm) / 2
        self.apron = math.ceil(self.reach_mm / min(self.cell_mm))
        self.shape = (self.counts[1] + 2 * self.apron, self.counts[0] + 2 * self.apron)
        # Lengths whose Fourier transforms are quick.
        self.padded = tuple(next_fast_len(length, real=True) for length in self.shape)

    def turned(self, outline: Polygon) -> list[_Turned]:
        """The piece in every turn that fits into the empty area."""
        found: list[_Turned] = []
        for turn in range(4):
            motion = Motion(turn)
            moved = Polygon([motion.apply((x, y)) for x, y in outline.exterior.coords])
            x0, y0, x1, y1 = moved.bounds
            columns, rows = (
                math.ceil(length / cell - 1e-6)
                for length, cell in zip((x1 - x0, y1 - y0), self.cell_mm, strict=True)
            )
            if columns > self.counts[0] or rows > self.counts[1]:
                continue
            xs = x0 + (np.arange(-self.apron, columns + self.apron) + 0.5) * self.cell_mm[0]
            ys = y0 + (np.arange(-self.apron, rows + self.apron) + 0.5) * self.cell_mm[1]
            grown = moved.buffer(self.reach_mm, quad_segs=4)
            shapely.prepare(grown)
            cells = np.asarray(shapely.contains_xy(grown, *np.meshgrid(xs, ys)))
            if not any(np.array_equal(cells, other.cells) for other in found):
                found.append(_Turned(turn, cells, self.spectrum(cells), (x0, y0)))
        return found

    def spectrum(self, cells: NDArray[np.bool_]) -> NDArray[np.complexfloating]:
        """The cells' Fourier transform, padded to the area."""
        # Single precision suffices for counts of cells; scipy's transform takes less than half of numpy's time.
        result: NDArray[np.complexfloating] = rfft2(cells.astype(np.float32), self.padded)
        return result

    def motion(self, turned: _Turned, row: int, column: int) -> Motion:
        """The motion of a piece whose first cell is at that row and column."""
        x = self.margin_mm + column * self.cell_mm[0] - turned.corner_mm[0]
        y = self.margin_mm + row * self.cell_mm[1] - turned.corner_mm[1]
        return Motion(turned.turn, (x, y))


class _Sheet:
    """The occupied cells of one sheet."""

    def __init__(self, area: _Area) -> None:
        self.area = area
        self.taken = np.zeros(area.shape, dtype=bool)
        self.free_cells = self.taken.size
        self._spectrum: NDArray[np.complexfloating] | None = None

    def lowest(self, turned: _Turned) -> tuple[int, int] | None:
        """The lowest row, and in it the leftmost column, at which the piece overlaps nothing; None if there is none."""
        rows = self.taken.shape[0] - turned.cells.shape[0] + 1
        columns = self.taken.shape[1] - turned.cells.shape[1] + 1
        if self._spectrum is None:
            self._spectrum = self.area.spectrum(self.taken)
        # Positions that wrap around are discarded; for the others circular correlation is exact.
        meets = irfft2(self._spectrum * turned.spectrum.conj(), self.area.padded)[:rows, :columns]
        free = np.flatnonzero(meets.ravel() < 0.5)
        return None if free.size == 0 else divmod(int(free[0]), columns)

    def place(self, turns: Sequence[_Turned]) -> Motion | None:
        """Put the piece, in one of its turns, where its top is lowest; None if no turn fits."""
        places = []
        for turned in turns:
            if turned.cells.sum() > self.free_cells:
                continue
            found = self.lowest(turned)
            if found is not None:
                places.append((found[0] + turned.cells.shape[0], found[1], turned.turn, found[0], turned))
        if not places:
            return None
        _, column, _, row, turned = min(places, key=lambda place: place[:3])
        rows, columns = turned.cells.shape
        self.taken[row : row + rows, column : column + columns] |= turned.cells
        self.free_cells -= int(turned.cells.sum())
        self._spectrum = None
        return self.area.motion(turned, row, column)


def nest(
    pieces: Sequence[tuple[str, Polygon, int]],
    size_mm: tuple[float, float],
    margin_mm: float,
    gap_mm: float,
    corner_mm: tuple[float, float],
    box_mm: tuple[float, float] = (0.0, 0.0),
) -> Nest:
    """Lay out pieces (name, outline, count), keeping the lower left ``corner_mm`` free where possible.

    On each sheet a box of ``box_mm``, if any, then takes a place that the pieces left free.

    NestingError, naming the piece, its size and the sheet's, if a piece does not fit on a sheet.
    """
    area = _Area(size_mm, margin_mm, gap_mm)
    corner = area.turned(shapely.box(0, 0, *corner_mm))[:1] if fits(corner_mm, size_mm, margin_mm) else []
    turns = [area.turned(outline) for _, outline, _ in pieces]
    for (name, outline, _), turned in zip(pieces, turns, strict=True):
        if not turned:
            raise NestingError(too_large(name, outline, size_mm, margin_mm))
    tries = []
    for order in _orders(pieces):
        tries.append(_lay(area, corner, turns, [count for *_, count in pieces], order))
        # No other order is better than a single sheet.
        if len(tries[-1][0].reserved) == 1:
            break
    nested, _, sheets = min(tries, key=lambda found: (len(found[0].reserved), found[1]))
    boxes = area.turned(shapely.box(0, 0, *box_mm))[:1] if min(box_mm) > 0 else []
    return replace(nested, free=tuple(sheet.place(boxes) for sheet in sheets))


def _orders(pieces: Sequence[tuple[str, Polygon, int]]) -> list[list[int]]:
    """The orders to try: by decreasing area of the box, by decreasing length."""
    boxes = [outline.bounds for _, outline, _ in pieces]
    sides = [(x1 - x0, y1 - y0) for x0, y0, x1, y1 in boxes]
    indices = range(len(pieces))
    return [
        sorted(indices, key=lambda i: (-sides[i][0] * sides[i][1], i)),
        sorted(indices, key=lambda i: (-max(sides[i]), i)),
    ]


def _lay(
    area: _Area,
    corner: Sequence[_Turned],
    turns: Sequence[Sequence[_Turned]],
    counts: Sequence[int],
    order: Sequence[int],
) -> tuple[Nest, int, list[_Sheet]]:
    """The layout of the pieces in that order, the number of occupied cells on the last sheet, the sheets."""
    sheets: list[_Sheet] = []
    reserved: list[bool] = []
    placed: list[tuple[Placement, ...]] = [()] * len(turns)
    for index in order:
        first = 0
        copies = []
        for _ in range(counts[index]):
            motion = None
            while motion is None:
                if first == len(sheets):
                    if first == MAX_SHEETS:
                        raise NestingError(f"--sheet: the pieces need more than {MAX_SHEETS} sheets")
                    sheets.append(_Sheet(area))
                    reserved.append(bool(corner) and sheets[-1].place(corner) is not None)
                    motion = sheets[-1].place(turns[index])
                    if motion is None:
                        sheets[-1], reserved[-1] = _Sheet(area), False
                motion = motion or sheets[first].place(turns[index])
                # A piece that does not fit on a sheet will not fit later, because sheets only fill up.
                first += motion is None
            copies.append(Placement(first, motion))
        placed[index] = tuple(copies)
    return Nest(tuple(placed), tuple(reserved)), int(sheets[-1].taken.sum()) if sheets else 0, sheets


def fits(extent_mm: tuple[float, float], size_mm: tuple[float, float], margin_mm: float) -> bool:
    """Whether a box of that extent fits into the usable area, upright or turned by 90°."""
    low, high = sorted(extent_mm)
    least, greatest = sorted(side - 2 * margin_mm for side in size_mm)
    return low <= least + 1e-6 and high <= greatest + 1e-6


def too_large(name: str, outline: Polygon, size_mm: tuple[float, float], margin_mm: float) -> str:
    """The message for a piece that does not fit on a sheet."""
    x0, y0, x1, y1 = outline.bounds
    usable = [side - 2 * margin_mm for side in size_mm]
    return (
        f"--sheet: {name} is {x1 - x0:.1f} x {y1 - y0:.1f} mm, but of a sheet of {size_mm[0]:g} x {size_mm[1]:g} mm "
        f"with margins of {margin_mm:g} mm only {usable[0]:g} x {usable[1]:g} mm can be used, and it cannot be parted"
    )
