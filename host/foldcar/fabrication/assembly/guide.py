"""The assembly guide: one HTML page with numbered steps and pictures, for screen and print.

Input: a FoldedCar, and the CutCar of its sheets. Output: the page's text; it needs no other file.
"""

from collections.abc import Sequence

from markupsafe import Markup

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.guide_step import KINDS, minutes
from foldcar.fabrication.assembly.guide_steps import finished, steps, upkeep
from foldcar.fabrication.assembly.guide_words import tools
from foldcar.fabrication.assembly.operations import assembly_times, operations
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.view_page import facts
from foldcar.fabrication.assembly.wiring_drawing import wiring_drawing
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.sheets import CutCar
from foldcar.page_template import page_template


def guide_page(folded: FoldedCar, cut: CutCar, machine: str, title: str, sheets: Sequence[Sheet] = ()) -> str:
    """The page of a car that is cut from these sheets on a machine of that name."""
    done = operations(folded, cut)
    low, high = done.minutes_between
    return page_template("foldcar.fabrication.assembly", "guide.html").render(
        title=title,
        facts=facts(folded, sheets),
        rows=parts_list(folded, sheets),
        finished=finished(folded),
        steps=steps(folded, cut, machine),
        upkeep=upkeep(folded),
        total=done.total,
        counts=[(KINDS[kind][count != 1], count) for kind, count in done.counts.items() if count and kind != "weed"],
        weeded=done.weed,
        seconds=[(KINDS[kind][0], f"{quantity.value:g}") for kind, quantity in assembly_times().of_kinds().items()],
        minutes=minutes(done.minutes),
        low=f"{low:.0f}",
        high=f"{high:.0f}",
        times=assembly_times(),
        tools=tools(folded),
        wiring=Markup(wiring_drawing(folded, title)),
    )
