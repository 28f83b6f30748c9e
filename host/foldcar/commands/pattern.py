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

from foldcar.commands.options import Components, Json, Listing, Machine, OutputFolder, Settings, Sheet, tell
from foldcar.errors import FoldcarError
from foldcar.installation import require
from foldcar.shown_text import decoded

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.fabrication.make_car import MadeCar, MadeMockUp
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
    holding_tabs: Annotated[
        float | None, typer.Option(metavar="MM", help="Bridges that hold the pieces in the sheet; 0: none.")
    ] = None,
    mockup: Annotated[
        float | None,
        typer.Option(metavar="SCALE", help="Paper prototype to try the fold, 0.25 to 1: body and discs, for scissors."),
    ] = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Write all files that a car is built from.

    Sheets (SVG, DXF, PDF), STL, OBJ, guide, wiring and parts list, checked as written; all files or none.

    \b
    Example: foldcar pattern patterns/published_cars.json --vehicle w95 -o car
             foldcar pattern patterns/published_cars.json --all -o cars
             foldcar pattern patterns/published_cars.json --vehicle w95 --mockup 0.5 -o paper
    """
    require("fabricate")
    from foldcar.commands.listed_run import listed_families
    from foldcar.fabrication.make_car import MANIFEST, make_car, make_mock_up
    from foldcar.fabrication.patterns.options import options
    from foldcar.outputs import atomic_folder

    if mockup is not None:
        # The silhouette is the default machine.
        if machine not in ("silhouette", "scissors") or every:
            much = "--all" if every else f"--machine {machine}"
            raise FoldcarError(f"--mockup: makes one car's prototype for scissors, without {much}")
        machine = "scissors"
    chosen = options(
        machine, sheet=sheet, fold=fold, kerf_mm=kerf, tab_clearance_mm=tab_clearance, dash_cut_mm=dash_cut,
        dash_bridge_mm=dash_bridge, bend_radius_mm=bend_radius, k_factor=k_factor, margin_mm=margin,
        gap_mm=gap, holding_tabs_mm=holding_tabs,
    )  # fmt: skip
    families = listed_families(listing, vehicle, settings, every)[1]
    places = list(_places(families)) if every else [_Place(families[0].vehicle, "", families[0].single(), ())]
    skipped = [f"skipped, as it cannot be built: {one}" for family in families for one in family.skipped if every]

    def command(place: _Place) -> str:
        words = [*(settings or []), *place.settings]
        return car_command(listing, place.vehicle, words, chosen, components or [], mockup)

    if mockup is not None:
        prototype = make_mock_up(places[0].design, chosen, mockup, command(places[0]))
        with atomic_folder(output, MANIFEST) as folder:
            for file, content in prototype.files.items():
                (folder / file).write_bytes(content)
        manifest = json.loads(prototype.files[MANIFEST])
        tell(as_json, {"folder": output, **manifest}, *_mock_up_lines(prototype, output))
        return
    cars, lines = [], []
    with atomic_folder(output, MANIFEST) as folder:
        listed = []
        for place in _with_progress(places):
            made = make_car(place.design, chosen, command(place))
            for file, content in made.files.items():
                target = folder / place.folder / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
                listed.append(f"{place.folder}/{file}" if every else file)
            # The contents of all files of a large family would not fit into memory.
            manifest = json.loads(made.files[MANIFEST])
            of_car = {"vehicle": place.vehicle, "folder": output / place.folder, "title": made.title}
            cars.append({**of_car, **manifest, "checks": list(made.checks)})
            lines += [_car_line(place.folder, made)] if every else _car_lines(made, chosen, output)
        if every:
            (folder / MANIFEST).write_text(json.dumps({"files": [*listed, MANIFEST]}, indent=2) + "\n", encoding="utf-8")
            lines += [*skipped, _total_line(cars, output)]
    # The folder has been written by now.
    tell(as_json, {"folder": output, "cars": cars, "skipped": skipped}, *lines)


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
    listing: Path, vehicle: str, settings: Sequence[str], chosen: "Options", components: Sequence[Path],
    mockup: float | None = None,
) -> str:  # fmt: skip
    """The command that makes this car alone, or its paper prototype of a scale, in a folder ``car``."""
    from foldcar.fabrication.patterns.options import arguments

    words = ["foldcar", "pattern", listing.as_posix(), "--vehicle", vehicle]
    words += [word for setting in settings for word in ("--set", setting)]
    words += [word for file in components for word in ("--components", file.as_posix())]
    words = [*words, *arguments(chosen)]
    words += [] if mockup is None else ["--mockup", f"{mockup:g}"]
    return decoded(shlex.join([*words, "-o", "car"]))


def _car_line(folder: str, made: "MadeCar") -> str:
    """One of several cars."""
    cut = made.pattern
    warned = f", {len(cut.warnings)} warnings" if cut.warnings else ""
    return f"{folder}: {_amounts(len(cut.sheets), cut.cut_length_mm, made.mass_kg, made.cost_usd)}{warned}"


def _total_line(cars: Sequence[Mapping[str, Any]], output: Path) -> str:
    """All cars together."""
    vehicles = len({car["vehicle"] for car in cars})
    of_vehicles = f" of {vehicles} vehicles" if vehicles > 1 else ""
    sums = (sum(car[key] for car in cars) for key in ("sheets", "cut_length_mm", "mass_kg", "cost_usd"))
    return f"{len(cars)} cars{of_vehicles} in {output}: {_amounts(*sums)}"


def _car_lines(made: "MadeCar", chosen: "Options", output: Path) -> list[str]:
    """The only car."""
    from foldcar.fabrication.make_car import GUIDE

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


def _mock_up_lines(made: "MadeMockUp", output: Path) -> list[str]:
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
