"""A car's files: its sheets and coupon, read back and checked as written; its shape for programs, pages for people.

Input: Sheets and Options; a FoldedCar, for the guide its CutCar. Output: contents by
relative path; of sheets with findings in words, none if all is well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.fold_file import fold_text
from foldcar.fabrication.assembly.guide import guide_page
from foldcar.fabrication.assembly.guide_step import work_table
from foldcar.fabrication.assembly.mesh_files import obj_files, stl_bytes
from foldcar.fabrication.assembly.operations import operations
from foldcar.fabrication.assembly.parts_list import parts_list_csv, parts_list_text
from foldcar.fabrication.assembly.solids import film_mesh, film_solids, mount_solids
from foldcar.fabrication.assembly.wiring import wiring_text
from foldcar.fabrication.assembly.wiring_drawing import wiring_drawing
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.dxf import dxf
from foldcar.fabrication.patterns.lbrn import lbrn
from foldcar.fabrication.patterns.options import Options
from foldcar.fabrication.patterns.pdf import pdf
from foldcar.fabrication.patterns.sheets import CutCar, Pattern
from foldcar.fabrication.patterns.svg import svg
from foldcar.fabrication.patterns.verify import check_dxf, check_lbrn, check_pdf, check_svg

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
