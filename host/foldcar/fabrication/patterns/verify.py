"""Checks written sheets: the files' content against the intended sheets, and the requirements of cutters.

Input: the intended sheets and the text or bytes of the written files. Output: findings as texts, none for correct files.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Path, ReadingError, Shape, Sheet, bounds
from foldcar.fabrication.patterns.options import Options
from foldcar.fabrication.patterns.pdf import read_pdf

# Numbers have four decimals in files, six in PDF; cutters repeat within 0.1 mm.
TOLERANCE_MM = 0.01
# Findings of a kind that are listed; the rest are counted.
SHOWN = 3


def check_sheet(sheet: Sheet, margin_mm: float) -> list[str]:
    """Findings about open outlines, duplicate lines, lines outside the usable area, lines of length 0."""
    findings = []
    outer = [shape for shape in sheet.shapes if isinstance(shape, Path) and shape.layer == "CUT_OUTER"]
    findings += [f"an outline at {_at(shape)} is not closed" for shape in outer if not shape.closed]
    for shape in sheet.shapes:
        if not shape.length_mm > TOLERANCE_MM:
            findings.append(f"a line of no length on {shape.layer} at {_at(shape)}")
    findings += _doubled(shape for shape in sheet.shapes if shape.layer != "LABEL")
    if sheet.shapes:
        x0, y0, x1, y1 = bounds(sheet.shapes)
        # Half a kerf may extend into the margin.
        low, right, top = margin_mm - 0.5 - TOLERANCE_MM, sheet.width_mm - margin_mm, sheet.height_mm - margin_mm
        if x0 < low or y0 < low or x1 > right + 0.5 + TOLERANCE_MM or y1 > top + 0.5 + TOLERANCE_MM:
            findings.append(
                f"lines from {x0:.1f}, {y0:.1f} to {x1:.1f}, {y1:.1f} leave the usable part of "
                f"{sheet.width_mm:g} x {sheet.height_mm:g} mm"
            )
    return _short(findings)


def check_same(meant: Sheet, read: Sheet) -> list[str]:
    """Findings about differences between the intended sheet and the one read: size, and every segment on its layer."""
    findings = []
    if max(abs(read.width_mm - meant.width_mm), abs(read.height_mm - meant.height_mm)) > TOLERANCE_MM:
        findings.append(
            f"is {read.width_mm:.2f} x {read.height_mm:.2f} mm large, should be {meant.width_mm:g} x {meant.height_mm:g}"
        )
    return findings + _differences(meant.shapes, read.shapes)


def check_text(read: Callable[[str], Sheet], meant: Sheet, text: str, chosen: Options) -> list[str]:
    """Findings about a written sheet, by the reader of its format."""
    try:
        found = read(text)
    except ReadingError as error:
        return [str(error)]
    return [*check_same(meant, found), *check_sheet(found, chosen.margin_mm)]


def check_pdf(meant: Sequence[Sheet], binary: bytes) -> list[str]:
    """Findings about a written PDF, by page."""
    try:
        pages = read_pdf(binary)
    except ReadingError as error:
        return [str(error)]
    if len(pages) != len(meant):
        return [f"has {len(pages)} pages, should have {len(meant)}"]
    pairs = enumerate(zip(meant, pages, strict=True), 1)
    return [f"page {number}: {found}" for number, (sheet, page) in pairs for found in check_same(sheet, page)]


def _doubled(shapes: Iterable[Shape]) -> Iterator[str]:
    """Findings about segments and circles that lie on each other, whatever their layers and directions."""
    rows = np.round(_vectors(shapes)[:, 1:], 2)
    rows[(rows[:, 2] < 0) | ((rows[:, 2] == 0) & (rows[:, 3] < 0)), 2:] *= -1.0
    places, counts = np.unique(rows + 0.0, axis=0, return_counts=True)
    for (x, y, *_), count in zip(places, counts, strict=True):
        if count > 1:
            yield f"{count} lines on each other at {x:.2f}, {y:.2f}"


def _vectors(shapes: Iterable[Shape]) -> NDArray[np.float64]:
    """(n, 5): layer's index · 1000, then a segment's midpoint and half of its extent (mm).

    A circle has its centre, its radius and a number that no segment has.
    """
    names = list(LAYERS)
    rows = []
    for shape in shapes:
        layer = 1000.0 * names.index(shape.layer)
        if isinstance(shape, Circle):
            rows.append((layer, *shape.center_mm, shape.radius_mm, -1e4))
            continue
        for (ax, ay), (bx, by) in shape.segments:
            rows.append((layer, (ax + bx) / 2, (ay + by) / 2, (bx - ax) / 2, (by - ay) / 2))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _differences(meant: Iterable[Shape], read: Iterable[Shape]) -> list[str]:
    """Findings about lines that only one of the two has, within the tolerance, and about differing counts."""
    wanted, found = _vectors(meant), _vectors(read)
    findings = [_row(row, "is missing") for row in wanted[~_matched(wanted, found)]]
    findings += [_row(row, "is too much") for row in found[~_matched(found, wanted)]]
    if not findings and len(wanted) != len(found):
        findings.append(f"has {len(found)} lines, should have {len(wanted)}")
    return _short(findings)


def _matched(have: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,): whether ``other`` has each row of ``have`` within the tolerance, whatever the lines' direction."""
    tree = cKDTree(other)
    found = np.zeros(len(have), dtype=bool)
    for sign in (1.0, -1.0):
        turned = have * (1.0, 1.0, 1.0, sign, sign)
        found |= tree.query(turned, p=np.inf, distance_upper_bound=TOLERANCE_MM)[0] <= TOLERANCE_MM
    return found


def _row(row: NDArray[np.float64], word: str) -> str:
    layer = list(LAYERS)[round(row[0] / 1000)]
    return f"a line on {layer} at {row[1]:.2f}, {row[2]:.2f} {word}"


def _at(shape: Shape) -> str:
    x, y = shape.center_mm if isinstance(shape, Circle) else shape.points_mm[0]
    return f"{x:.2f}, {y:.2f}"


def _short(findings: list[str]) -> list[str]:
    if len(findings) <= SHOWN:
        return findings
    return [*findings[:SHOWN], f"and {len(findings) - SHOWN} more"]
