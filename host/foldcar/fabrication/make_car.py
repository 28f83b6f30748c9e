"""Everything that is made of one car: the files of its folder by name, checked before anybody sees them.

Input: a Design and Options. Output: a MadeCar. Findings of the checks are a CheckError: a car that fails has no files.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

from foldcar import __version__
from foldcar.car.body import body_json
from foldcar.car.car_file import car_json
from foldcar.car.design import Design
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.operations import Operations, operations
from foldcar.fabrication.assembly.parts_list import parts_list, total_cost_usd, total_mass_kg
from foldcar.fabrication.assembly.view_page import Drawing, view_page
from foldcar.fabrication.files import dxf_files, lbrn_files, pages, pdf_files, shape_files, svg_files
from foldcar.fabrication.patterns.coupon import coupon
from foldcar.fabrication.patterns.how_to_cut import how_to_cut
from foldcar.fabrication.patterns.mock_up import how_to_fold, mock_up
from foldcar.fabrication.patterns.nesting import NestingError
from foldcar.fabrication.patterns.options import MACHINES, Options
from foldcar.fabrication.patterns.sheets import Pattern, cut_car, pattern_of
from foldcar.fabrication.patterns.verify import TOLERANCE_MM, check_sheet

# Names every file in the folder of a car.
MANIFEST = "pattern.json"


class CheckError(FoldcarError):
    """A car or a file that failed its checks; the message names the first findings."""


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


def make_car(design: Design, chosen: Options, command: str = "") -> MadeCar:
    """The car with all its files; CheckError if something is wrong with one, FoldcarError if it cannot be cut.

    ``command`` is what makes the same files again; it stands on the sheets.
    """
    title, folded = design.title, folded_car(design)
    pieces = cut_car(folded, chosen)
    try:
        cut = pattern_of(pieces, chosen, title, command)
    except NestingError as error:
        raise NestingError(f"{error} ({title})") from error
    sheets = (*cut.sheets, coupon(chosen, folded.parts))
    verified = verify(design)
    written = [svg_files(sheets, chosen), pdf_files(sheets, chosen, title), dxf_files(sheets, chosen)]
    formats = "SVG, PDF and DXF"
    if MACHINES[chosen.machine].files == "lbrn2":
        written.append(lbrn_files(sheets, chosen))
        formats = "SVG, PDF, DXF and LightBurn projects"
    findings = [*(str(finding) for finding in verified.findings), *cut.torn]
    findings += [f"{sheet.name}: {found}" for sheet in sheets for found in check_sheet(sheet, chosen.margin_mm)]
    _refuse(title, [*findings, *(found for files in written for found in files.findings)])
    files = {name: content for some in written for name, content in some.files.items()}
    # matplotlib is slow to import, and other commands import this module.
    from foldcar.fabrication.patterns.preview import preview

    files |= {
        "sheets.png": preview(cut.sheets, title),
        "view.html": _view(folded, title, cut, files).encode(),
        "body.json": (json.dumps(body_json(design), indent=2) + "\n").encode(),
        "car.json": (json.dumps(car_json(design), indent=2) + "\n").encode(),
        "how_to_cut.md": how_to_cut(cut, command).encode(),
        **shape_files(folded, title),
        **pages(folded, pieces, cut),
    }
    lines = sum(len(sheet.shapes) for sheet in cut.sheets)
    held = " but for their holding tabs" if chosen.holding_tabs_mm else ""
    checks = (
        *verified.lines(),
        f"{lines} lines on {len(cut.sheets)} sheets read back from {formats}: as meant within "
        f"{TOLERANCE_MM:g} mm, inside their sheets, outlines closed{held}, none twice",
        f"film between two cuts at least {cut.least_film_mm:.2f} mm, bridges in folds aside",
    )
    rows = parts_list(folded, cut.sheets)
    made = MadeCar(title, cut, total_mass_kg(rows), total_cost_usd(rows), operations(folded, pieces), files, checks)
    files[MANIFEST] = _manifest(design, made, command).encode()
    return made


@dataclass(frozen=True, slots=True)
class MadeMockUp:
    """A paper prototype; ``files`` are names and contents."""

    pattern: Pattern
    files: Mapping[str, bytes]


def make_mock_up(design: Design, chosen: Options, scale: float, command: str = "") -> MadeMockUp:
    """A car's paper prototype; CheckError if something is wrong with a file, FoldcarError if it cannot be made."""
    cut = mock_up(design, chosen, scale, command)
    written = pdf_files(cut.sheets, chosen, cut.title)
    findings = [f"{sheet.name}: {found}" for sheet in cut.sheets for found in check_sheet(sheet, chosen.margin_mm)]
    _refuse(cut.title, [*findings, *written.findings])
    files = {"sheets.pdf": written.files["sheets.pdf"], "how_to_fold.md": how_to_fold(cut, scale).encode()}
    manifest = {
        "foldcar": __version__,
        "command": command,
        "mockup": scale,
        "sheets": len(cut.sheets),
        "warnings": list(cut.warnings),
        "files": sorted([*files, MANIFEST]),
    }
    files[MANIFEST] = (json.dumps(manifest, indent=2) + "\n").encode()
    return MadeMockUp(cut, files)


def _refuse(title: str, findings: Sequence[str]) -> None:
    if findings:
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise CheckError(f"{title}: {findings[0]}{more}")


def _view(folded: FoldedCar, title: str, cut: Pattern, drawings: Mapping[str, bytes]) -> str:
    """The model to look at, with the sheets as they are written."""
    texts = [drawings[f"{sheet.name}.svg"].decode() for sheet in cut.sheets]
    # An element in a page has no XML declaration.
    elements = [text[text.index("<svg") :] for text in texts]
    shown = [Drawing(svg, sheet.name) for svg, sheet in zip(elements, cut.sheets, strict=True)]
    return view_page(folded, title, shown, film=cut.sheets)


def _manifest(design: Design, made: MadeCar, command: str) -> str:
    """What was made, and of what: to make it again, and to know which files may be replaced."""
    chosen = made.pattern.options
    return json.dumps(
        {
            "foldcar": __version__,
            "command": command,
            "type": design.type,
            "parameters": dict(design.values),
            "options": {field.name: getattr(chosen, field.name) for field in fields(chosen)},
            "sheets": len(made.pattern.sheets),
            "least_film_mm": round(made.pattern.least_film_mm, 2),
            "cut_length_mm": round(made.pattern.cut_length_mm, 1),
            "mass_kg": round(made.mass_kg, 6),
            "cost_usd": round(made.cost_usd, 2),
            "operations": {**made.operations.counts, "total": made.operations.total},
            "assembly_min": round(made.operations.minutes),
            "assembly_min_between": [round(end) for end in made.operations.minutes_between],
            "warnings": list(made.pattern.warnings),
            "files": sorted([*made.files, MANIFEST]),
        },
        indent=2,
    ) + "\n"
