"""What `foldcar pattern` says of the cars that it made: a line or a page of text, or an object."""

import json
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.fabrication.make_car import GUIDE, MANIFEST, MadeCar, MadeMockUp
from foldcar.fabrication.patterns.options import Options, arguments
from foldcar.shown_text import decoded


def car_object(vehicle: str, folder: Path, made: MadeCar) -> dict[str, Any]:
    """The car's manifest with its vehicle, folder and checks."""
    manifest = json.loads(made.files[MANIFEST])
    return {"vehicle": vehicle, "folder": folder, "title": made.title, **manifest, "checks": list(made.checks)}


def car_command(
    listing: Path, vehicle: str, settings: Sequence[str], chosen: Options, components: Sequence[Path],
    mockup: float | None = None,
) -> str:  # fmt: skip
    """The command that makes this car alone, or its paper prototype of a scale, in a folder ``car``."""
    words = ["foldcar", "pattern", listing.as_posix(), "--vehicle", vehicle]
    words += [word for setting in settings for word in ("--set", setting)]
    words += [word for file in components for word in ("--components", file.as_posix())]
    words = [*words, *arguments(chosen)]
    words += [] if mockup is None else ["--mockup", f"{mockup:g}"]
    return decoded(shlex.join([*words, "-o", "car"]))


def car_line(folder: str, made: MadeCar) -> str:
    """One of several cars."""
    cut = made.pattern
    warned = f", {len(cut.warnings)} warnings" if cut.warnings else ""
    return f"{folder}: {_amounts(len(cut.sheets), cut.cut_length_mm, made.mass_kg, made.cost_usd)}{warned}"


def total_line(cars: Sequence[Mapping[str, Any]], output: Path) -> str:
    """All of ``cars`` (as by `car_object`) together."""
    vehicles = len({car["vehicle"] for car in cars})
    of_vehicles = f" of {vehicles} vehicles" if vehicles > 1 else ""
    sums = (sum(car[key] for car in cars) for key in ("sheets", "cut_length_mm", "mass_kg", "cost_usd"))
    return f"{len(cars)} cars{of_vehicles} in {output}: {_amounts(*sums)}"


def car_lines(made: MadeCar, chosen: Options, output: Path) -> list[str]:
    """The only car."""
    cut = made.pattern
    width, height = chosen.sheet_size_mm
    used = cut.film_area_mm2 / (len(cut.sheets) * width * height)
    copies, done = sum(piece.count for piece in cut.pieces), made.operations
    return [
        made.title,
        f"  sheets    {len(cut.sheets)} of {width:g} x {height:g} mm, {used:.0%} of the film used",
        f"  pieces    {copies} of {len(cut.pieces)} kinds",
        f"  cut       {cut.cut_length_mm / 1000:.1f} m for {chosen.machine}, kerf {chosen.kerf_mm:g} mm",
        f"  building  {done.total} operations, {done.weed} openings weeded: about {done.minutes:.0f} min (an estimate)",
        f"  mass      {made.mass_kg * 1000:.0f} g",
        f"  cost      about {made.cost_usd:.0f} USD",
        *(f"  checked   {text}" for text in made.checks),
        *(f"  warning   {text}" for text in cut.warnings),
        f"  made      {len(made.files)} files in {output}; open {output / GUIDE} first",
    ]


def mock_up_lines(made: MadeMockUp, output: Path) -> list[str]:
    """A paper prototype."""
    cut = made.pattern
    width, height = cut.options.sheet_size_mm
    return [
        cut.title,
        f"  pages     {len(cut.sheets)} of {width:g} x {height:g} mm",
        f"  pieces    {sum(piece.count for piece in cut.pieces)} of {len(cut.pieces)} kinds",
        *(f"  warning   {text}" for text in cut.warnings),
        f"  made      {len(made.files)} files in {output}",
    ]


def _amounts(sheets: int, cut_length_mm: float, mass_kg: float, cost_usd: float) -> str:
    return f"{sheets} sheets, cut {cut_length_mm / 1000:.1f} m, {mass_kg * 1000:.0f} g, {cost_usd:.0f} USD"
