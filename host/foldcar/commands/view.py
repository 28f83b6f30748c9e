"""`foldcar view`: a page with a car that is put together step by step, and a run that it drives."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.listed_run import ListedRun, listed_family, listed_run, simulated_run
from foldcar.commands.options import (  # fmt: skip
    Components,
    Json,
    Listing,
    Settings,
    Vehicle,
    check_distinct,
    output_file,
    print_result,
)
from foldcar.commands.run import variation_text
from foldcar.errors import FoldcarError
from foldcar.installation import require
from foldcar.study.limits import MAX_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.car.folded.model import FoldedCar


def view(
    listing: Listing,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="The page to write (HTML).")
    ],
    vehicle: Vehicle = None,
    settings: Settings = None,
    run: Annotated[
        str | None,
        typer.Option(metavar="ID[/K]", help="Show the car driving: an experiment and its sampled environment, e.g. 1/3."),
    ] = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Show a car in the browser: its assembly, a run.

    The page that is written needs no network.

    \b
    Example: foldcar view patterns/published_cars.json --vehicle w95 -o car.html
             foldcar view scenarios/width_study.json --set width=95 --run 1/3 -o car.html
    """
    require("fabricate")
    from foldcar.car.folded_car import folded_car
    from foldcar.car.verify import refuse, verify
    from foldcar.fabrication.assembly.view_page import view_page
    from foldcar.outputs import atomic_file

    check_distinct([listing], [output])
    shown = viewed_run(listing, run, vehicle, settings) if run is not None else None
    design = shown.design if shown else listed_family(listing, vehicle, settings)[1].single()
    folded, title = folded_car(design), design.title
    refuse(title, list(map(str, verify(design).findings)))
    page = view_page(folded, title, _replayed(shown, folded) if shown else None)
    with atomic_file(output) as binary:
        binary.write(page.encode())
    print_result(as_json, {"files": [output]}, output)


def _replayed(listed: ListedRun, folded: "FoldedCar") -> dict[str, Any]:
    """What run.js replays of that run. FoldcarError if the run fails."""
    from foldcar.fabrication.assembly.scene_shape import recorded_run
    from foldcar.simulation.heights import carsim_heights
    from foldcar.simulation.results import outcome_of

    one, answer = simulated_run(listed)
    path = one.path(listed.carsim, answer, f"--run {listed.experiment.id}/{listed.sample}")
    ended = f"{outcome_of(answer).replace('_', ' ')} after {answer['elapsed_time_s']:.2f} s."
    told = f"{listed.name.capitalize()}: {ended}"
    if listed.variation:
        told += f" The car that drives differs from the design that is drawn: {variation_text(listed.variation)}."
    return recorded_run(folded, listed.body, listed.scene, answer, path, carsim_heights(listed.carsim), told)


def viewed_run(listing: Path, run: str, vehicle: str | None, settings: Sequence[str] | None) -> ListedRun:
    """The run that the option names; FoldcarError unless it names one, of that vehicle if one is given."""
    named = re.fullmatch(r"([^/]+)(?:/([0-9]{1,8}))?", run)
    if named is None or int(named[2] or 0) >= MAX_ENVIRONMENTS:
        most = MAX_ENVIRONMENTS - 1
        raise FoldcarError(f"--run {run}: not EXPERIMENT/SAMPLE with a sample from 0 to {most}, as in 1/3")
    experiment = named[1]
    listed = listed_run(listing, experiment, settings, int(named[2] or 0))
    its = listed.experiment.family.vehicle
    if vehicle is not None and vehicle != its:
        raise FoldcarError(f"--run {run}: experiment {experiment} is of vehicle {its}, not of {vehicle}")
    return listed
