"""Names a sheet that would do where one is too small."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from shapely.geometry import Polygon

from foldcar.fabrication.patterns.nesting import fits
from foldcar.fabrication.patterns.options import MACHINES, MAX_SHEET_MM, Options


def advice(enough: Callable[[Options], bool], outlines: Iterable[Polygon], chosen: Options) -> str:
    """What would do: the machine's smallest sheet for which ``enough`` holds, else one as large as the outlines (mm)."""
    width, height = chosen.sheet_size_mm
    for name in MACHINES[chosen.machine].sheets:
        other = replace(chosen, sheet=name)
        if math.prod(other.sheet_size_mm) > width * height and enough(other):
            return f"--sheet {name} would do"
    sides = [sorted((x1 - x0, y1 - y0)) for x0, y0, x1, y1 in (outline.bounds for outline in outlines)]
    low, high = (_rounded_up(max(side[i] for side in sides) + 2 * chosen.margin_mm + 1) for i in (0, 1))
    if high > MAX_SHEET_MM:
        return f"no sheet of up to {MAX_SHEET_MM:g} mm would do: make the car smaller"
    return f"--sheet {high:g}x{low:g} would do"


def all_fit(outlines: Sequence[Polygon], chosen: Options) -> bool:
    """Whether each of the outlines (mm) fits on a sheet."""
    bounds = (outline.bounds for outline in outlines)
    return all(fits((x1 - x0, y1 - y0), chosen.sheet_size_mm, chosen.margin_mm) for x0, y0, x1, y1 in bounds)


def _rounded_up(length_mm: float) -> float:
    return 10.0 * math.ceil(length_mm / 10)
