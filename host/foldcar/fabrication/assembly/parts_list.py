"""The bill of materials: film and bought parts with quantities, masses and costs, as Markdown and as CSV.

Input: a FoldedCar. Output: rows, and texts of them. Film is counted as cut, without waste.
"""

import csv
import io
from collections import Counter
from dataclasses import dataclass

from foldcar.car.folded.model import FoldedCar
from foldcar.car.parts.catalogue import BoxPart, Servo, catalogue
from foldcar.fabrication.assembly.skin import piece_area_mm2

SCREWS_PER_SERVO = 2


@dataclass(frozen=True, slots=True)
class Row:
    """One line: a quantity of a part with the total mass and cost; None if they are counted elsewhere."""

    name: str
    quantity: float
    unit: str
    mass_kg: float | None
    cost_usd: float | None
    note: str = ""


def parts_list(folded: FoldedCar) -> tuple[Row, ...]:
    """All rows: film, placed bought parts, then small parts."""
    return (*_film(folded), *_bought(folded), *_small(folded))


def total_mass_kg(rows: tuple[Row, ...]) -> float:
    """The car's mass (kg)."""
    return sum(row.mass_kg or 0.0 for row in rows)


def total_cost_usd(rows: tuple[Row, ...]) -> float:
    """The car's cost (US dollars)."""
    return sum(row.cost_usd or 0.0 for row in rows)


def parts_list_text(folded: FoldedCar, title: str) -> str:
    """The parts list as Markdown: parts to buy, pieces to cut."""
    rows = parts_list(folded)
    lines = [f"# Parts of {title}", "", "| part | quantity | mass g | cost USD | |", "|---|---:|---:|---:|---|"]
    lines += [
        f"| {row.name} | {_amount(row)} | {_grams(row.mass_kg)} | {_dollars(row.cost_usd)} | {row.note} |"
        for row in rows
    ]
    lines += [
        f"| **together** | | **{total_mass_kg(rows) * 1e3:.1f}** | **{total_cost_usd(rows):.2f}** | |",
        "",
        "Prices are guides: see the tolerances and sources in the parts' data. Besides you need glue or double-sided "
        "tape for film, and headers for the two boards.",
        "",
        "## Pieces to cut",
        "| piece | copies | area cm² each | film mm | folds |",
        "|---|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {piece.label or piece.name} | {piece.count} | {piece_area_mm2(piece) / 100:.1f} "
        f"| {piece.thickness_mm:g} | {len(piece.creases)} |"
        for piece in folded.pieces
    ]
    return "\n".join([*lines, ""])


def parts_list_csv(folded: FoldedCar) -> str:
    """The same rows for a spreadsheet; mass in grams, cost in US dollars."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["part", "quantity", "unit", "mass_g", "cost_usd", "note"])
    for row in parts_list(folded):
        mass = "" if row.mass_kg is None else f"{row.mass_kg * 1e3:.3f}"
        cost = "" if row.cost_usd is None else f"{row.cost_usd:.2f}"
        writer.writerow([row.name, f"{row.quantity:g}", row.unit, mass, cost, row.note])
    return text.getvalue()


def film_area_mm2(folded: FoldedCar) -> float:
    """Area of the film in the car, of all thicknesses (mm²)."""
    return sum(piece.count * piece_area_mm2(piece) for piece in folded.pieces)


def _film(folded: FoldedCar) -> list[Row]:
    film = catalogue().film
    areas: dict[float, float] = {}
    for piece in folded.pieces:
        areas[piece.thickness_mm] = areas.get(piece.thickness_mm, 0.0) + piece.count * piece_area_mm2(piece)
    return [
        Row(
            f"{film.name} {thickness:g} mm",
            area * 1e-6,
            "m²",
            area * thickness * 1e-9 * film.density_kg_m3.value,
            area * 1e-6 * film.cost_usd_m2.value,
            "as cut; sheets have more",
        )
        for thickness, area in sorted(areas.items())
    ]


def _bought(folded: FoldedCar) -> list[Row]:
    counts = Counter(mount.part for mount in folded.mounts)
    masses: dict[str, float] = {}
    for mount in folded.mounts:
        masses[mount.part] = masses.get(mount.part, 0.0) + mount.mass_kg
    return [
        Row(name, count, "", masses[name], *_cost(name, count))
        for name, count in counts.items()
    ]


def _small(folded: FoldedCar) -> list[Row]:
    parts = catalogue()
    servos = sum(mount.part == parts.servo.name for mount in folded.mounts)
    screws = SCREWS_PER_SERVO * servos
    return [
        Row(parts.screw.name, screws, "", None, screws * parts.screw.cost_usd.value,
            f"{SCREWS_PER_SERVO} a servo; their mass is in {parts.wiring.name}"),
    ]  # fmt: skip


def _cost(name: str, count: int) -> tuple[float | None, str]:
    """The cost of ``count`` parts and a note."""
    parts = catalogue()
    if name == parts.horn.name:
        return None, "come with the servos"
    bought = (getattr(parts, field) for field in type(parts).model_fields)
    costs = {part.name: part.cost_usd.value for part in bought if isinstance(part, BoxPart | Servo)}
    return (costs[name] * count, "") if name in costs else (None, "no price known")


def _amount(row: Row) -> str:
    return f"{row.quantity:.4f} {row.unit}" if row.unit else f"{row.quantity:g}"


def _grams(mass_kg: float | None) -> str:
    return "" if mass_kg is None else f"{mass_kg * 1e3:.2f}"


def _dollars(cost_usd: float | None) -> str:
    return "" if cost_usd is None else f"{cost_usd:.2f}"
