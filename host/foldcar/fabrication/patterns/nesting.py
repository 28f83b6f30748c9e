"""Lays pieces onto as few sheets as it can, turned by quarter turns, into notches and gaps of others where they fit.

Input: outlines in millimetres and how many of each, the sheet's size, margin and gap. Output: for every copy its sheet
and motion. Largest first, each as low and then as far left as it goes. What is taken of a sheet is kept as a raster;
where a piece fits is the correlation of both, computed by FFT. The same input gives the same sheets.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from shapely.geometry import Polygon

from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.drawing import Motion

CELL_MM = 1.0
MAX_SHEETS = 200


class NestingError(FoldcarError):
    """Pieces that no sheet, or too many sheets, can hold."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Which sheet a copy lies on and how it gets there from its piece's own frame."""

    sheet: int
    motion: Motion


@dataclass(frozen=True, slots=True)
class Nest:
    """``placements[i]`` are piece i's copies; ``reserved`` says of each sheet whether its corner was kept free."""

    placements: tuple[tuple[Placement, ...], ...]
    reserved: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class _Turned:
    """A piece in one of its four turns: cells it takes (gap included), its corner from the first cell within it."""

    turn: int
    cells: NDArray[np.bool_]
    spectrum: NDArray[np.complexfloating]
    corner_mm: tuple[float, float]


class _Area:
    """A sheet's usable area in cells that fill it evenly, with an apron for the gaps of pieces at its edge."""

    def __init__(self, size_mm: tuple[float, float], margin_mm: float, gap_mm: float) -> None:
        self.margin_mm = margin_mm
        usable = [side - 2 * margin_mm for side in size_mm]
        self.counts = [math.ceil(side / CELL_MM - 1e-9) for side in usable]
        self.cell_mm = [side / count for side, count in zip(usable, self.counts, strict=True)]
        # A cell is taken if its middle comes within half the gap and half its diagonal of a piece.
        self.reach_mm = gap_mm / 2 + math.hypot(*self.cell_mm) / 2
        self.apron = math.ceil(self.reach_mm / min(self.cell_mm))
        self.shape = (self.counts[1] + 2 * self.apron, self.counts[0] + 2 * self.apron)
        # Lengths whose Fourier transforms are quick.
        self.padded = tuple(next_fast_len(length, real=True) for length in self.shape)

    def turned(self, outline: Polygon) -> list[_Turned]:
        """The piece in every turn that fits the empty area."""
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
        # Counts of cells are exact enough in single precision, which is twice as fast.
        result: NDArray[np.complexfloating] = np.fft.rfft2(cells.astype(np.float32), self.padded)
        return result

    def motion(self, turned: _Turned, row: int, column: int) -> Motion:
        """The motion of a piece whose first cell is that one."""
        x = self.margin_mm + column * self.cell_mm[0] - turned.corner_mm[0]
        y = self.margin_mm + row * self.cell_mm[1] - turned.corner_mm[1]
        return Motion(turned.turn, (x, y))


class _Sheet:
    """What is taken of one sheet."""

    def __init__(self, area: _Area) -> None:
        self.area = area
        self.taken = np.zeros(area.shape, dtype=bool)
        self.free_cells = self.taken.size
        self._spectrum: NDArray[np.complexfloating] | None = None

    def lowest(self, turned: _Turned) -> tuple[int, int] | None:
        """The lowest row and in it the leftmost column where the piece meets nothing; None if nowhere."""
        rows = self.taken.shape[0] - turned.cells.shape[0] + 1
        columns = self.taken.shape[1] - turned.cells.shape[1] + 1
        if self._spectrum is None:
            self._spectrum = self.area.spectrum(self.taken)
        # Places that reach round the raster's end are cut off, so circular correlation is exact for the rest.
        meets = np.fft.irfft2(self._spectrum * turned.spectrum.conj(), self.area.padded)[:rows, :columns]
        free = np.flatnonzero(meets.ravel() < 0.5)
        return None if free.size == 0 else divmod(int(free[0]), columns)

    def place(self, turns: Sequence[_Turned]) -> Motion | None:
        """Put the piece where its top comes out lowest; None if it fits in no turn."""
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
) -> Nest:
    """Lay out pieces (name, outline, count), keeping the lower left corner free where that is possible.

    NestingError, naming piece, its size and the sheet's, if a piece fits no sheet.
    """
    area = _Area(size_mm, margin_mm, gap_mm)
    corner = area.turned(shapely.box(0, 0, *corner_mm))[:1] if fits(corner_mm, size_mm, margin_mm) else []
    turns = [area.turned(outline) for _, outline, _ in pieces]
    for (name, outline, _), turned in zip(pieces, turns, strict=True):
        if not turned:
            raise NestingError(too_large(name, outline, size_mm, margin_mm))
    tries = [_lay(area, corner, turns, [count for *_, count in pieces], order) for order in _orders(pieces)]
    return min(tries, key=lambda found: (len(found[0].reserved), found[1]))[0]


def _orders(pieces: Sequence[tuple[str, Polygon, int]]) -> list[list[int]]:
    """Orders to try: largest box first, longest first."""
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
) -> tuple[Nest, int]:
    """The pieces laid out in that order, and how many cells of the last sheet are taken."""
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
                # What does not fit once does not fit later: sheets only get fuller.
                first += motion is None
            copies.append(Placement(first, motion))
        placed[index] = tuple(copies)
    return Nest(tuple(placed), tuple(reserved)), int(sheets[-1].taken.sum()) if sheets else 0


def fits(extent_mm: tuple[float, float], size_mm: tuple[float, float], margin_mm: float) -> bool:
    """Whether a box of that extent fits the usable area, upright or lying."""
    low, high = sorted(extent_mm)
    least, greatest = sorted(side - 2 * margin_mm for side in size_mm)
    return low <= least + 1e-6 and high <= greatest + 1e-6


def too_large(name: str, outline: Polygon, size_mm: tuple[float, float], margin_mm: float) -> str:
    """The message for a piece that no sheet can hold."""
    x0, y0, x1, y1 = outline.bounds
    usable = [side - 2 * margin_mm for side in size_mm]
    return (
        f"--sheet: {name} is {x1 - x0:.1f} x {y1 - y0:.1f} mm, but of a sheet of {size_mm[0]:g} x {size_mm[1]:g} mm "
        f"with margins of {margin_mm:g} mm only {usable[0]:g} x {usable[1]:g} mm can be used"
    )
