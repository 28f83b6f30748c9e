"""The options of a pattern: how a machine cuts and folds the film, and the sheet.

Input: a material file, which has the numbers, or the name of a preset. The presets are files of the same kind in
``materials/``. Output: Options; OptionError for a value outside its limits. Facts about machines are in
``machines.json``: sheets, how the machine's program reads a file, what to do with each layer.
"""

import contextlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from foldcar.errors import FoldcarError
from foldcar.study.listing_file import load_listing
from foldcar.typed import did_you_mean

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
    ``dash_bridge_mm``, or a scored line. ``file`` is the name of the material file; None for a preset.
    """

    machine: str
    sheet: str
    kerf_mm: float
    tab_clearance_mm: float
    fold: Literal["dash", "score"]
    margin_mm: float
    gap_mm: float
    dash_cut_mm: float
    dash_bridge_mm: float
    bend_radius_mm: float
    k_factor: float
    file: str | None = None

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
    """A machine: the sheets it takes (smallest first), the program that reads its ``files`` and what to do.

    ``actions`` has a text for each layer; FOLD stands for both kinds of folds.
    """

    sheets: Sequence[str]
    program: str
    files: Literal["svg", "dxf", "pdf", "lbrn2"]
    source: str
    steps: Sequence[str]
    actions: Mapping[str, str]


_FOLDER = Path(__file__).parent
MACHINES = {
    name: Machine(**data) for name, data in json.loads((_FOLDER / "machines.json").read_text(encoding="utf-8")).items()
}
PRESETS = {
    name: Options(**json.loads((_FOLDER / "materials" / f"{name}.json").read_text(encoding="utf-8"))) for name in MACHINES
}


def options(machine: str, **changes: Any) -> Options:
    """Return the preset of a machine with these fields changed. None keeps a field, and names are case-insensitive.

    Raises OptionError for an unknown name or a value outside its limits.
    """
    machine = machine.lower()
    if machine not in MACHINES:
        raise OptionError(f"machine {machine}: is not one of {', '.join(MACHINES)}")
    changed: dict[str, Any] = {}
    for name, value in changes.items():
        if value is not None:
            is_case_insensitive = isinstance(value, str) and name != "file"
            changed[name] = value.lower() if is_case_insensitive else value
    result = replace(PRESETS[machine], **changed)
    for name, (minimum, maximum, meaning) in LIMITS.items():
        value = getattr(result, name)
        if not minimum <= value <= maximum:
            raise OptionError(f"{name} {value:g}: is not within {minimum:g} to {maximum:g} ({meaning})")
    if result.fold not in ("dash", "score"):
        raise OptionError(f"fold {result.fold}: is not one of dash, score")
    # Film is removed half a kerf beyond both ends of the path along which a machine cuts. So the path of a dash must be
    # shorter than the dash, by the kerf. It is never made shorter than half of the dash (see `dashes`).
    if result.fold == "dash" and result.kerf_mm > result.dash_cut_mm / 2:
        reason = "cuts would be longer than dash_cut_mm, and bridges thinner than dash_bridge_mm"
        raise OptionError(f"kerf_mm {result.kerf_mm:g}: is above half of dash_cut_mm {result.dash_cut_mm:g}: {reason}")
    width, height = result.sheet_size_mm
    if min(width, height) - 2 * result.margin_mm < 1:
        raise OptionError(f"margin_mm {result.margin_mm:g}: leaves nothing of a sheet of {width:g} x {height:g} mm")
    return result


def read_material(material: str, sheet: str | None = None) -> Options:
    """Return the options of a preset, or of a material file (JSON), with another ``sheet`` if that is not None.

    Raises OptionError, which names the file and the key.
    """
    if material.lower() in PRESETS:
        return options(material, sheet=sheet)
    file = Path(material)
    if not file.is_file():
        raise OptionError(f"--material {material}: is neither a file nor one of {', '.join(PRESETS)}")
    data, _ = load_listing(file)
    if not isinstance(data, Mapping) or "machine" not in data:
        raise OptionError(f"{file}: is not a JSON object with a machine: {', '.join(PRESETS)}")
    known = {field.name for field in fields(Options)} - {"file"}
    for key, value in data.items():
        if key not in known:
            raise OptionError(f"{file}: {key}: unknown key; known: {', '.join(sorted(known))}{did_you_mean(key, known)}")
        # Options with limits are numbers, all others are texts. For Python, true and false are numbers, too.
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if key in LIMITS and not is_number:
            raise OptionError(f"{file}: {key}: {value!r} is not a number")
        if key not in LIMITS and not isinstance(value, str):
            raise OptionError(f"{file}: {key}: {value!r} is not a text")
    try:
        return options(**{**data, "sheet": sheet or data.get("sheet")}, file=material)
    except OptionError as error:
        raise OptionError(f"{file}: {error}") from None


def sheet_size_mm(sheet: str) -> tuple[float, float]:
    """Parse width and height (mm) of a sheet from its name or WIDTHxHEIGHT in mm or inches. Raises OptionError."""
    if sheet in SHEETS:
        return SHEETS[sheet]
    match = re.fullmatch(r"([0-9.]+)x([0-9.]+)(in)?", sheet)
    # A text that is no size counts as NaN, which is within no limits.
    width = height = math.nan
    if match:
        width_text, height_text, inches = match.groups()
        unit_mm = INCH_MM if inches else 1.0
        # Texts such as "1.2.3" match, but are no numbers.
        with contextlib.suppress(ValueError):
            width, height = unit_mm * float(width_text), unit_mm * float(height_text)
    if not (10 <= width <= MAX_SHEET_MM and 10 <= height <= MAX_SHEET_MM):
        names = ", ".join(SHEETS)
        raise OptionError(
            f"sheet {sheet}: is neither one of {names} nor WIDTHxHEIGHT of 10 to {MAX_SHEET_MM:g} mm, as in 600x400, "
            "or in inches, as in 24x36in"
        )
    return width, height


def arguments(options: Options) -> list[str]:
    """Return the arguments of `foldcar pattern` that give these options; the default preset and its sheet need none.

    A material file is named without its folder.
    """
    material = options.machine if options.file is None else Path(options.file).name
    words = [] if material == "silhouette" else ["--material", material]
    # A file may name any sheet.
    if options.file is not None or options.sheet != PRESETS[options.machine].sheet:
        words += ["--sheet", options.sheet]
    return words
