"""`foldcar pattern` writes the sheets to cut for a car or for many cars, and all other files to build them."""

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
    skipped = []
    if every:
        cars_to_make = list(_cars_to_make(families))
        for family in families:
            skipped += [f"skipped, as it cannot be built: {design}" for design in family.skipped]
    else:
        design = families[0].single()
        cars_to_make = [_CarToMake(vehicle=families[0].vehicle, folder="", design=design, settings=())]

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
        varied_keys = [key for key, values in family.choices.items() if len(values) > 1]
        vehicle_folder = _free_name(family.vehicle, taken_names) if len(families) > 1 else ""
        for design in family:
            # For example W_length_60-width_95.
            design_folder = "-".join(f"{key.replace('.', '_')}_{design.values[key]:.10g}" for key in varied_keys)
            folders = [folder for folder in (vehicle_folder, design_folder) if folder]
            settings = tuple(f"{key}={design.values[key]:.10g}" for key in varied_keys)
            yield _CarToMake(family.vehicle, "/".join(folders) or "car", design, settings)


def _free_name(vehicle: str, taken_names: set[str]) -> str:
    """Return a name for the folder of a vehicle, and add it to ``taken_names``.

    The name is the vehicle's id without special characters. If that is taken, a number follows, from 2.
    """
    plain_name = re.sub(r"[^\w.+-]+", "_", vehicle).lstrip(".") or "vehicle"
    name, number = plain_name, 1
    while name in taken_names:
        number += 1
        name = f"{plain_name}-{number}"
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

    words = ["foldcar", "pattern", listing.name, "--vehicle", vehicle, *_car_options(settings, components)]
    return decoded(shlex.join([*words, *arguments(chosen), "-o", "car"]))


def _car_options(settings: Sequence[str], components: Sequence[Path]) -> list[str]:
    """Return the words of a command that choose a car: `--set` for each setting, `--components` for each file's name."""
    words = []
    for setting in settings:
        words += ["--set", setting]
    for file in components:
        words += ["--components", file.name]
    return words


def listed_car(
    listing: Path, data: "ListingData", vehicle: str, settings: Sequence[str], components: Sequence[Path]
) -> "ListedCar":
    """Return how the commands in the assembly guide name a car: listing, experiment and options.

    The experiment is the first one of the listing that has this ``vehicle``.
    """
    from foldcar.fabrication.assembly.guide_service import ListedCar

    experiments = [name for name, entry in data.experiments.items() if entry.veh_id == vehicle]
    first_experiment = experiments[0] if experiments else ""
    return ListedCar(listing.name, first_experiment, tuple(_car_options(settings, components)))


def _car_lines(made: "MadeCar", default_sheet: str, output: Path) -> list[str]:
    """Return the lines that describe a single car; ``default_sheet`` is the machine's sheet size."""
    from foldcar.fabrication.make_car import GUIDE

    made_pattern, options = made.pattern, made.pattern.options
    sheet_note = ""
    if options.sheet != default_sheet:
        sheet_note = f" (--sheet {options.sheet}: a piece does not fit on {default_sheet})"
    width_mm, height_mm = options.sheet_size_mm
    sheet_count = len(made_pattern.sheets)
    used = percent(made_pattern.film_area_mm2 / (sheet_count * width_mm * height_mm))
    piece_count = sum(piece.count for piece in made_pattern.pieces)
    work = made.operations
    return [
        made.title,
        f"  sheets    {sheet_count} of {width_mm:g} x {height_mm:g} mm, {used} of the film used{sheet_note}",
        f"  pieces    {piece_count} of {len(made_pattern.pieces)} kinds",
        f"  cut       {made_pattern.cut_length_mm / 1000:.1f} m for {options.machine}, kerf {options.kerf_mm:g} mm",
        f"  building  {work.total} operations, {work.weed} openings weeded: about {work.minutes:.0f} min (an estimate)",
        f"  mass      {made.mass_kg * 1000:.0f} g",
        f"  cost      about {made.cost_usd:.0f} USD",
        *(f"  checked   {text}" for text in made.checks),
        *(f"  warning   {text}" for text in made_pattern.warnings),
        f"  made      {len(made.files)} files in {output}; open {output / GUIDE} first",
    ]


def _amounts(cars: Sequence[Mapping[str, Any]]) -> str:
    """Return the total sheets, cut length, mass and cost from the cars' manifests."""
    sheet_count = sum(car["sheets"] for car in cars)
    cut_mm = sum(car["cut_length_mm"] for car in cars)
    mass_kg = sum(car["mass_kg"] for car in cars)
    cost_usd = sum(car["cost_usd"] for car in cars)
    return f"{count(sheet_count, 'sheet')}, cut {cut_mm / 1000:.1f} m, {mass_kg * 1000:.0f} g, {cost_usd:.0f} USD"
