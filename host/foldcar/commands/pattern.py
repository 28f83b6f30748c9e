"""`foldcar pattern`: writes the sheets to cut a car, or many cars, from, and all files to build it."""

import itertools
import json
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import Components, Json, Listing, Machine, OutputFolder, Settings, Sheet, print_result
from foldcar.installation import require
from foldcar.shown_text import decoded

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.fabrication.make_car import MadeCar
    from foldcar.fabrication.patterns.options import Options
    from foldcar.study.family import Family


def pattern(
    listing: Listing,
    output: OutputFolder,
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Vehicle of the listing; default: the only one; with --all: every.")
    ] = None,
    settings: Settings = None,
    every: Annotated[
        bool, typer.Option("--all", help="Every car of the vehicle, or of all vehicles: a folder in DIR for each.")
    ] = False,
    machine: Machine = "silhouette",
    sheet: Sheet = None,
    fold: Annotated[str | None, typer.Option(metavar="STYLE", help="How folds are cut: dash or score.")] = None,
    kerf: Annotated[float | None, typer.Option(metavar="MM", help="Width that the cut removes.")] = None,
    tab_clearance: Annotated[float | None, typer.Option(metavar="MM", help="Distance by which tabs are smaller.")] = None,
    dash_cut: Annotated[float | None, typer.Option(metavar="MM", help="Length of a fold's cuts.")] = None,
    dash_bridge: Annotated[float | None, typer.Option(metavar="MM", help="Film between a fold's cuts.")] = None,
    bend_radius: Annotated[float | None, typer.Option(metavar="MM", help="Inner radius of folds.")] = None,
    k_factor: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Position of a fold's neutral layer, from the inner side, per thickness."),
    ] = None,
    margin: Annotated[float | None, typer.Option(metavar="MM", help="Blank edge of a sheet.")] = None,
    gap: Annotated[float | None, typer.Option(metavar="MM", help="Film between two pieces.")] = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Write all files that a car is built from.

    Sheets (SVG, DXF, PDF), STL, OBJ, guide, wiring and parts list of a car that passes its checks; all files or none.

    \b
    Example: foldcar pattern patterns/published_cars.json --vehicle w95 -o car
             foldcar pattern patterns/published_cars.json --all -o cars
    """
    require("fabricate")
    from foldcar.commands.listed_run import listed_families
    from foldcar.fabrication.make_car import MANIFEST, make_car
    from foldcar.fabrication.patterns.options import options
    from foldcar.outputs import atomic_folder

    chosen = options(
        machine, sheet=sheet, fold=fold, kerf_mm=kerf, tab_clearance_mm=tab_clearance, dash_cut_mm=dash_cut,
        dash_bridge_mm=dash_bridge, bend_radius_mm=bend_radius, k_factor=k_factor, margin_mm=margin,
        gap_mm=gap,
    )  # fmt: skip
    families = listed_families(listing, vehicle, settings, every)[1]
    places = list(_places(families)) if every else [_Place(families[0].vehicle, "", families[0].single(), ())]
    skipped = [f"skipped, as it cannot be built: {one}" for family in families for one in family.skipped if every]

    cars, lines = [], []
    with atomic_folder(output, MANIFEST) as folder:
        listed = []
        for place in _with_progress(places):
            words = [*(settings or []), *place.settings]
            command = car_command(listing, place.vehicle, words, chosen, components or [])
            made = make_car(place.design, chosen, command, larger=sheet is None)
            for file, content in made.files.items():
                target = folder / place.folder / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
                listed.append(f"{place.folder}/{file}" if every else file)
            # The contents of all files of a large family would not fit into memory.
            manifest = json.loads(made.files[MANIFEST])
            of_car = {"vehicle": place.vehicle, "folder": output / place.folder, "title": made.title}
            cars.append({**of_car, **manifest, "checks": list(made.checks)})
            if every:
                warned = f", {len(made.pattern.warnings)} warnings" if made.pattern.warnings else ""
                lines.append(f"{place.folder}: {_amounts([manifest])}{warned}")
            else:
                lines += _car_lines(made, chosen.sheet, output)
        if every:
            (folder / MANIFEST).write_text(json.dumps({"files": [*listed, MANIFEST]}, indent=2) + "\n", encoding="utf-8")
            vehicles = len({place.vehicle for place in places})
            of_vehicles = f" of {vehicles} vehicles" if vehicles > 1 else ""
            lines += [*skipped, f"{len(cars)} cars{of_vehicles} in {output}: {_amounts(cars)}"]
    # The folder has been written by now.
    print_result(as_json, {"folder": output, "cars": cars, "skipped": skipped}, *lines)


@dataclass(frozen=True)
class _Place:
    """A design of a vehicle, and the folder for its files below the output's; "" for that itself.

    ``settings`` are the values (NAME=MM) that tell it from the family's others.
    """

    vehicle: str
    folder: str
    design: "Design"
    settings: tuple[str, ...]


def _places(families: "Sequence[Family]") -> "Iterator[_Place]":
    """Every design of the families; with several families, each has a folder of its own."""
    from foldcar.fabrication.make_car import MANIFEST

    taken = {MANIFEST}
    for family in families:
        varied = [key for key, values in family.choices.items() if len(values) > 1]
        start = _free_name(family.vehicle, taken) if len(families) > 1 else ""
        for design in family:
            name = "-".join(f"{key.replace('.', '_')}_{design.values[key]:.10g}" for key in varied)
            parts = [part for part in (start, name) if part]
            settings = tuple(f"{key}={design.values[key]:.10g}" for key in varied)
            yield _Place(family.vehicle, "/".join(parts) or "car", design, settings)


def _free_name(vehicle: str, taken: set[str]) -> str:
    """The vehicle's id as the name of a folder, unlike those in ``taken``, to which it is added."""
    plain = re.sub(r"[^\w.+-]+", "_", vehicle).lstrip(".") or "vehicle"
    names = itertools.chain([plain], (f"{plain}-{number}" for number in itertools.count(2)))
    name = next(name for name in names if name not in taken)
    taken.add(name)
    return name


def _with_progress(places: "list[_Place]") -> "Iterator[_Place]":
    """The designs, with a progress bar on a terminal if there are several."""
    if len(places) < 2:
        yield from places
        return
    from rich.progress import track

    from foldcar.shown_console import shown_console

    console = shown_console(stderr=True)
    yield from track(places, "pattern", console=console, disable=not console.is_terminal, transient=True)


def car_command(
    listing: Path, vehicle: str, settings: Sequence[str], chosen: "Options", components: Sequence[Path]
) -> str:
    """The command that makes this car alone in a folder ``car``."""
    from foldcar.fabrication.patterns.options import arguments

    words = ["foldcar", "pattern", listing.as_posix(), "--vehicle", vehicle]
    words += [word for setting in settings for word in ("--set", setting)]
    words += [word for file in components for word in ("--components", file.as_posix())]
    return decoded(shlex.join([*words, *arguments(chosen), "-o", "car"]))


def _car_lines(made: "MadeCar", usual: str, output: Path) -> list[str]:
    """The only car; ``usual`` is the machine's sheet."""
    from foldcar.fabrication.make_car import GUIDE

    cut, chosen = made.pattern, made.pattern.options
    larger = "" if chosen.sheet == usual else f" (--sheet {chosen.sheet}: a piece does not fit on {usual})"
    width, height = chosen.sheet_size_mm
    used = cut.film_area_mm2 / (len(cut.sheets) * width * height)
    copies, done = sum(piece.count for piece in cut.pieces), made.operations
    return [
        made.title,
        f"  sheets    {len(cut.sheets)} of {width:g} x {height:g} mm, {used:.0%} of the film used{larger}",
        f"  pieces    {copies} of {len(cut.pieces)} kinds",
        f"  cut       {cut.cut_length_mm / 1000:.1f} m for {chosen.machine}, kerf {chosen.kerf_mm:g} mm",
        f"  building  {done.total} operations, {done.weed} openings weeded: about {done.minutes:.0f} min (an estimate)",
        f"  mass      {made.mass_kg * 1000:.0f} g",
        f"  cost      about {made.cost_usd:.0f} USD",
        *(f"  checked   {text}" for text in made.checks),
        *(f"  warning   {text}" for text in cut.warnings),
        f"  made      {len(made.files)} files in {output}; open {output / GUIDE} first",
    ]


def _amounts(cars: Sequence[Mapping[str, Any]]) -> str:
    """What these cars take together, by their manifests."""
    sheets, cut_mm, mass_kg, usd = (
        sum(car[key] for car in cars) for key in ("sheets", "cut_length_mm", "mass_kg", "cost_usd")
    )
    return f"{sheets} sheets, cut {cut_mm / 1000:.1f} m, {mass_kg * 1000:.0f} g, {usd:.0f} USD"
