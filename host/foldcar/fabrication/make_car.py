"""Everything that is made of one car: the files of its folder by name, checked before anybody sees them.

Input: a Design and Options. Output: a MadeCar. Findings of the checks are a CheckError: a car that fails has no files.
"""

import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

from foldcar import __version__
from foldcar.car.body import body_json, car_json
from foldcar.car.design import Design
from foldcar.car.folded_car import folded_car
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.guide import guide_page
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
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.dxf import dxf, read_dxf
from foldcar.fabrication.patterns.lbrn import lbrn, read_lbrn
from foldcar.fabrication.patterns.nesting import NestingError
from foldcar.fabrication.patterns.options import MACHINES, Options
from foldcar.fabrication.patterns.pdf import pdf
from foldcar.fabrication.patterns.sheets import Pattern, cut_car, on_a_larger_sheet, pattern_of
from foldcar.fabrication.patterns.svg import read_svg, svg
from foldcar.fabrication.patterns.verify import TOLERANCE_MM, check_pdf, check_sheet, check_text

# The page to open first.
GUIDE = "assembly.html"
# Names every file in the folder of a car.
MANIFEST = "pattern.json"
SHEETS = "sheets.pdf"


class CheckError(FoldcarError):
    """A car or a file that failed its checks; the message names the first findings."""


# Writer and reader of a sheet's file, by its ending.
TEXTS: dict[str, tuple[Callable[[Sheet], str], Callable[[str], Sheet]]] = {
    "svg": (svg, read_svg), "dxf": (dxf, read_dxf), "lbrn2": (lbrn, read_lbrn),
}  # fmt: skip


def _written(
    pages: Mapping[str, Sequence[Sheet]], title: str, endings: Sequence[str], chosen: Options
) -> tuple[dict[str, bytes], list[str]]:
    """The files by name, and findings about sheets and files, each beginning with a name.

    ``pages`` are the sheets of each PDF; every sheet has a file of each of the ``endings``. All are read back.
    """
    files: dict[str, bytes] = {}
    found: dict[str, list[str]] = {}
    for sheet in itertools.chain.from_iterable(pages.values()):
        found[sheet.name] = check_sheet(sheet, chosen.margin_mm)
        for ending in endings:
            write, read = TEXTS[ending]
            text = write(sheet)
            files[f"{sheet.name}.{ending}"] = text.encode()
            found[f"{sheet.name}.{ending}"] = check_text(read, sheet, text, chosen)
    for name, sheets in pages.items():
        files[name] = pdf(sheets, title if name == SHEETS else name.removesuffix(".pdf"))
        found[name] = check_pdf(sheets, files[name])
    return files, [f"{name}: {finding}" for name, findings in found.items() for finding in findings]


@dataclass(frozen=True, slots=True)
class MadeCar:
    """``files`` are relative paths and contents; ``checks`` says in words what was checked."""

    title: str
    pattern: Pattern
    mass_kg: float
    cost_usd: float
    operations: Operations
    files: Mapping[str, bytes]
    checks: tuple[str, ...]


def make_car(design: Design, chosen: Options, command: str = "", larger: bool = False) -> MadeCar:
    """The car with all its files; CheckError if something is wrong with one, FoldcarError if it cannot be cut.

    ``command`` is what makes the same files again; it stands on the sheets. ``larger``: the machine's next larger
    sheet is taken where a piece does not fit on the chosen one.
    """
    title, folded = design.title, folded_car(design)
    chosen = on_a_larger_sheet(folded, chosen) if larger else chosen
    pieces = cut_car(folded, chosen)
    try:
        cut = pattern_of(pieces, chosen, title, command)
    except NestingError as error:
        raise NestingError(f"{error} ({title})") from error
    pages = {SHEETS: cut.sheets, "coupon.pdf": [coupon(chosen, folded.parts)]}
    endings = ["svg", "dxf", *(["lbrn2"] if MACHINES[chosen.machine].files == "lbrn2" else [])]
    files, findings = _written(pages, title, endings, chosen)
    verified = verify(design)
    refuse(title, [*map(str, verified.findings), *cut.torn, *findings])
    # matplotlib is slow to import, and other commands import this module.
    from foldcar.fabrication.patterns.preview import preview

    done = operations(folded, pieces)
    texts = {
        "view.html": view_page(folded, title),
        "body.json": json.dumps(body_json(design), indent=2) + "\n",
        "car.json": json.dumps(car_json(design), indent=2) + "\n",
        "how_to_cut.md": how_to_cut(cut, command),
        GUIDE: guide_page(folded, pieces, chosen.machine, title, cut.sheets),
        "wiring.md": wiring_text(folded, title),
        "wiring.svg": wiring_drawing(folded, title),
        "parts.md": parts_list_text(folded, title, cut.sheets, done),
        "parts.csv": parts_list_csv(folded, cut.sheets),
    }
    files |= {name: text.encode() for name, text in texts.items()}
    film = film_solids(folded)
    files |= {"sheets.png": preview(cut.sheets, title), "car.stl": stl_bytes(film)}
    files |= obj_files([*film, *map(mount_solid, folded.mounts)], "car")
    lines = sum(len(sheet.shapes) for sheet in cut.sheets)
    formats = "SVG, PDF, DXF and LightBurn projects" if "lbrn2" in endings else "SVG, PDF and DXF"
    checks = (
        verified.checked,
        f"{lines} lines on {len(cut.sheets)} sheets read back from {formats}: as meant within "
        f"{TOLERANCE_MM:g} mm, inside their sheets, outlines closed, none twice",
        f"film between two cuts at least {cut.least_film_mm:.2f} mm, bridges in folds aside",
    )
    rows = parts_list(folded, cut.sheets)
    made = MadeCar(title, cut, total_mass_kg(rows), total_cost_usd(rows), done, files, checks)
    # To make it again, and to know which files may be replaced.
    manifest = {
        "foldcar": __version__,
        "command": command,
        "type": design.type,
        "parameters": dict(design.values),
        "options": asdict(chosen),
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


def refuse(title: str, findings: Sequence[str]) -> None:
    """CheckError, with the first of them, if there are any."""
    if findings:
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise CheckError(f"{title}: {findings[0]}{more}")
