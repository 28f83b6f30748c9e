"""Everything that is made of one car: the files of its folder by name, checked before anybody sees them.

Input: a Design and Options. Output: a MadeCar. Findings of the checks are a CheckError: a car that fails has no files.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

from foldcar import __version__
from foldcar.assembly.fold_file import fold_text
from foldcar.assembly.guide import guide_page
from foldcar.assembly.obj import mtl_text, obj_text
from foldcar.assembly.parts_list import parts_list, parts_list_csv, parts_list_text, total_cost_usd, total_mass_kg
from foldcar.assembly.solids import film_mesh, film_solids, mount_solids
from foldcar.assembly.stl import stl_bytes
from foldcar.assembly.view_page import Drawing, view_page
from foldcar.assembly.wiring import wiring_text
from foldcar.assembly.wiring_drawing import wiring_drawing
from foldcar.atomic_folder import MANIFEST
from foldcar.body import body_json
from foldcar.car_file import car_json
from foldcar.compiler.car import folded_car
from foldcar.design import Design
from foldcar.errors import FoldcarError
from foldcar.patterns.coupon import coupon
from foldcar.patterns.drawing import Sheet
from foldcar.patterns.dxf import dxf
from foldcar.patterns.options import Options
from foldcar.patterns.pdf import pdf
from foldcar.patterns.sheets import Pattern, pattern
from foldcar.patterns.svg import svg
from foldcar.patterns.verify import TOLERANCE_MM, check_dxf, check_pdf, check_sheet, check_svg
from foldcar.sheet.check import check_design
from foldcar.sheet.model import FoldedCar


class CheckError(FoldcarError):
    """A car or a file that failed its checks; the message names the first findings."""


@dataclass(frozen=True, slots=True)
class MadeCar:
    """``files`` are relative paths and contents; ``checks`` says in words what was checked."""

    title: str
    pattern: Pattern
    mass_kg: float
    cost_usd: float
    files: Mapping[str, bytes]
    checks: tuple[str, ...]


def make_car(design: Design, chosen: Options) -> MadeCar:
    """All files of the car; CheckError if something is wrong with it, FoldcarError if it cannot be cut."""
    title = car_title(design)
    folded = folded_car(design)
    cut = pattern(folded, chosen, title)
    thickness = max(piece.thickness_mm for piece in folded.pieces)
    trial = coupon(chosen, chosen.thickness_mm or thickness)
    drawings = drawing_files(cut, trial)
    verified = check_design(folded)
    findings = [*(str(finding) for finding in verified.findings), *check_drawings(cut, trial, drawings)]
    if findings:
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise CheckError(f"{title}: {findings[0]}{more}")
    files = {
        **drawings,
        **_shape_files(folded, title),
        **_page_files(folded, title, cut, drawings),
        "body.json": (json.dumps(body_json(design), indent=2) + "\n").encode(),
        "car.json": (json.dumps(car_json(design), indent=2) + "\n").encode(),
    }
    rows = parts_list(folded)
    made = MadeCar(title, cut, total_mass_kg(rows), total_cost_usd(rows), files, (*verified.lines(), _checked(cut)))
    files[MANIFEST] = _manifest(design, made).encode()
    return made


def car_title(design: Design) -> str:
    """The car in a line: its type and what all its modules share."""
    return " ".join([design.type, *(f"{key}={value:g}" for key, value in design.values.items() if "." not in key)])


def drawing_files(cut: Pattern, trial: Sheet) -> dict[str, bytes]:
    """The sheets and the coupon as SVG, DXF and PDF."""
    files = {}
    for sheet in (*cut.sheets, trial):
        files[f"{sheet.name}.svg"] = svg(sheet).encode()
        files[f"{sheet.name}.dxf"] = dxf(sheet).encode()
    files["sheets.pdf"] = pdf(cut.sheets, cut.options.paper, cut.title)
    files["coupon.pdf"] = pdf([trial], cut.options.paper, "coupon")
    return files


def check_drawings(cut: Pattern, trial: Sheet, files: Mapping[str, bytes]) -> list[str]:
    """Findings about the sheets as meant and about the files as written, each with the file's name."""
    findings = []
    for sheet in (*cut.sheets, trial):
        findings += [f"{sheet.name}: {finding}" for finding in check_sheet(sheet, cut.options.margin_mm)]
        checks: tuple[tuple[str, Callable[[Sheet, str, Options], list[str]]], ...] = (
            ("svg", check_svg),
            ("dxf", check_dxf),
        )
        for ending, check in checks:
            name = f"{sheet.name}.{ending}"
            findings += [f"{name}: {found}" for found in check(sheet, files[name].decode(), cut.options)]
    for name, sheets in (("sheets.pdf", cut.sheets), ("coupon.pdf", (trial,))):
        findings += [f"{name}: {found}" for found in check_pdf(sheets, files[name], cut.options)]
    return findings


def _checked(cut: Pattern) -> str:
    lines = sum(len(sheet.shapes) for sheet in cut.sheets)
    return (
        f"{lines} lines on {len(cut.sheets)} sheets read back from SVG, DXF and PDF: as meant within "
        f"{TOLERANCE_MM:g} mm, inside their sheets, outlines closed, none twice"
    )


def _shape_files(folded: FoldedCar, title: str) -> dict[str, bytes]:
    """The folded car for other programs."""
    files = {f"fold/{piece.name}.fold": fold_text(piece, title).encode() for piece in folded.pieces}
    files["car.stl"] = stl_bytes(film_mesh(folded), title)
    files["car.obj"] = obj_text([*film_solids(folded), *mount_solids(folded)], "car.mtl").encode()
    files["car.mtl"] = mtl_text().encode()
    return files


def _page_files(folded: FoldedCar, title: str, cut: Pattern, drawings: Mapping[str, bytes]) -> dict[str, bytes]:
    """What people read: guide, model to look at, wiring, parts."""
    sheets = [Drawing(_element(drawings[f"{sheet.name}.svg"].decode()), sheet.name) for sheet in cut.sheets]
    return {
        "assembly.html": guide_page(folded, title).encode(),
        "view.html": view_page(folded, title, sheets).encode(),
        "wiring.md": wiring_text(folded, title).encode(),
        "wiring.svg": wiring_drawing(folded, title).encode(),
        "parts.md": parts_list_text(folded, title).encode(),
        "parts.csv": parts_list_csv(folded).encode(),
    }


def _element(text: str) -> str:
    """An SVG file without its XML declaration, to stand in a page."""
    return text[text.index("<svg") :]


def _manifest(design: Design, made: MadeCar) -> str:
    """What was made, and of what: to make it again, and to know which files may be replaced."""
    chosen = made.pattern.options
    return json.dumps(
        {
            "foldcar": __version__,
            "type": design.type,
            "parameters": dict(design.values),
            "options": {field.name: getattr(chosen, field.name) for field in fields(chosen)},
            "sheets": len(made.pattern.sheets),
            "cut_length_mm": round(made.pattern.cut_length_mm, 1),
            "mass_kg": round(made.mass_kg, 6),
            "cost_usd": round(made.cost_usd, 2),
            "warnings": list(made.pattern.warnings),
            "files": sorted([*made.files, MANIFEST]),
        },
        indent=2,
    ) + "\n"
