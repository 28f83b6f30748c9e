"""The view page: one HTML file with the flat sheets and a model of the car that is put together, without network access.

Input: a FoldedCar, drawings of its flat sheets; for a car that drives or can be changed, what the page needs for it.
Output: the page's text, which contains the 3D library three.js of the installed package jupyter_threejs_sage.
"""

import json
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
from foldcar.figures.page import inline_svg, page_template

THREE_PACKAGE = "jupyter_threejs_sage"
THREE_FILE = "static/r130/three.min.js"
ROOM = "foldcar.fabrication.assembly"
SCRIPTS = (
    "paints.js", "stage.js", "film.js", "bought.js", "car.js", "names.js", "ground.js", "run.js", "live.js", "view.js",
)  # fmt: skip


def view_page(
    folded: FoldedCar,
    title: str,
    sheets: Sequence[Sheet] = (),
    run: Mapping[str, Any] | None = None,
    live: Mapping[str, Any] | None = None,
) -> str:
    """The page's text, with the ``sheets``. ``run`` and ``live`` are objects that run.js and live.js read."""
    return page_template(ROOM, "web/view.html").render(
        title=title,
        facts=facts(folded, sheets),
        drawings=[
            {"svg": Markup(inline_svg(svg(sheet), f"drawing{number}", sheet.name)), "caption": sheet.name}
            for number, sheet in enumerate(sheets, 1)
        ],
        run=run,
        live=live,
        library=_script(files(THREE_PACKAGE).joinpath(THREE_FILE).read_text(encoding="utf-8")),
        data=_script(json.dumps({"car": view_data(folded), "run": run, "live": live}, separators=(",", ":"))),
        style=Markup(_text("view.css")),
        program=_script("\n".join(['"use strict";', *map(_text, SCRIPTS)])),
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


def _text(name: str) -> str:
    return files(ROOM).joinpath("web").joinpath(name).read_text(encoding="utf-8")


def _script(text: str) -> Markup:
    """Text that is safe inside a script element."""
    return Markup(text.replace("</", "<\\/"))
