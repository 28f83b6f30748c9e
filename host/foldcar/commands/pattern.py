"""`foldcar pattern` writes the sheets to cut for a car or for many cars, and all other files to build them."""

import itertools
import json
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import Components, Listing, Material, OutputFolder, Settings, Sheet, print_lines
from foldcar.installation import require
from foldcar.shown_text import decoded
from foldcar.statistics.words import count, percent

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.fabrication.assembly.guide_service import ListedCar
    from foldcar.fabrication.make_car import MadeCar
    from foldcar.fabrication.patterns.options import Options
    from foldcar.study.family import Family
    from foldcar.study.listing import Listing as ListingData


def pattern(
    listing: Listing,
    output: OutputFolder,
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Vehicle of the listing; default: the only one, or all with --all.")
    ] = None,
    settings: Settings = None,
    every: Annotated[
        bool,
        typer.Option("--all", help="Make all designs of the listing, or of --vehicle, each in its own folder in DIR."),
    ] = False,
    material: Material = "silhouette",
    sheet: Sheet = None,
    components: Components = None,
) -> None:
    """Write all files that are needed to build a car.

    The files are sheets (SVG, DXF, PDF), meshes (STL, OBJ), guide, wiring and parts list. The car is checked first; if a
    check fails, no file is written.

    \b
    Example: foldcar pattern patterns/published_cars.json --vehicle w95 -o car
             foldcar pattern patterns/published_cars.json --all -o cars
    """
    require("fabricate")
    from foldcar.commands.listed_run import listed_families
    from foldcar.fabrication.make_car import MANIFEST, make_car
    from foldcar.fabrication.patterns.options import read_material
    from foldcar.outputs import atomic_folder

    pattern_options = read_material(material, sheet)
    listing_data, families = listed_families(listing, vehicle, settings, every)
    cars_to_make = (
        list(_cars_to_make(families)) if every else [_CarToMake(families[0].vehicle, "", families[0].single(), ())]
    )
    skipped = [f"skipped, as it cannot be built: {design}" for family in families for design in family.skipped if every]

    cars, lines = [], []
    with atomic_folder(output, MANIFEST) as folder:
        file_names = []
        for car in _with_progress(cars_to_make):
            words = [*(settings or []), *car.settings]
            command = car_command(listing, car.vehicle, words, pattern_options, components or [])
            listed = listed_car(listing, listing_data, car.vehicle, words, components or [])
            car_files = make_car(car.design, pattern_options, command, sheet is None, listed)
            for file, content in car_files.files.items():
                target = folder / car.folder / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
                file_names.append(f"{car.folder}/{file}" if every else file)
            # Keep the manifest only: the files of a large family would not fit into memory.
            manifest = json.loads(car_files.files[MANIFEST])
            car_facts = {"vehicle": car.vehicle, "folder": output / car.folder, "title": car_files.title}
            cars.append({**car_facts, **manifest, "checks": list(car_files.checks)})
            if every:
                warning_text = f", {len(car_files.pattern.warnings)} warnings" if car_files.pattern.warnings else ""
                lines.append(f"{car.folder}: {_amounts([manifest])}{warning_text}")
            else:
                lines += _car_lines(car_files, pattern_options.sheet, output)
        if every:
            (folder / MANIFEST).write_text(
                json.dumps({"files": [*file_names, MANIFEST]}, indent=2) + "\n", encoding="utf-8"
            )
            vehicles = len({car.vehicle for car in cars_to_make})
            of_vehicles = f" of {vehicles} vehicles" if vehicles > 1 else ""
            lines += [*skipped, f"{count(len(cars), 'car')}{of_vehicles} in {output}: {_amounts(cars)}"]
    # The folder is complete now.
    print_lines(*lines)


@dataclass(frozen=True)
class _CarToMake:
    """A design to make, and the folder for its files inside the output folder; "" for the output folder itself.

    ``settings`` are the values (NAME=MM) that distinguish it from the family's other designs.
    """

    vehicle: str
    folder: str
    design: "Design"
    settings: tuple[str, ...]


def _cars_to_make(families: "Sequence[Family]") -> "Iterator[_CarToMake]":
    """Yield all designs of the families, each with its folder, below its vehicle's folder if there are several."""
    from foldcar.fabrication.make_car import MANIFEST

    # The folders lie beside the manifest.
    taken_names = {MANIFEST}
    for family in families:
        varied = [key for key, values in family.choices.items() if len(values) > 1]
        vehicle_folder = _free_name(family.vehicle, taken_names) if len(families) > 1 else ""
        for design in family:
            name = "-".join(f"{key.replace('.', '_')}_{design.values[key]:.10g}" for key in varied)
            parts = [part for part in (vehicle_folder, name) if part]
            settings = tuple(f"{key}={design.values[key]:.10g}" for key in varied)
            yield _CarToMake(family.vehicle, "/".join(parts) or "car", design, settings)


def _free_name(vehicle: str, taken_names: set[str]) -> str:
    """Return a name for the folder of a vehicle, and add it to ``taken_names``.

    The name is the vehicle's id without special characters. If that is taken, a number follows, from 2.
    """
    plain_name = re.sub(r"[^\w.+-]+", "_", vehicle).lstrip(".") or "vehicle"
    names = itertools.chain([plain_name], (f"{plain_name}-{number}" for number in itertools.count(2)))
    name = next(name for name in names if name not in taken_names)
    taken_names.add(name)
    return name


def _with_progress(cars_to_make: "list[_CarToMake]") -> "Iterator[_CarToMake]":
    """Yield the designs, with a progress bar on a terminal if there are several."""
    if len(cars_to_make) < 2:
        yield from cars_to_make
        return
    from rich.progress import track

    from foldcar.shown_console import shown_console

    console = shown_console(stderr=True)
    yield from track(cars_to_make, "pattern", console=console, disable=not console.is_terminal, transient=True)


def car_command(
    listing: Path, vehicle: str, settings: Sequence[str], chosen: "Options", components: Sequence[Path]
) -> str:
    """Return the command that makes only this car, in a folder ``car``; it is printed on the car's sheets.

    It names files without their folders, so it must be run in the folder of the listing.
    """
    from foldcar.fabrication.patterns.options import arguments

    words = ["foldcar", "pattern", listing.name, "--vehicle", vehicle]
    words += [word for setting in settings for word in ("--set", setting)]
    words += [word for file in components for word in ("--components", file.name)]
    return decoded(shlex.join([*words, *arguments(chosen), "-o", "car"]))


def listed_car(
    listing: Path, data: "ListingData", vehicle: str, settings: Sequence[str], components: Sequence[Path]
) -> "ListedCar":
    """Return where a car is listed, with the first experiment of its vehicle, as the guide's commands name it."""
    from foldcar.fabrication.assembly.guide_service import ListedCar

    experiment = next((name for name, entry in data.experiments.items() if entry.veh_id == vehicle), "")
    options = [word for setting in settings for word in ("--set", setting)]
    options += [word for file in components for word in ("--components", file.name)]
    return ListedCar(listing.name, experiment, tuple(options))


def _car_lines(made: "MadeCar", default_sheet: str, output: Path) -> list[str]:
    """Return the lines that describe a single car; ``default_sheet`` is the machine's sheet size."""
    from foldcar.fabrication.make_car import GUIDE

    cut, options = made.pattern, made.pattern.options
    is_default = options.sheet == default_sheet
    larger = "" if is_default else f" (--sheet {options.sheet}: a piece does not fit on {default_sheet})"
    width, height = options.sheet_size_mm
    used = cut.film_area_mm2 / (len(cut.sheets) * width * height)
    copies, work = sum(piece.count for piece in cut.pieces), made.operations
    return [
        made.title,
        f"  sheets    {len(cut.sheets)} of {width:g} x {height:g} mm, {percent(used)} of the film used{larger}",
        f"  pieces    {copies} of {len(cut.pieces)} kinds",
        f"  cut       {cut.cut_length_mm / 1000:.1f} m for {options.machine}, kerf {options.kerf_mm:g} mm",
        f"  building  {work.total} operations, {work.weed} openings weeded: about {work.minutes:.0f} min (an estimate)",
        f"  mass      {made.mass_kg * 1000:.0f} g",
        f"  cost      about {made.cost_usd:.0f} USD",
        *(f"  checked   {text}" for text in made.checks),
        *(f"  warning   {text}" for text in cut.warnings),
        f"  made      {len(made.files)} files in {output}; open {output / GUIDE} first",
    ]


def _amounts(cars: Sequence[Mapping[str, Any]]) -> str:
    """Return the total sheets, cut length, mass and cost from the cars' manifests."""
    sheets, cut_mm, mass_kg, usd = (
        sum(car[key] for car in cars) for key in ("sheets", "cut_length_mm", "mass_kg", "cost_usd")
    )
    return f"{count(sheets, 'sheet')}, cut {cut_mm / 1000:.1f} m, {mass_kg * 1000:.0f} g, {usd:.0f} USD"
