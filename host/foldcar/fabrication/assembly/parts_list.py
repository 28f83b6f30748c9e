"""The bill of materials: film and bought parts with quantities, masses and costs, as Markdown and as CSV; the fits.

Input: a FoldedCar, and the sheets that it is cut from, because film is bought by whole sheets. Without sheets only the
film in the car is counted. Output: rows, and texts of them, with parts in the order of assembly.
"""

import csv
import io
import json
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any

from foldcar.car.components.bridge import option_resistors
from foldcar.car.fits import fits_of
from foldcar.car.folded.model import FoldedCar, Piece
from foldcar.car.folded.stance import center_mm, stance
from foldcar.car.folded.weight import max_placement_shift_mm
from foldcar.car.leads import extra_wire_m, leads
from foldcar.car.parts.bought import Tyre
from foldcar.car.parts.catalogue import Catalogue, film_of
from foldcar.car.parts.quantity import Bought
from foldcar.car.proof.plan import plan_assembly
from foldcar.car.supply import fresh_cells_warning, supply
from foldcar.fabrication.assembly.faces import piece_area_mm2
from foldcar.fabrication.assembly.materials import material_rows
from foldcar.fabrication.assembly.operations import Operations, is_wound, kinds, minutes
from foldcar.fabrication.assembly.row import Row
from foldcar.fabrication.assembly.wiring import OE_WIRE_AWG, optional_parts, wire_length_mm
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.sheets import CutCar
from foldcar.figures.page import page_template
from foldcar.shown_text import spreadsheet_cell
from foldcar.statistics.words import count

# Cells in a holder.
CELLS = 4


@cache
def shopping() -> dict[str, Any]:
    """Return what to order, as the catalogue's table: product and search term by the name of the part, and what
    prices are.
    """
    text = files("foldcar.fabrication.assembly").joinpath("shopping.json").read_text(encoding="utf-8")
    table: dict[str, Any] = json.loads(text)
    return table


def parts_list(folded: FoldedCar, sheets: Sequence[Sheet] = (), cut: CutCar | None = None) -> tuple[Row, ...]:
    """Return all rows of the bill of materials: film first, then bought parts, then tape, tube and solder.

    Each row says what to order and which words to search for. ``cut`` has the pieces that were split, which need more
    tape.
    """
    order_table = shopping()["parts"]
    rows = []
    for row in (*_film_rows(folded, sheets), *_bought_rows(folded), *material_rows(folded, cut)):
        product, search = order_table.get(row.name, ("", row.search))
        rows.append(replace(row, product=product, search=search))
    return tuple(rows)


def total_mass_kg(rows: tuple[Row, ...]) -> float:
    """Return the car's mass (kg)."""
    return sum(row.mass_kg for row in rows)


def total_cost_usd(rows: tuple[Row, ...]) -> float:
    """Return the car's cost (US dollars)."""
    return sum(row.cost_usd or 0.0 for row in rows)


def parts_list_text(
    folded: FoldedCar,
    title: str,
    sheets: Sequence[Sheet] = (),
    done: Operations | None = None,
    cut: CutCar | None = None,
) -> str:
    """Return the parts list as Markdown: parts to buy, pieces to cut, the worst case of every fit.

    ``done`` are the operations by hand; if they are given, the work follows.
    """
    rows = parts_list(folded, sheets, cut)
    return page_template("foldcar.fabrication.assembly", "parts.md").render(
        title=title,
        rows=rows,
        mass_kg=total_mass_kg(rows),
        cost_usd=total_cost_usd(rows),
        balance=_balance(folded),
        prices=shopping()["prices"],
        warning=fresh_cells_warning(folded.parts),
        parts=folded.parts,
        options=optional_parts(folded),
        pieces=[(piece, piece_area_mm2(piece), _folds(piece)) for piece in folded.pieces],
        fits=fits_of(folded),
        done=done,
        weeding=kinds()["weed"].many,
        minutes=minutes,
    )


def _folds(piece: Piece) -> str:
    """Return the text on a piece's folds: their number, or that it is curled."""
    if is_wound(piece):
        return "curl, do not crease"
    creased = sum(not crease.flexure for crease in piece.creases)
    hinge = " and a hinge: do not crease that" if any(crease.flexure for crease in piece.creases) else ""
    return f"{creased}{hinge}"


def parts_list_csv(folded: FoldedCar, sheets: Sequence[Sheet] = (), cut: CutCar | None = None) -> str:
    """Return the rows as CSV for a spreadsheet; mass in grams, cost in US dollars."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["part", "quantity", "unit", "mass_g", "cost_usd", "product", "search", "note"])
    for row in parts_list(folded, sheets, cut):
        mass = f"{row.mass_kg * 1e3:.3f}"
        cells = [row.name, f"{row.quantity:g}", row.unit, mass, row.dollars, row.product, row.search, row.note]
        writer.writerow(map(spreadsheet_cell, cells))
    return text.getvalue()


def _film_rows(folded: FoldedCar, sheets: Sequence[Sheet]) -> Iterator[Row]:
    """Yield a row for each thickness of film: the mass of the car's pieces, the cost of the whole sheets."""
    areas_mm2: dict[float, float] = {}
    for piece in folded.pieces:
        areas_mm2[piece.thickness_mm] = areas_mm2.get(piece.thickness_mm, 0.0) + piece.count * piece_area_mm2(piece)
    for thickness_mm, area_mm2 in sorted(areas_mm2.items()):
        film = film_of(folded.parts.film, thickness_mm)
        bought_mm2, note = area_mm2, "as cut, sheets have more"
        if sheets:
            own_sheets = [sheet for sheet in sheets if sheet.film == film.title]
            bought_mm2 = sum(sheet.width_mm * sheet.height_mm for sheet in own_sheets)
            size = f"{own_sheets[0].width_mm:g} x {own_sheets[0].height_mm:g} mm"
            note = f"{count(len(own_sheets), 'sheet')} of {size}, {area_mm2 * 1e-6:.4f} m² of it in the car"
        mass_kg = area_mm2 * thickness_mm * 1e-9 * film.density_kg_m3.value
        cost_usd = bought_mm2 * 1e-6 * film.cost_usd_m2.value
        yield Row(film.title, bought_mm2 * 1e-6, "m²", mass_kg, cost_usd, note, search=f"{film.name}, {film.sold_as}")


def _bought_rows(folded: FoldedCar) -> list[Row]:
    """Return a row for each kind of bought part, in the order of assembly."""
    catalogue = folded.parts
    part_by_name = {part.name: part for part in catalogue.bought}
    numbers: Counter[str] = Counter()
    masses_kg: defaultdict[str, float] = defaultdict(float)
    for mount in folded.mounts:
        numbers[mount.part] += 1
        masses_kg[mount.part] += mount.mass_kg
    rows = []
    for name in _names_in_order(folded):
        cost_usd, note = _cost(part_by_name.get(name), numbers[name], folded)
        row = Row(name, numbers[name], "", masses_kg[name], cost_usd, note)
        rows.append(_with_wire(folded, row) if name == catalogue.wiring.name else row)
    rows += _board_rows(folded, numbers[catalogue.featherwing.name])
    rows += _cell_rows(catalogue, numbers[catalogue.battery.name])
    return rows


def _names_in_order(folded: FoldedCar) -> list[str]:
    """Return the names of the bought parts, in the order in which the assembly adds them; then those it does not add."""
    part_of_mount = {mount.name: mount.part for mount in folded.mounts}
    names: dict[str, None] = {}
    for step in plan_assembly(folded):
        names |= dict.fromkeys(part_of_mount[added.name] for added in step.adds if added.kind == "mount")
    names |= dict.fromkeys(mount.part for mount in folded.mounts)
    return list(names)


def _board_rows(folded: FoldedCar, boards: int) -> Iterator[Row]:
    """Yield the rows of the parts that are soldered to the boards and into the battery's lead.

    A car without boards has none. Their mass is 0 here, because it is a part of the mass of the boards or of the wires.
    """
    if not boards:
        return
    catalogue = folded.parts
    note = "soldered to the Feather; in its mass"
    headers_usd = boards * catalogue.headers.cost_usd.value
    yield Row(catalogue.headers.name, boards, unit="", mass_kg=0.0, cost_usd=headers_usd, note=note)
    note = f"{supply(folded).fuse_a:g} A, soldered into the battery's + lead; in the wires' mass"
    fuses_usd = boards * catalogue.fuse.cost_usd.value
    yield Row(catalogue.fuse.name, boards, unit="", mass_kg=0.0, cost_usd=fuses_usd, note=note)
    resistors = option_resistors(catalogue)
    if resistors:
        cost_usd = len(resistors) * catalogue.resistor.cost_usd.value
        note = f"{', '.join(sorted(resistors))}, 1 %; below the Feather, in the wires' mass"
        yield Row(catalogue.resistor.name, len(resistors), unit="", mass_kg=0.0, cost_usd=cost_usd, note=note)


def _cell_rows(catalogue: Catalogue, holders: int) -> Iterator[Row]:
    """Yield the row of the cells in the battery's holder; nothing for a car without a holder."""
    if holders:
        warning = ", not alkaline" if "NiMH" in catalogue.cells.cell else ""
        note = f"four in the holder, with a charger; in its mass{warning}"
        yield Row(catalogue.cells.cell, CELLS * holders, "", 0.0, holders * catalogue.cells.cost_usd.value, note)


def _with_wire(folded: FoldedCar, row: Row) -> Row:
    """Return the row of the wiring with the length of wire in its note, and the cost of wire beyond the stock length."""
    wiring, car_leads = folded.parts.wiring, leads(folded)
    extra_cost_usd = extra_wire_m(car_leads, wiring) * wiring.wire_usd_m.value
    gauge = supply(folded).gauge
    # The optional wire to #OE, the input that enables the servo driver's outputs, is thinner than the others.
    thin_mm = sum(wire_length_mm(lead) for lead in car_leads if lead.end.endswith("#OE"))
    length_mm = sum(wire_length_mm(lead) for lead in car_leads if lead.kind != "plug") - thin_mm
    wire_text = f"{length_mm} mm of wire, {gauge.awg} AWG ({gauge.area_mm2:g} mm²)"
    if thin_mm:
        wire_text += f", and {thin_mm} mm, {OE_WIRE_AWG} AWG"
    note = f"{wire_text}: see the wiring"
    return replace(row, cost_usd=(row.cost_usd or 0.0) + extra_cost_usd, note=note)


def _cost(part: Bought | None, number: int, folded: FoldedCar) -> tuple[float | None, str]:
    """Return the cost of ``number`` parts, and a note. The cost is None for a part of a user's module without a price."""
    if part is None:
        return None, "no price known"
    if part is folded.parts.switch:
        currents = supply(folded)
        reason = f"{currents.servos} stalled servos draw {currents.stall_a:.1f} A"
        return number * part.cost_usd.value, f"the servos' switch is marked {currents.switch_a:g} A or more: {reason}"
    if part.cost_usd.value == 0:
        return 0.0, "comes with the servos"
    note = f"{part.note}; {tyre_sizes(folded)}" if isinstance(part, Tyre) else ""
    if part in (folded.parts.axle_rod, folded.parts.axle_tube):
        lengths = {f"{mount.size_mm[2]:.1f}" for mount in folded.mounts if mount.part == part.name}
        note = f"cut to {' and '.join(sorted(lengths, key=float))} mm"
    return number * part.cost_usd.value, note


def tyre_sizes(folded: FoldedCar) -> str:
    """Return what to buy or to cut for the tyres of all wheels.

    Example: "a strip of 374 x 12 mm for each"
    """
    sizes = {
        axle.unit: "; or ".join(folded.parts.tyre.sizes(axle.radius_mm, axle.tyre_width_mm)) for axle in folded.axles
    }
    if len(set(sizes.values())) == 1:
        return f"for each {next(iter(sizes.values()))}"
    return "; ".join(f"for each {unit} {text}" for unit, text in sizes.items())


def _balance(folded: FoldedCar) -> dict[str, Any] | None:
    """Return where the centre of mass is, for the template of the parts list, or None for a car without axles.

    ``where`` is its place along the car as text, and ``high_mm`` its height above the ground. ``placing_mm`` is how far
    it moves if parts are placed inaccurately.
    """
    if not folded.axles:
        return None
    x, _, z = center_mm(folded)
    side = "in front of" if x > 0 else "behind"
    where = "at the middle" if abs(x) < 0.5 else f"{abs(x):.0f} mm {side} the middle"
    return {"where": where, "high_mm": stance(folded).height_mm(x, z), "placing_mm": max_placement_shift_mm(folded)}
