"""The view page: one HTML file with the flat sheets and a model of the car that is put together, without network access.

Input: a FoldedCar, drawings of its flat sheets; for a car that drives, its run. Output: the page's text, which contains
its script with three.js (tools/web_bundles.py).
"""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.faces import piece_area_mm2
from foldcar.fabrication.assembly.parts_list import parts_list, total_cost_usd, total_mass_kg
from foldcar.fabrication.assembly.view_data import view_data
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.svg import svg
from foldcar.figures.page import bundle, inline_svg, page_template, script_json

ROOM = "foldcar.fabrication.assembly"


def view_page(
    folded: FoldedCar,
    title: str,
    sheets: Sequence[Sheet] = (),
    run: Mapping[str, Any] | None = None,
) -> str:
    """The page's text, with the ``sheets``. ``run`` is the object that run.js reads."""
    return page_template(ROOM, "web/view.html").render(
        title=title,
        facts=facts(folded, sheets),
        drawings=[
            {"svg": Markup(inline_svg(svg(sheet), f"drawing{number}", sheet.name)), "caption": sheet.name}
            for number, sheet in enumerate(sheets, 1)
        ],
        run=run,
        data=script_json({"car": view_data(folded), "run": run}),
        style=Markup(files(ROOM).joinpath("web/view.css").read_text(encoding="utf-8")),
        program=bundle("view.js"),
    )


def facts(folded: FoldedCar, sheets: Sequence[Sheet] = ()) -> str:
    """Mass, film, wheels and cost of the car in one line; without sheets the cost leaves out the film's waste."""
    rows = parts_list(folded, sheets)
    waste = "" if sheets else ", without the film's waste"
    count = sum(piece.count for piece in folded.pieces)
    area_cm2 = sum(piece.count * piece_area_mm2(piece) for piece in folded.pieces) / 100
    return (
        f"{total_mass_kg(rows) * 1e3:.0f} g, {count} pieces of film with {area_cm2:.0f} cm², "
        f"{len(folded.axles)} driven wheels, about {total_cost_usd(rows):.0f} USD of parts{waste}"
    )
