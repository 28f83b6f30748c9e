"""How to cut a car's sheets on its machine: which file to import, what to do with each layer, how parts are joined.

Input: a Pattern and the command that made it. Output: a page of text (Markdown) for the car's folder.
"""

from collections.abc import Iterator

from foldcar.fabrication.patterns.drawing import bounds
from foldcar.fabrication.patterns.layers import LAYERS, Layer
from foldcar.fabrication.patterns.options import MACHINES
from foldcar.fabrication.patterns.sheets import Pattern
from foldcar.fabrication.patterns.title_block import REFERENCE_MM

MEANINGS = {
    "LABEL": "names, numbers, reference bar",
    "QR_CODE": "the command that made the sheet",
    "SCORE": "line to lay another part against",
    "FOLD_MOUNTAIN": "fold away from the printed side",
    "FOLD_VALLEY": "fold towards the printed side",
    "CUT_INNER": "openings, screw holes, slots",
    "CUT_OUTER": "outlines",
}


def how_to_cut(made: Pattern, command: str) -> str:
    """The page."""
    return "\n".join(_lines(made, command)) + "\n"


def _lines(made: Pattern, command: str) -> Iterator[str]:
    chosen = made.options
    machine = MACHINES[chosen.machine]
    width, height = chosen.sheet_size_mm
    yield f"# How to cut {made.title}"
    if command:
        yield from ("", "Made with", "", f"    {command}")
    yield ""
    yield (
        f"{len(made.sheets)} sheets of {width:g} x {height:g} mm on {chosen.machine} with {machine.program}. Cut the "
        f"coupon first. Check that the bar in a sheet's title is {REFERENCE_MM:.1f} mm long."
    )
    yield from ("", "![All sheets](sheets.png)")
    film = made.film
    yield from (
        "",
        f"- Film: {', '.join(dict.fromkeys(sheet.film for sheet in made.sheets))}, sold as {film.sold_as}.",
        f"- Cutting: {getattr(film.cutting, chosen.machine)}.",
        f"- Folds: {film.folding}.",
        f"- Joins: {film.tape}.",
        f"- Bent in use: {film.hinge}.",
        "",
    )
    yield from (f"{number}. {step}" for number, step in enumerate(machine.steps, 1))
    yield from ("", "|file|drawn: width x height in mm|", "|---|---|")
    for sheet in made.sheets:
        x0, y0, x1, y1 = bounds(sheet.shapes)
        file = f"sheets.pdf, {sheet.name}" if machine.files == "pdf" else f"{sheet.name}.{machine.files}"
        yield f"|{file}|{x1 - x0:.1f} x {y1 - y0:.1f}|"
    yield from ("", "In this order, openings before outlines and small before large, so that nothing moves too soon:", "")
    yield from ("|layer|colour|LightBurn|what it is|what to do|", "|---|---|---|---|---|")
    used = {shape.layer for sheet in made.sheets for shape in sheet.shapes}
    for layer in LAYERS.values():
        if layer.name in used:
            yield f"|{layer.name}|{layer.hex}|{layer.lightburn}|{_meaning(layer, made)}|{_action(layer, made)}|"
    if chosen.holding_tabs_mm:
        yield ""
        yield (
            f"Holding tabs of {chosen.holding_tabs_mm:g} mm keep the pieces in the sheet: cut them with scissors along "
            "the outline when the sheet is off the machine; what is left on a wheel disc makes it run out of true."
        )
    yield from _parted(made)
    yield from ("", f"The narrowest film between two cuts is {made.least_film_mm:.2f} mm.")
    yield from (f"- {warning}" for warning in made.warnings)


def _meaning(layer: Layer, made: Pattern) -> str:
    drawn = {"DASHED": ", dashed", "DASHDOT": ", dash-dotted"}.get(layer.line_type, "")
    return MEANINGS[layer.name] + (drawn if made.options.dashed else "")


def _action(layer: Layer, made: Pattern) -> str:
    actions = MACHINES[made.options.machine].actions
    if not layer.fold:
        return actions[layer.name]
    machine_scores = made.options.fold == "score" and made.options.machine != "scissors"
    return "score" if machine_scores else actions["FOLD"]


def _parted(made: Pattern) -> Iterator[str]:
    """How the pieces that were cut across are joined."""
    names = dict.fromkeys(piece.origin for piece in made.pieces if piece.seams)
    if names:
        yield from ("", "Parted to fit the sheet:")
    for name in names:
        parts = [piece for piece in made.pieces if piece.origin == name]
        numbers = sorted({number for part in parts for number, _ in part.seams})
        yield (
            f"- {', '.join(part.label for part in parts)}: lay the edge of one part on the SCORE line of the part with "
            f"the same number ({', '.join(map(str, numbers))}), onto the printed side of its overlap, and glue."
        )
