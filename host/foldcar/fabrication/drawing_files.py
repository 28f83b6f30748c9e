"""Writes a car's sheets and its coupon as files, reads each back and checks it.

Input: Sheets and Options. Output: WrittenFiles: contents by name and findings, which are none for correct files.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.options import Options

# The coupon has a PDF file of its own; a PDF file contains several sheets.
COUPON = "coupon"


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """Files by name and findings about them; each finding begins with the file's name."""

    files: dict[str, bytes]
    findings: tuple[str, ...]


def svg_files(sheets: Sequence[Sheet], chosen: Options) -> WrittenFiles:
    """A file for each sheet."""
    from foldcar.fabrication.patterns.svg import svg
    from foldcar.fabrication.patterns.verify import check_svg

    return _files("svg", sheets, svg, lambda sheet, text: check_svg(sheet, text, chosen))


def dxf_files(sheets: Sequence[Sheet], chosen: Options) -> WrittenFiles:
    """A file for each sheet."""
    from foldcar.fabrication.patterns.dxf import dxf
    from foldcar.fabrication.patterns.verify import check_dxf

    return _files("dxf", sheets, dxf, lambda sheet, text: check_dxf(sheet, text, chosen))


def pdf_files(sheets: Sequence[Sheet], chosen: Options, title: str) -> WrittenFiles:
    """One file for the coupon and one for all other sheets."""
    from foldcar.fabrication.patterns.pdf import pdf
    from foldcar.fabrication.patterns.verify import check_pdf

    files: dict[str, bytes] = {}
    findings: list[str] = []
    groups = {
        "sheets.pdf": ([sheet for sheet in sheets if sheet.name != COUPON], title),
        f"{COUPON}.pdf": ([sheet for sheet in sheets if sheet.name == COUPON], COUPON),
    }
    for name, (shown, heading) in groups.items():
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
