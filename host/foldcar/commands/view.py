"""`foldcar view` writes a page that shows a car's assembly step by step, and a run of the car."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.listed_run import ListedRun, listed_family, listed_run, simulated_run
from foldcar.commands.options import (  # fmt: skip
    Components,
    Listing,
    Settings,
    Vehicle,
    check_distinct,
    output_file,
    print_lines,
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
        Path, typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="HTML page to write.")
    ],
    vehicle: Vehicle = None,
    settings: Settings = None,
    run: Annotated[
        str | None,
        typer.Option(metavar="ID[/K]", help="Also show a run: experiment ID in sampled environment K, e.g. 1/3."),
    ] = None,
    components: Components = None,
) -> None:
    """Write a page that shows a car's assembly and a run.

    Open the page in a browser; it needs no network.

    \b
    Example: foldcar view patterns/published_cars.json --vehicle w95 -o car.html
             foldcar view scenarios/width_study.json --set width=95 --run 1/3 -o car.html
    """
    require("fabricate")
    from foldcar.car.folded_car import folded_car
    from foldcar.car.verify import raise_on_findings, verify
    from foldcar.fabrication.assembly.view_page import view_page
    from foldcar.outputs import atomic_file

    check_distinct([listing], [output])
    viewed = viewed_run(listing, run, vehicle, settings) if run is not None else None
    if viewed is not None:
        design = viewed.design
    else:
        _, family = listed_family(listing, vehicle, settings)
        design = family.single()
    folded, title = folded_car(design), design.title
    raise_on_findings(title, list(map(str, verify(design).findings)))
    page = view_page(folded, title, _run_data(viewed, folded) if viewed else None)
    with atomic_file(output) as binary:
        binary.write(page.encode())
    print_lines(output)


def _run_data(listed: ListedRun, folded: "FoldedCar") -> dict[str, Any]:
    """Simulate a run and return the data with which the page replays it. Raises FoldcarError if the run fails."""
    from foldcar.fabrication.assembly.scene_shape import recorded_run
    from foldcar.simulation.heights import carsim_heights
    from foldcar.simulation.results import outcome_of

    run, answer = simulated_run(listed)
    path = run.path(listed.carsim, answer, f"--run {listed.experiment.id}/{listed.sample}")
    ended = f"{outcome_of(answer).replace('_', ' ')} after {answer['elapsed_time_s']:.2f} s."
    caption = f"{listed.name.capitalize()}: {ended}"
    if listed.variation:
        caption += f" The car in the run differs from the drawn design: {variation_text(listed.variation)}."
    return recorded_run(folded, listed.body, listed.scene, answer, path, carsim_heights(listed.carsim), caption)


def viewed_run(listing: Path, run: str, vehicle: str | None, settings: Sequence[str] | None) -> ListedRun:
    """Return the run that ``--run`` names, as EXPERIMENT/SAMPLE or as EXPERIMENT for sample 0.

    Raises FoldcarError if the text has another form, the run does not exist, or it has another vehicle.
    """
    match = re.fullmatch(r"([^/]+)(?:/([0-9]{1,8}))?", run)
    sample = 0 if match is None or match[2] is None else int(match[2])
    if match is None or sample >= MAX_ENVIRONMENTS:
        last = MAX_ENVIRONMENTS - 1
        raise FoldcarError(f"--run {run}: is not EXPERIMENT/SAMPLE with a sample from 0 to {last}, as in 1/3")
    experiment = match[1]
    listed = listed_run(listing, experiment, settings, sample)
    run_vehicle = listed.experiment.family.vehicle
    if vehicle is not None and vehicle != run_vehicle:
        raise FoldcarError(f"--run {run}: experiment {experiment} has vehicle {run_vehicle}, not {vehicle}")
    return listed
