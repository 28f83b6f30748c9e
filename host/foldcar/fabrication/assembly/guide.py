"""The assembly guide: one HTML page with numbered steps and pictures, to read on a screen or to print.

Input: a FoldedCar, and its pieces as they are cut. Output: the page's text; it needs no other file.
"""

from collections.abc import Mapping
from dataclasses import replace

from markupsafe import Markup

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.guide_step import Picture
from foldcar.fabrication.assembly.guide_steps import finished, steps
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.view_page import facts
from foldcar.fabrication.assembly.wiring_drawing import wiring_drawing
from foldcar.page_template import page_template


def guide_page(folded: FoldedCar, as_cut: FoldedCar, strips: Mapping[str, int], title: str) -> str:
    """The page; ``as_cut`` is the car with pieces parted as sheets ask for it (``patterns.split_body``).

    ``strips`` says of those that are cut across in how many parts, by their pieces' names.
    """
    return page_template("foldcar.fabrication.assembly", "guide.html").render(
        title=title,
        facts=facts(folded),
        rows=parts_list(folded),
        finished=_marked_up(finished(folded)),
        steps=[
            replace(step, pictures=tuple(_marked_up(one) for one in step.pictures))
            for step in steps(folded, as_cut, strips)
        ],
        wiring=Markup(wiring_drawing(folded, title)),
    )


def _marked_up(picture: Picture) -> Picture:
    """The drawing as what it is, so that it is not escaped."""
    return replace(picture, svg=Markup(picture.svg))
