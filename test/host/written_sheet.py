"""One sheet of the sample piece, intended and as written to SVG, DXF and PDF, for tests."""

from dataclasses import dataclass

from cut_samples import folded_box
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.dxf import dxf
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.pdf import pdf
from foldcar.fabrication.patterns.sheets import pattern
from foldcar.fabrication.patterns.svg import svg

CHOSEN = options("laser", sheet="300x200")
COMMAND = "foldcar pattern cars.json --vehicle w95 --set W.length=80 --machine laser --sheet 300x200 -o car"


@dataclass(frozen=True)
class Made:
    """One sheet of the sample, intended and as written; the PDF has it twice."""

    sheet: Sheet
    svg: str
    dxf: str
    pdf: bytes


def written_sample() -> Made:
    sheet = pattern(folded_box(40.0), CHOSEN, "sample", COMMAND).sheets[0]
    return Made(sheet, svg(sheet), dxf(sheet), pdf([sheet, sheet], "sample"))
