"""Whether pieces fit on a sheet, and which larger sheet to suggest if they do not."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from shapely.geometry import Polygon

from foldcar.fabrication.patterns.options import MACHINES, MAX_SHEET_MM, Options


def fits(extent_mm: tuple[float, float], size_mm: tuple[float, float], margin_mm: float) -> bool:
    """Return whether a box of that extent fits into a sheet without its margins, upright or turned by 90°."""
    low, high = sorted(extent_mm)
    usable_low, usable_high = sorted(side - 2 * margin_mm for side in size_mm)
    return low <= usable_low + 1e-6 and high <= usable_high + 1e-6


def too_large_message(name: str, outline: Polygon, size_mm: tuple[float, float], margin_mm: float) -> str:
    """Return the message for a piece that does not fit on a sheet."""
    x0, y0, x1, y1 = outline.bounds
    usable = [side - 2 * margin_mm for side in size_mm]
    return (
        f"--sheet: {name} is {x1 - x0:.1f} x {y1 - y0:.1f} mm, but of a sheet of {size_mm[0]:g} x {size_mm[1]:g} mm "
        f"with margins of {margin_mm:g} mm only {usable[0]:g} x {usable[1]:g} mm can be used, and it cannot be split"
    )


def suggest_sheet(is_enough: Callable[[Options], bool], outlines: Iterable[Polygon], options: Options) -> str:
    """Return a text that suggests a larger sheet, on which pieces with these outlines (mm) fit.

    It is the smallest of the machine's sheets that is larger than the present one and for which ``is_enough`` holds. If
    there is none, the text suggests a sheet that is as large as the outlines, whatever machine may take it.
    """
    width, height = options.sheet_size_mm
    for name in MACHINES[options.machine].sheets:
        other = replace(options, sheet=name)
        if math.prod(other.sheet_size_mm) > width * height and is_enough(other):
            return f"--sheet {name} would do"
    # The bounding box of each outline may be turned, so its shorter side must fit on the shorter side of the sheet, and
    # its longer side on the longer side, between the margins and with 1 mm to spare.
    boxes = [outline.bounds for outline in outlines]
    shorter_mm = max(min(x1 - x0, y1 - y0) for x0, y0, x1, y1 in boxes)
    longer_mm = max(max(x1 - x0, y1 - y0) for x0, y0, x1, y1 in boxes)
    sheet_shorter, sheet_longer = (_rounded_up(side + 2 * options.margin_mm + 1) for side in (shorter_mm, longer_mm))
    if sheet_longer > MAX_SHEET_MM:
        return f"no sheet of up to {MAX_SHEET_MM:g} mm would do: make the car smaller"
    return f"--sheet {sheet_longer:g}x{sheet_shorter:g} would do"


def all_fit(outlines: Sequence[Polygon], options: Options) -> bool:
    """Return whether each of the outlines (mm) fits on a sheet."""
    bounds = (outline.bounds for outline in outlines)
    return all(fits((x1 - x0, y1 - y0), options.sheet_size_mm, options.margin_mm) for x0, y0, x1, y1 in bounds)


def _rounded_up(length_mm: float) -> float:
    return 10.0 * math.ceil(length_mm / 10)
