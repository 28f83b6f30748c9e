"""`foldcar log`: drives trials of a built car over USB; logs each and stores it beside the simulated runs."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.live import PORT, served_beside
from foldcar.commands.options import (
    CarName,
    Components,
    ExperimentId,
    Listing,
    Port,
    Settings,
    design_settings,
    output_store,
)
from foldcar.errors import FoldcarError
from foldcar.study.limits import MOST_ENVIRONMENTS

MOST_COUNTDOWN_S = 60


def log(
    listing: Listing,
    experiment: ExperimentId,
    port: Port = None,
    store: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_store, help="Store for the trials; default: as LISTING, but .db."),
    ] = None,
    settings: Settings = None,
    sample: Annotated[
        int | None,
        typer.Option(
            metavar="K",
            min=0,
            max=MOST_ENVIRONMENTS - 1,
            help="Sampled environment; default: the one with the fewest trials.",
        ),
    ] = None,
    trials: Annotated[int | None, typer.Option(metavar="N", min=1, help="Stop after N trials.")] = None,
    parameters: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Compare the car's parameters with this file.")
    ] = None,
    deviation: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help='Measured deviation, "NAME X_MM Y_MM [HEADING_DEG]"; may be repeated.'),
    ] = None,
    outcome: Annotated[
        str | None, typer.Option(metavar="OUTCOME", help="Outcome of the trials, instead of asking.")
    ] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="Note on the trials, instead of asking.")] = None,
    car: CarName = None,
    operator: Annotated[str, typer.Option(metavar="NAME", help="The driver's name; stored with each trial.")] = "",
    countdown: Annotated[
        int, typer.Option(metavar="S", min=0, max=MOST_COUNTDOWN_S, help="Seconds before the start.")
    ] = 3,
    untethered: Annotated[
        bool, typer.Option("--untethered", help="Drive without the cable; the car keeps the log.")
    ] = False,
    any_build: Annotated[
        bool, typer.Option("--any-build", help="Drive even if the firmware's build is not the simulated one.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Ask nothing: take every question's default answer.")] = False,
    course: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A camera's course.json: the picture shows where its markers lie."),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Serve the report's page to this machine's browser; it shows the car's state.")
    ] = False,
    components: Components = None,
) -> None:
    """Drive trials with a car on USB and keep them.

    The car moves only after the countdown, and stops after any error.

    \b
    Example: foldcar log scenarios/width_study.json --experiment 1 --store study.db
    """
    from foldcar.camera.markers import read_course
    from foldcar.interrupts import raised, said
    from foldcar.link.parameters import read_file
    from foldcar.store.trial_records import TRIAL_OUTCOMES, checked_name
    from foldcar.trials.session import Session, SessionOptions

    if outcome is not None and outcome not in TRIAL_OUTCOMES:
        raise FoldcarError(f"--outcome {outcome}: not one of {', '.join(TRIAL_OUTCOMES)}")
    if parameters is not None:
        read_file(parameters)
    store = store or Path(f"{listing.stem}.db")
    options = SessionOptions(
        listing=listing,
        experiment=experiment,
        store=store,
        settings=design_settings(settings),
        sample=sample,
        trials=trials,
        parameters=parameters,
        deviations=deviation,
        outcome=outcome,
        note=note,
        operator=operator,
        car=None if car is None else checked_name(car, "--car"),
        countdown_s=countdown,
        untethered=untethered,
        any_build=any_build,
        yes=yes,
        course=None if course is None else read_course(course),
    )
    session = Session(options)
    served = served_beside(store, PORT) if live else nullcontext()
    with served, said(lambda: f"stopped: the driven trials are in {store}"), raised():
        driven = session.run(port)
    typer.echo(f"{driven} trials; store: {store}")
