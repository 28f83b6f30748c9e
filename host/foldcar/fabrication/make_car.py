"""Everything that is made of one car: the files of its folder by name, checked before anybody sees them.

Input: Designs and Options. Output: MadeCars. Findings of the checks are a CheckError: a car that fails has no files.
A second process draws the guide and makes DXF, which takes half of the time; this one makes all the rest meanwhile.
"""

import json
import signal
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields

from foldcar import __version__
from foldcar.car.design import Design
from foldcar.car.folded.model import FoldedCar
from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.nesting import NestingError
from foldcar.fabrication.patterns.options import Options
from foldcar.fabrication.patterns.sheets import Pattern, cut_car, pattern_of

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
    files: Mapping[str, bytes]
    checks: tuple[str, ...]


def make_cars(designs: Iterable[Design], chosen: Options) -> Iterator[MadeCar]:
    """Each car with all its files; CheckError if something is wrong with one, FoldcarError if it cannot be cut."""
    with ProcessPoolExecutor(1, initializer=_leave_interrupts_to_the_parent) as second:
        # It begins before this process imports what it alone needs, and before there are threads.
        second.submit(_pages_module)
        for design in designs:
            try:
                yield _made(design, chosen, second)
            except BrokenProcessPool:
                raise FoldcarError(f"{car_title(design)}: the second process was ended from outside") from None


def car_title(design: Design) -> str:
    """The car in a line: its type and what all its modules share."""
    return " ".join([design.type, *(f"{key}={value:g}" for key, value in design.values.items() if "." not in key)])


def _made(design: Design, chosen: Options, second: Executor) -> MadeCar:
    from foldcar.car.body import body_json
    from foldcar.car.car_file import car_json
    from foldcar.car.folded_car import folded_car
    from foldcar.car.verify import verify
    from foldcar.fabrication.assembly.parts_list import parts_list, total_cost_usd, total_mass_kg

    title, folded = car_title(design), folded_car(design)
    pieces = cut_car(folded, chosen)
    pages = second.submit(_pages, folded, pieces.car, pieces.strips, title)

    from foldcar.fabrication.assembled_files import shape_files
    from foldcar.fabrication.drawing_files import dxf_files, pdf_files, svg_files
    from foldcar.fabrication.patterns.coupon import coupon
    from foldcar.fabrication.patterns.verify import TOLERANCE_MM, check_sheet

    try:
        cut = pattern_of(pieces, chosen, title)
    except NestingError as error:
        raise NestingError(f"{error} ({title})") from error
    thickness = max(piece.thickness_mm for piece in folded.pieces)
    sheets = (*cut.sheets, coupon(chosen, chosen.thickness_mm or thickness))
    in_dxf = second.submit(dxf_files, sheets, chosen)
    verified = verify(design)
    in_svg, in_pdf = svg_files(sheets, chosen), pdf_files(sheets, chosen, title)
    findings = [str(finding) for finding in verified.findings]
    findings += [f"{sheet.name}: {found}" for sheet in sheets for found in check_sheet(sheet, chosen.margin_mm)]
    _refuse(title, [*findings, *in_svg.findings, *in_pdf.findings])
    made_here = {
        "view.html": _view(folded, title, cut, in_svg.files).encode(),
        "body.json": (json.dumps(body_json(design), indent=2) + "\n").encode(),
        "car.json": (json.dumps(car_json(design), indent=2) + "\n").encode(),
        **shape_files(folded, title),
    }
    _refuse(title, in_dxf.result().findings)
    lines = sum(len(sheet.shapes) for sheet in cut.sheets)
    checks = (
        *verified.lines(),
        f"{lines} lines on {len(cut.sheets)} sheets read back from SVG, DXF and PDF: as meant within "
        f"{TOLERANCE_MM:g} mm, inside their sheets, outlines closed, none twice",
    )
    files = {
        **in_svg.files,
        **in_pdf.files,
        **in_dxf.result().files,
        **made_here,
        **pages.result(),
    }
    rows = parts_list(folded)
    made = MadeCar(title, cut, total_mass_kg(rows), total_cost_usd(rows), files, checks)
    files[MANIFEST] = _manifest(design, made).encode()
    return made


def _refuse(title: str, findings: Sequence[str]) -> None:
    if findings:
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise CheckError(f"{title}: {findings[0]}{more}")


def _pages(folded: FoldedCar, as_cut: FoldedCar, strips: Mapping[str, int], title: str) -> dict[str, bytes]:
    """In the second process."""
    from foldcar.fabrication.assembled_files import pages

    return pages(folded, as_cut, strips, title)


def _pages_module() -> None:
    import foldcar.fabrication.assembled_files
    import foldcar.fabrication.assembly.guide  # noqa: F401


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _view(folded: FoldedCar, title: str, cut: Pattern, drawings: Mapping[str, bytes]) -> str:
    """The model to look at, with the sheets as they are written."""
    from foldcar.fabrication.assembly.view_page import Drawing, view_page

    texts = [drawings[f"{sheet.name}.svg"].decode() for sheet in cut.sheets]
    # An element in a page has no XML declaration.
    elements = [text[text.index("<svg") :] for text in texts]
    return view_page(folded, title, [Drawing(svg, sheet.name) for svg, sheet in zip(elements, cut.sheets, strict=True)])


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
