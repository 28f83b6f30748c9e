"""Makes one car: all files of its folder by name.

Input: a Design and Options. Output: a MadeCar. If the car's checks have findings, CheckError is raised instead.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from foldcar.car.body import body_json, car_json
from foldcar.car.design import Design
from foldcar.car.folded_car import folded_car
from foldcar.car.verify import raise_on_findings, verify
from foldcar.fabrication.assembly.guide import UNLISTED, guide_page
from foldcar.fabrication.assembly.guide_service import ListedCar
from foldcar.fabrication.assembly.operations import Operations, operations
from foldcar.fabrication.assembly.parts_list import (
    parts_list,
    parts_list_csv,
    parts_list_text,
    total_cost_usd,
    total_mass_kg,
)
from foldcar.fabrication.assembly.solids import film_solids, mount_solid, obj_files, stl_bytes
from foldcar.fabrication.assembly.view_page import view_page
from foldcar.fabrication.assembly.wiring import wiring_drawing, wiring_text
from foldcar.fabrication.patterns.cutting import coupon, how_to_cut
from foldcar.fabrication.patterns.nesting import NestingError
from foldcar.fabrication.patterns.options import MACHINES, Options
from foldcar.fabrication.patterns.sheet_files import WRITERS, pdf, preview
from foldcar.fabrication.patterns.sheets import Pattern, cut_car, enlarge_sheet, pattern_of
from foldcar.version import __version__

# The page to open first.
GUIDE = "assembly.html"
# Names every file in the folder of a car.
MANIFEST = "pattern.json"
SHEETS = "sheets.pdf"


@dataclass(frozen=True, slots=True)
class MadeCar:
    """A car that passed its checks; ``files`` are relative paths and contents, ``checks`` says what was checked."""

    title: str
    pattern: Pattern
    mass_kg: float
    cost_usd: float
    operations: Operations
    files: Mapping[str, bytes]
    checks: tuple[str, ...]


def make_car(
    design: Design, options: Options, command: str = "", larger: bool = False, listed: ListedCar = UNLISTED
) -> MadeCar:
    """Make the car with all its files. Raises CheckError if a check fails, FoldcarError if the car cannot be cut.

    ``command`` makes the same files again; it is printed on the sheets. ``larger``: the machine's next larger sheet is
    used if a piece does not fit on the chosen one. ``listed`` says where the car is listed, for the guide's commands.
    """
    title, folded = design.title, folded_car(design)
    options = enlarge_sheet(folded, options) if larger else options
    pieces = cut_car(folded, options)
    try:
        cut = pattern_of(pieces, options, title, command)
    except NestingError as error:
        raise NestingError(f"{error} ({title})") from error
    test_piece = coupon(options, folded.parts)
    endings = ["svg", "dxf", *(["lbrn2"] if MACHINES[options.machine].files == "lbrn2" else [])]
    verified = verify(design)
    raise_on_findings(title, [*map(str, verified.findings), *cut.torn])
    done = operations(folded, pieces)
    texts = {
        "view.html": view_page(folded, title),
        "body.json": json.dumps(body_json(design), indent=2) + "\n",
        "car.json": json.dumps(car_json(design), indent=2) + "\n",
        "how_to_cut.md": how_to_cut(cut, command),
        GUIDE: guide_page(folded, pieces, options.machine, title, cut.sheets, listed),
        "wiring.md": wiring_text(folded, title),
        "wiring.svg": wiring_drawing(folded, title),
        "parts.md": parts_list_text(folded, title, cut.sheets, done, pieces),
        "parts.csv": parts_list_csv(folded, cut.sheets, pieces),
    }
    sheets = (*cut.sheets, test_piece)
    files = {f"{sheet.name}.{ending}": WRITERS[ending](sheet).encode() for sheet in sheets for ending in endings}
    files |= {SHEETS: pdf(cut.sheets, title), "coupon.pdf": pdf([test_piece], "coupon")}
    files |= {name: text.encode() for name, text in texts.items()}
    film = film_solids(folded)
    files |= {"sheets.png": preview(cut.sheets, title), "car.stl": stl_bytes(film)}
    files |= obj_files([*film, *map(mount_solid, folded.mounts)], "car")
    checks = (
        verified.checked,
        f"film between two cuts at least {cut.least_film_mm:.2f} mm, bridges in folds aside",
    )
    rows = parts_list(folded, cut.sheets)
    made = MadeCar(title, cut, total_mass_kg(rows), total_cost_usd(rows), done, files, checks)
    # The manifest lets a user make the car again, and tells which files may be replaced.
    manifest = {
        "foldcar": __version__,
        "command": command,
        "type": design.type,
        "parameters": dict(design.values),
        "options": asdict(options),
        "least_film_mm": round(cut.least_film_mm, 2),
        "cut_length_mm": round(cut.cut_length_mm, 1),
        "mass_kg": round(made.mass_kg, 6),
        "cost_usd": round(made.cost_usd, 2),
        "operations": {**done.counts, "total": done.total},
        "assembly_min": round(done.minutes),
        "assembly_min_between": [round(end) for end in done.minutes_between],
        "sheets": len(cut.sheets),
        "warnings": list(cut.warnings),
        "files": sorted([*files, MANIFEST]),
    }
    files[MANIFEST] = (json.dumps(manifest, indent=2) + "\n").encode()
    return made
