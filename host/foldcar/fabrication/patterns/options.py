"""The options of a pattern for a machine and a sheet: kerf, folds, clearances, sizes; presets of machines.

Input: a machine's name and changed values. Output: Options; OptionError for a value outside its limits.
"""

import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from foldcar.errors import FoldcarError

INCH_MM = 25.4
MAX_SHEET_MM = 5000.0

# Width and height in millimetres.
SHEETS = {
    "a4": (210.0, 297.0),
    "letter": (8.5 * INCH_MM, 11 * INCH_MM),
    "12in": (12 * INCH_MM, 12 * INCH_MM),
}
PAPERS = ("a4", "letter")


class OptionError(FoldcarError):
    """An option that is unknown or outside its limits; the message names it."""


@dataclass(frozen=True, slots=True)
class Options:
    """The options; lengths in millimetres.

    ``kerf_mm`` is the width that the cut removes, ``margin_mm`` the sheet's border that the machine cannot reach,
    ``gap_mm`` the distance of two pieces. ``bend_radius_mm`` is a fold's inner radius, ``k_factor`` the position of its
    neutral layer from the inner side per thickness. ``thickness_mm`` None: each piece's own. ``fold``: dashes of
    ``dash_cut_mm`` with bridges of ``dash_bridge_mm``, or a scored line. ``paper`` is the size of PDF pages.
    """

    machine: str
    sheet: str
    kerf_mm: float
    tab_clearance_mm: float
    fold: Literal["dash", "score"]
    margin_mm: float
    gap_mm: float
    dash_cut_mm: float = 1.5
    dash_bridge_mm: float = 1.0
    bend_radius_mm: float = 0.0
    k_factor: float = 0.5
    thickness_mm: float | None = None
    paper: str = "a4"

    @property
    def sheet_size_mm(self) -> tuple[float, float]:
        """Width and height of a sheet (mm)."""
        return sheet_size_mm(self.sheet)


# A blade has no kerf; that of a CO2 laser in PET is about 0.15 mm. Cricut machines cut 11.5 inches of a 12 inch mat.
# Home printers leave 5 mm blank.
MACHINES = {
    "silhouette": Options("silhouette", "12in", 0.0, 0.3, "dash", 2.0, 2.0),
    "cricut": Options("cricut", "12in", 0.0, 0.3, "dash", 6.5, 2.0),
    "laser": Options("laser", "600x400", 0.15, 0.2, "dash", 5.0, 2.0),
    "scissors": Options("scissors", "a4", 0.0, 0.5, "score", 5.0, 4.0),
}

# Minimum and maximum of each number, and the quantity it limits.
LIMITS = {
    "kerf_mm": (0.0, 1.0, "the cut of a blade or beam"),
    "tab_clearance_mm": (0.0, 2.0, "what a tab can lose"),
    "margin_mm": (0.0, 50.0, "a sheet's blank edge"),
    "gap_mm": (0.5, 50.0, "film that holds two pieces apart while they are cut"),
    "dash_cut_mm": (0.3, 50.0, "the shortest cut a machine makes"),
    "dash_bridge_mm": (0.3, 50.0, "a bridge that does not tear when it is folded"),
    "bend_radius_mm": (0.0, 5.0, "a fold's inner radius"),
    "k_factor": (0.0, 1.0, "inner to outer side of the film"),
    "thickness_mm": (0.03, 3.0, "film that folds"),
}


def options(machine: str, **changes: Any) -> Options:
    """The machine's preset with these fields changed; None keeps a field. OptionError."""
    if machine not in MACHINES:
        raise OptionError(f"--machine {machine}: not one of {', '.join(MACHINES)}")
    chosen = replace(MACHINES[machine], **{key: value for key, value in changes.items() if value is not None})
    for field in fields(chosen):
        value = getattr(chosen, field.name)
        if field.name not in LIMITS or value is None:
            continue
        low, high, why = LIMITS[field.name]
        if not low <= value <= high:
            raise OptionError(f"{_flag(field.name)} {value:g}: not within {low:g} to {high:g} mm ({why})")
    if chosen.fold not in ("dash", "score"):
        raise OptionError(f"--fold {chosen.fold}: not one of dash, score")
    if chosen.paper not in PAPERS:
        raise OptionError(f"--paper {chosen.paper}: not one of {', '.join(PAPERS)}")
    width, height = chosen.sheet_size_mm
    if min(width, height) - 2 * chosen.margin_mm < 1:
        raise OptionError(
            f"--margin {chosen.margin_mm:g}: leaves nothing of a sheet of {width:g} x {height:g} mm"
        )
    return chosen


def sheet_size_mm(sheet: str) -> tuple[float, float]:
    """Width and height (mm) of a sheet given by name or as WIDTHxHEIGHT in millimetres. OptionError."""
    if sheet in SHEETS:
        return SHEETS[sheet]
    match = re.fullmatch(r"([0-9.]+)x([0-9.]+)", sheet)
    try:
        width, height = (float(text) for text in match.groups()) if match else (math.nan, math.nan)
    except ValueError:
        width = height = math.nan
    if not (10 <= width <= MAX_SHEET_MM and 10 <= height <= MAX_SHEET_MM):
        known = ", ".join(SHEETS)
        raise OptionError(
            f"--sheet {sheet}: neither one of {known} nor WIDTHxHEIGHT of 10 to {MAX_SHEET_MM:g} mm, as in 600x400"
        )
    return width, height


def _flag(field: str) -> str:
    return f"--{field.removesuffix('_mm').replace('_', '-')}"
