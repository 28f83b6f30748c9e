"""`foldcar pattern`: writes the sheets to cut a car, or many cars, from, and all files to build it."""

import itertools
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import Components, Json, Settings, output_folder, print_json
from foldcar.errors import FoldcarError
from foldcar.installation import require

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.study.family import Family


def pattern(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing or design (JSON).")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the files.")
    ],
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Vehicle of the listing; default: the only one; with --all: every.")
    ] = None,
    settings: Settings = None,
    every: Annotated[
        bool, typer.Option("--all", help="Every car of the vehicle, or of all vehicles: a folder in DIR for each.")
    ] = False,
    machine: Annotated[
        str, typer.Option(metavar="NAME", help="silhouette, cricut, laser or scissors: presets of the options below.")
    ] = "silhouette",
    sheet: Annotated[
        str | None, typer.Option(metavar="SIZE", help="a4, letter, a3, 12in, 12x24in or WIDTHxHEIGHT in mm.")
    ] = None,
    paper: Annotated[str | None, typer.Option(metavar="SIZE", help="Of PDF pages: a4 or letter.")] = None,
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

    Sheets (SVG, DXF, PDF), FOLD, STL, OBJ, guide, wiring and parts list, checked as written; all files or none.

    \b
    Example: foldcar pattern patterns/published_cars.json --vehicle w95 -o car
             foldcar pattern patterns/published_cars.json --all -o cars
             foldcar pattern patterns/published_cars.json --vehicle w95 --mockup 0.5 -o paper
    """
    require("fabricate")
    from foldcar.commands.listed_design import listed_families, listed_family
    from foldcar.commands.pattern_text import car_command, car_line, car_lines, car_object, mock_up_lines, total_line
    from foldcar.fabrication.make_car import MANIFEST, make_car, make_mock_up
    from foldcar.fabrication.patterns.options import options
    from foldcar.outputs import atomic_folder

    if mockup is not None:
        # The silhouette is the default machine.
        if machine not in ("silhouette", "scissors") or every:
            much = "--all" if every else f"--machine {machine}"
            raise FoldcarError(f"--mockup: makes one car's prototype for scissors, without {much}")
        machine, sheet = "scissors", sheet or paper
    chosen = options(
        machine, sheet=sheet, paper=paper, fold=fold, kerf_mm=kerf, tab_clearance_mm=tab_clearance, dash_cut_mm=dash_cut,
        dash_bridge_mm=dash_bridge, bend_radius_mm=bend_radius, k_factor=k_factor, margin_mm=margin,
        gap_mm=gap, holding_tabs_mm=holding_tabs,
    )  # fmt: skip
    skipped: list[str] = []
    if every:
        families = listed_families(listing, vehicle, settings or [])
        places = list(_places(families))
        skipped = [f"skipped, as it cannot be built: {one}" for family in families for one in family.skipped]
    else:
        family = listed_family(listing, vehicle, settings or [])[1]
        places = [_Place(family.vehicle, "", family.single(), ())]
    if mockup is not None:
        command = car_command(listing, places[0].vehicle, settings or [], chosen, components or [], mockup)
        prototype = make_mock_up(places[0].design, chosen, mockup, command)
        with atomic_folder(output, MANIFEST) as folder:
            for file, content in prototype.files.items():
                (folder / file).write_bytes(content)
        if as_json:
            print_json({"folder": output, **json.loads(prototype.files[MANIFEST])})
        else:
            typer.echo("\n".join(mock_up_lines(prototype, output)))
        return
    cars = []
    with atomic_folder(output, MANIFEST) as folder:
        listed = []
        for place in _with_progress(places):
            words = [*(settings or []), *place.settings]
            made = make_car(place.design, chosen, car_command(listing, place.vehicle, words, chosen, components or []))
            for file, content in made.files.items():
                target = folder / place.folder / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
                listed.append(f"{place.folder}/{file}" if every else file)
            # The contents of all files of a large family would not fit into memory.
            cars.append((car_object(place.vehicle, output / place.folder, made), car_line(place.folder, made)))
        if every:
            (folder / MANIFEST).write_text(json.dumps({"files": [*listed, MANIFEST]}, indent=2) + "\n", encoding="utf-8")
    # The folder has been written by now.
    if as_json:
        print_json({"folder": output, "cars": [car for car, _ in cars], "skipped": skipped})
    elif every:
        total = total_line([car for car, _ in cars], output)
        typer.echo("\n".join([*(line for _, line in cars), *skipped, total]))
    else:
        typer.echo("\n".join(car_lines(made, chosen, output)))


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
