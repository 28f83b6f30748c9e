"""Everything that is made of one car: the files of its folder by name, checked before anybody sees them.

Input: a Design and Options. Output: a MadeCar. Findings of the checks are a CheckError: a car that fails has no files.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields

from foldcar import __version__
from foldcar.car.body import body_json
from foldcar.car.car_file import car_json
from foldcar.car.design import Design
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.guide import guide_page
from foldcar.fabrication.assembly.operations import Operations, operations, work_table
from foldcar.fabrication.assembly.parts_list import (
    parts_list,
    parts_list_csv,
    parts_list_text,
    total_cost_usd,
    total_mass_kg,
)
from foldcar.fabrication.assembly.shape_files import fold_text, obj_files, stl_bytes
from foldcar.fabrication.assembly.solids import film_mesh, film_solids, mount_solids
from foldcar.fabrication.assembly.view_page import Drawing, view_page
from foldcar.fabrication.assembly.wiring import wiring_drawing, wiring_text
from foldcar.fabrication.patterns.cutting import coupon, how_to_cut
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.dxf import dxf
from foldcar.fabrication.patterns.lbrn import lbrn
from foldcar.fabrication.patterns.mock_up import how_to_fold, mock_up
from foldcar.fabrication.patterns.nesting import NestingError
from foldcar.fabrication.patterns.options import MACHINES, Options
from foldcar.fabrication.patterns.pdf import pdf
from foldcar.fabrication.patterns.sheets import CutCar, Pattern, cut_car, pattern_of
from foldcar.fabrication.patterns.svg import svg
from foldcar.fabrication.patterns.verify import TOLERANCE_MM, check_dxf, check_lbrn, check_pdf, check_sheet, check_svg

# The page to open first.
GUIDE = "assembly.html"
# PDF files hold several sheets.
COUPON = "coupon"


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """Files and what is wrong with them; each finding begins with the file's name."""

    files: dict[str, bytes]
    findings: tuple[str, ...]


def svg_files(sheets: Sequence[Sheet], chosen: Options) -> WrittenFiles:
    """A file for each sheet."""
    return _files("svg", sheets, svg, lambda sheet, text: check_svg(sheet, text, chosen))


def dxf_files(sheets: Sequence[Sheet], chosen: Options) -> WrittenFiles:
    """A file for each sheet."""
    return _files("dxf", sheets, dxf, lambda sheet, text: check_dxf(sheet, text, chosen))


def lbrn_files(sheets: Sequence[Sheet], chosen: Options) -> WrittenFiles:
    """A LightBurn project for each sheet."""
    return _files("lbrn2", sheets, lbrn, lambda sheet, text: check_lbrn(sheet, text, chosen))


def pdf_files(sheets: Sequence[Sheet], chosen: Options, title: str) -> WrittenFiles:
    """One file for the coupon, one for all others."""
    files: dict[str, bytes] = {}
    findings: list[str] = []
    groups = {
        "sheets.pdf": ([sheet for sheet in sheets if sheet.name != COUPON], title),
        f"{COUPON}.pdf": ([sheet for sheet in sheets if sheet.name == COUPON], COUPON),
    }
    for name, (shown, heading) in groups.items():
        if not shown:
            continue
        files[name] = pdf(shown, chosen.paper, heading)
        findings += [f"{name}: {found}" for found in check_pdf(shown, files[name], chosen)]
    return WrittenFiles(files, tuple(findings))


def _files(
    ending: str,
    sheets: Sequence[Sheet],
    write: Callable[[Sheet], str],
    check: Callable[[Sheet, str], list[str]],
) -> WrittenFiles:
    files: dict[str, bytes] = {}
    findings: list[str] = []
    for sheet in sheets:
        name, text = f"{sheet.name}.{ending}", write(sheet)
        files[name] = text.encode()
        findings += [f"{name}: {found}" for found in check(sheet, text)]
    return WrittenFiles(files, tuple(findings))


def shape_files(folded: FoldedCar, title: str) -> dict[str, bytes]:
    """FOLD, STL and OBJ."""
    return {
        **{f"fold/{piece.name}.fold": fold_text(piece, title).encode() for piece in folded.pieces},
        "car.stl": stl_bytes(film_mesh(folded)),
        **obj_files([*film_solids(folded), *mount_solids(folded)], "car"),
    }


def pages(folded: FoldedCar, cut: CutCar, made: Pattern) -> dict[str, bytes]:
    """Guide, wiring and parts list of a car with that pattern."""
    title, sheets = made.title, made.sheets
    texts = {
        GUIDE: guide_page(folded, cut, made.options.machine, title, sheets),
        "wiring.md": wiring_text(folded, title),
        "wiring.svg": wiring_drawing(folded, title),
        "parts.md": parts_list_text(folded, title, sheets) + "\n" + work_table(operations(folded, cut)),
        "parts.csv": parts_list_csv(folded, sheets),
    }
    return {name: text.encode() for name, text in texts.items()}


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
    return (
        json.dumps(
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
        )
        + "\n"
    )
