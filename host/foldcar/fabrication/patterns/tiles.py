"""Tiles a sheet over printer pages: overlapping windows with registration marks.

Input: a Sheet and a paper size. Output: Tiles. A sheet no larger than the paper is one page without marks, and so is one
whose lines fit into a page's printable area. Otherwise windows of that area overlap over all lines, with crosses in the
middle of each overlap on both pages.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from foldcar.fabrication.patterns.drawing import Point, Sheet, bounds
from foldcar.fabrication.patterns.options import SHEETS

# Border that home printers leave blank, and overlap of two pages.
BLANK_MM = 8.0
OVERLAP_MM = 12.0
MARK_MM = 4.0
# Around the lines of a sheet that is larger than the paper: their own width.
LINE_MM = 0.5


@dataclass(frozen=True, slots=True)
class Tile:
    """One page of ``page_mm``: the window of the sheet from ``low_mm`` to ``high_mm``.

    A sheet's point p is printed at p + ``offset_mm`` from the page's lower left corner. ``marks_mm`` are in the sheet's
    coordinates.
    """

    name: str
    page_mm: Point
    low_mm: Point
    high_mm: Point
    offset_mm: Point
    marks_mm: tuple[Point, ...]


def tiles(sheet: Sheet, paper: str) -> tuple[Tile, ...]:
    """The pages of a sheet, row by row from the top; portrait or landscape, whichever needs fewer."""
    upright = SHEETS[paper]
    size = (sheet.width_mm, sheet.height_mm)
    for page in (upright, upright[::-1]):
        if size[0] <= page[0] + 1e-6 and size[1] <= page[1] + 1e-6:
            return (Tile(sheet.name, page, (0.0, 0.0), size, (0.0, 0.0), ()),)
    x0, y0, x1, y1 = bounds(sheet.shapes) if sheet.shapes else (0.0, 0.0, *size)
    low = (max(x0 - LINE_MM, 0.0), max(y0 - LINE_MM, 0.0))
    size = (min(x1 + LINE_MM, size[0]) - low[0], min(y1 + LINE_MM, size[1]) - low[1])
    page = min((upright, upright[::-1]), key=lambda p: len(_starts(size[0], p[0])) * len(_starts(size[1], p[1])))
    return _grid(sheet.name, low, size, page)


def printed(sheet: Sheet, paper: str) -> list[tuple[Tile, Sheet]]:
    """The pages that are not empty, each with the shapes whose bounding boxes intersect its window."""
    boxes = np.array([bounds([shape]) for shape in sheet.shapes])
    if not len(boxes):
        return []
    found = []
    for tile in tiles(sheet, paper):
        touches = np.all((boxes[:, :2] <= tile.high_mm) & (tile.low_mm <= boxes[:, 2:]), axis=1)
        if np.any(touches):
            kept = iter(touches.tolist())
            groups = tuple(tuple(shape for shape in group if next(kept)) for group in sheet.groups)
            found.append((tile, replace(sheet, groups=groups)))
    return found


def _window(page_side: float) -> float:
    return page_side - 2 * BLANK_MM


def _starts(length: float, page_side: float) -> list[float]:
    """The starts (mm) of the windows along one side, equally spaced."""
    window = _window(page_side)
    count = max(1, math.ceil((length - OVERLAP_MM) / (window - OVERLAP_MM) - 1e-9))
    step = (length - window) / (count - 1) if count > 1 else 0.0
    return [i * step for i in range(count)]


def _grid(name: str, low: Point, size: Point, page: Point) -> tuple[Tile, ...]:
    """Windows over the part of a sheet that begins at ``low`` and is of that size (mm)."""
    columns, rows = _starts(size[0], page[0]), _starts(size[1], page[1])
    width, height = (min(_window(page[i]), size[i]) for i in (0, 1))
    # Each overlap has two crosses between two crossings with other overlaps, and between the last one and the edge.
    seams_x = [(b + a + width) / 2 for a, b in itertools.pairwise(columns)]
    seams_y = [(b + a + height) / 2 for a, b in itertools.pairwise(rows)]
    marks = [(x, y) for x in seams_x for y in _quarters([0.0, *seams_y, size[1]])]
    marks += [(x, y) for y in seams_y for x in _quarters([0.0, *seams_x, size[0]])]
    found = []
    for row, y in reversed(list(enumerate(rows))):
        for column, x in enumerate(columns):
            inside = tuple(
                (low[0] + u, low[1] + v)
                for u, v in marks
                if x + MARK_MM / 2 < u < x + width - MARK_MM / 2 and y + MARK_MM / 2 < v < y + height - MARK_MM / 2
            )
            title = name if len(columns) * len(rows) == 1 else f"{name} page {chr(ord('A') + column)}{len(rows) - row}"
            start = (low[0] + x, low[1] + y)
            end = (start[0] + width, start[1] + height)
            found.append(Tile(title, page, start, end, (BLANK_MM - start[0], BLANK_MM - start[1]), inside))
    return tuple(found)


def _quarters(bounds: list[float]) -> list[float]:
    return [a + share * (b - a) for a, b in itertools.pairwise(bounds) for share in (0.25, 0.75)]
