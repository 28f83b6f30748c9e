"""`foldcar view`: a page with a car that is put together step by step, drives a run, or is changed by sliders."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.listed_run import ListedRun, listed_family, listed_run, simulated_run
from foldcar.commands.options import (
    Components,
    Json,
    Listing,
    Machine,
    Settings,
    Sheet,
    Vehicle,
    check_distinct,
    design_settings,
    output_file,
    tell,
)
from foldcar.commands.run import variation_text
from foldcar.errors import FoldcarError
from foldcar.installation import require
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.fabrication.assembly.live_car import LiveCar


def view(
    listing: Listing,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="The page to write (HTML)."),
    ] = None,
    vehicle: Vehicle = None,
    settings: Settings = None,
    live: Annotated[
        bool, typer.Option("--live", help="Serve the page to this machine's browser, with sliders; until Ctrl-C.")
    ] = False,
    run: Annotated[
        str | None,
        typer.Option(metavar="ID[/K]", help="Show the car driving: an experiment and its sampled environment, e.g. 1/3."),
    ] = None,
    machine: Machine = "silhouette",
    sheet: Sheet = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Show a car in the browser: its assembly, sheets, a run.

    The page that is written needs no network. With --live it has sliders for the design instead of sheets.

    \b
    Example: foldcar view patterns/published_cars.json --vehicle w95 -o car.html
             foldcar view scenarios/width_study.json --set width=95 --run 1/3 --live
    """
    require("fabricate")
    from foldcar.fabrication.assembly.live_car import LiveCar

    if live == (output is not None):
        raise FoldcarError("-o: --live serves the page and writes none" if live else "-o FILE is missing (or --live)")
    check_distinct([listing], [output])
    shown = viewed_run(listing, run, vehicle, settings) if run is not None else None
    design = shown.design if shown else listed_family(listing, vehicle, settings)[1].single()
    replayed = partial(_replayed, shown) if shown else None
    if output is None:
        vehicle = shown.experiment.family.vehicle if shown else vehicle
        words = ["foldcar", "pattern", str(listing), *(["--vehicle", vehicle] if vehicle else [])]
        _serve(LiveCar(design, words, list(design_settings(settings)), replayed), as_json)
        return
    _write(design, output, replayed(design) if replayed else None, machine, sheet)
    tell(as_json, {"files": [output]}, output)


def _write(design: "Design", output: Path, run: dict[str, Any] | None, machine: str, sheet: str | None) -> None:
    from foldcar.fabrication.assembly.live_car import checked_car
    from foldcar.fabrication.assembly.view_page import view_page
    from foldcar.fabrication.patterns.options import options
    from foldcar.fabrication.patterns.sheets import pattern
    from foldcar.outputs import atomic_file

    folded, title = checked_car(design), design.title
    cut = pattern(folded, options(machine, sheet=sheet), title).sheets
    page = view_page(folded, title, cut, run)
    with atomic_file(output) as binary:
        binary.write(page.encode())


def _serve(car: "LiveCar", as_json: bool) -> None:
    from foldcar.figures.page_server import PageServer
    from foldcar.interrupts import said

    with (
        PageServer(car.page(), {"/car": car.answer, "/draft": car.draft}) as server,
        said(lambda: f"foldcar: {server.url} is closed"),
    ):
        tell(as_json, {"url": server.url}, f"{server.url} (until Ctrl-C)")
        server.serve_forever()


def _replayed(run: ListedRun, design: "Design") -> dict[str, Any]:
    """What run.js replays of that design's run in this environment. FoldcarError if the run fails."""
    from foldcar.car.folded_car import folded_car
    from foldcar.fabrication.assembly.recorded_run import recorded_run
    from foldcar.simulation.heights import carsim_heights
    from foldcar.simulation.results import outcome_of

    listed = run.with_design(design)
    one, answer = simulated_run(listed)
    path = one.path(listed.carsim, answer, f"--run {listed.experiment.id}/{listed.sample}")
    ended = f"{outcome_of(answer).replace('_', ' ')} after {answer['elapsed_time_s']:.2f} s."
    told = f"{listed.name.capitalize()}: {ended}"
    if listed.variation:
        told += f" The car that drives differs from the design that is drawn: {variation_text(listed.variation)}."
    heights = carsim_heights(listed.carsim)
    return recorded_run(folded_car(design), listed.body, listed.scene, answer, path, heights, told)


def viewed_run(listing: Path, run: str, vehicle: str | None, settings: Sequence[str] | None) -> ListedRun:
    """The run that the option names; FoldcarError unless it names one, of that vehicle if one is given."""
    experiment, slash, number = run.partition("/")
    sample = int(number) if number.isascii() and number.isdigit() and len(number) < 9 else None
    if not slash:
        sample = 0
    if not experiment or sample is None or sample >= MOST_ENVIRONMENTS:
        most = MOST_ENVIRONMENTS - 1
        raise FoldcarError(f"--run {run}: not EXPERIMENT/SAMPLE with a sample from 0 to {most}, as in 1/3")
    listed = listed_run(listing, experiment, settings, sample)
    its = listed.experiment.family.vehicle
    if vehicle is not None and vehicle != its:
        raise FoldcarError(f"--run {run}: experiment {experiment} is of vehicle {its}, not of {vehicle}")
    return listed
