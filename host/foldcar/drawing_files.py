"""A car's sheets and its coupon as files, and the checks of the files as written.

Input: a Pattern and the coupon's Sheet. Output: contents by name; findings in words, none if all is well.
"""

from collections.abc import Callable, Mapping

from foldcar.patterns.drawing import Sheet
from foldcar.patterns.dxf import dxf
from foldcar.patterns.options import Options
from foldcar.patterns.pdf import pdf
from foldcar.patterns.sheets import Pattern
from foldcar.patterns.svg import svg
from foldcar.patterns.verify import TOLERANCE_MM, check_dxf, check_pdf, check_sheet, check_svg


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


def checked(cut: Pattern) -> str:
    """What the checks say of drawings that are well."""
    lines = sum(len(sheet.shapes) for sheet in cut.sheets)
    return (
        f"{lines} lines on {len(cut.sheets)} sheets read back from SVG, DXF and PDF: as meant within "
        f"{TOLERANCE_MM:g} mm, inside their sheets, outlines closed, none twice"
    )
