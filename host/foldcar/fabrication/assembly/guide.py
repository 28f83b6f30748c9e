"""The assembly guide: one HTML page with numbered steps and pictures, for screen and print.

Input: a FoldedCar, and the car with its pieces as cut. Output: the page's text; it needs no other file.
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
    """The page; ``as_cut`` is the car with pieces split to fit the sheets (``patterns.split_body``).

    ``strips`` is the number of parts of each strip that is cut across, by its piece's name.
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
    """The picture with its SVG marked as markup, so that it is not escaped."""
    return replace(picture, svg=Markup(picture.svg))
