"""One sheet of the sample piece, intended and as written in every format, for tests."""

from collections.abc import Mapping
from dataclasses import dataclass

import pytest

from cut_samples import folded_box
from foldcar.fabrication.patterns import nesting
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheet_files import WRITERS, pdf
from foldcar.fabrication.patterns.sheets import pattern

CHOSEN = options("laser", sheet="300x200")
COMMAND = "foldcar pattern cars.json --vehicle w95 --set W.length=80 --material laser --sheet 300x200 -o car"


@dataclass(frozen=True)
class Made:
    """One sheet of the sample, intended and as written, texts by ending; the PDF has it twice."""

    sheet: Sheet
    texts: Mapping[str, str]
    pdf: bytes


def written_sample() -> Made:
    with pytest.MonkeyPatch.context() as patch:
        # The first layout does.
        patch.setattr(nesting, "MAX_TRIES", 0)
        sheet = pattern(folded_box(40.0), CHOSEN, "sample", COMMAND).sheets[0]
    texts = {ending: write(sheet) for ending, write in WRITERS.items()}
    return Made(sheet, texts, pdf([sheet, sheet], "sample"))
