"""The options of a pattern for a machine and a sheet: kerf, folds, clearances, sizes; profiles of machines.

Input: a machine's name and changed values. Output: Options; OptionError for a value outside its limits. The data of
machines are in ``machines.json``: preset, sheets, how the machine's program reads a file, what to do with each layer.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from foldcar.errors import FoldcarError

INCH_MM = 25.4
MAX_SHEET_MM = 5000.0
# Minimum film between two cuts, which does not tear; the bridges within a fold are the option dash_bridge_mm.
MIN_FILM_MM = 1.5
# Narrower film is cut away by the blade's or beam's own deviation, 0.1 to 0.2 mm on each side.
TORN_FILM_MM = 0.4

# Width and height in millimetres.
SHEETS = {
    "a4": (210.0, 297.0),
    "letter": (8.5 * INCH_MM, 11 * INCH_MM),
    "12in": (12 * INCH_MM, 12 * INCH_MM),
    "a3": (297.0, 420.0),
    "12x24in": (12 * INCH_MM, 24 * INCH_MM),
}
_DATA = json.loads(Path(__file__).with_name("machines.json").read_text(encoding="utf-8"))
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
}


class OptionError(FoldcarError):
    """An option that is unknown or outside its limits; the message names it."""


@dataclass(frozen=True, slots=True)
class Options:
    """The options; lengths in millimetres.

    ``kerf_mm`` is the width that the cut removes, ``margin_mm`` the sheet's border that the machine cannot reach,
    ``gap_mm`` the distance of two pieces. ``bend_radius_mm`` is a fold's inner radius, ``k_factor`` the position of its
    neutral layer from the inner side per thickness. ``fold``: dashes of ``dash_cut_mm`` with bridges of
    ``dash_bridge_mm``, or a scored line.
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

    @property
    def sheet_size_mm(self) -> tuple[float, float]:
        """Width and height of a sheet (mm)."""
        return sheet_size_mm(self.sheet)

    @property
    def dashed(self) -> bool:
        """Whether folds are drawn in dashed line types: where they are neither cut nor scored by a machine."""
        return self.machine == "scissors" and self.fold == "score"


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine: its preset, the sheets it takes (smallest first), the program that reads its ``files`` and what to do.

    ``actions`` has a text for each layer; FOLD stands for both kinds of folds.
    """

    preset: Options
    sheets: Sequence[str]
    program: str
    files: Literal["svg", "dxf", "pdf", "lbrn2"]
    source: str
    steps: Sequence[str]
    actions: Mapping[str, str]


MACHINES = {name: Machine(Options(name, **data.pop("options")), **data) for name, data in _DATA.items()}


def options(machine: str, **changes: Any) -> Options:
    """Return the machine's preset with these fields changed; None keeps a field, names are case-insensitive.

    Raises OptionError for an unknown name or a value outside its limits.
    """
    machine = machine.lower()
    changes = {key: value.lower() if isinstance(value, str) else value for key, value in changes.items()}
    if machine not in MACHINES:
        raise OptionError(f"--machine {machine}: not one of {', '.join(MACHINES)}")
    result = replace(MACHINES[machine].preset, **{key: value for key, value in changes.items() if value is not None})
    for field in fields(result):
        value = getattr(result, field.name)
        if field.name not in LIMITS or value is None:
            continue
        minimum, maximum, meaning = LIMITS[field.name]
        if not minimum <= value <= maximum:
            raise OptionError(f"{_flag(field.name)} {value:g}: not within {minimum:g} to {maximum:g} mm ({meaning})")
    if result.fold not in ("dash", "score"):
        raise OptionError(f"--fold {result.fold}: not one of dash, score")
    width, height = result.sheet_size_mm
    if min(width, height) - 2 * result.margin_mm < 1:
        raise OptionError(f"--margin {result.margin_mm:g}: leaves nothing of a sheet of {width:g} x {height:g} mm")
    return result


def sheet_size_mm(sheet: str) -> tuple[float, float]:
    """Parse width and height (mm) of a sheet from its name or WIDTHxHEIGHT in mm or inches. Raises OptionError."""
    if sheet in SHEETS:
        return SHEETS[sheet]
    match = re.fullmatch(r"([0-9.]+)x([0-9.]+)(in)?", sheet)
    unit = INCH_MM if match and match[3] else 1.0
    try:
        width, height = (unit * float(text) for text in match.groups()[:2]) if match else (math.nan, math.nan)
    except ValueError:
        width = height = math.nan
    if not (10 <= width <= MAX_SHEET_MM and 10 <= height <= MAX_SHEET_MM):
        names = ", ".join(SHEETS)
        raise OptionError(
            f"--sheet {sheet}: neither one of {names} nor WIDTHxHEIGHT of 10 to {MAX_SHEET_MM:g} mm, as in 600x400, "
            "or in inches, as in 24x36in"
        )
    return width, height


def arguments(options: Options) -> list[str]:
    """Return the arguments of a command line that give these options; values of the preset are left out."""
    preset = MACHINES[options.machine].preset
    # The default machine needs no argument.
    words = [] if options.machine == "silhouette" else ["--machine", options.machine]
    for field in fields(options):
        value = getattr(options, field.name)
        if value != getattr(preset, field.name):
            words += [_flag(field.name), value if isinstance(value, str) else f"{value:.10g}"]
    return words


def _flag(field: str) -> str:
    return f"--{field.removesuffix('_mm').replace('_', '-')}"
