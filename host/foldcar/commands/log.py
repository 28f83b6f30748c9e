"""`foldcar log`: drives trials of a built car over USB; logs each and stores it beside the simulated runs."""

from collections.abc import Collection
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Components, ExperimentId, Listing, Port, Settings, design_settings, output_store
from foldcar.errors import FoldcarError
from foldcar.study.limits import MAX_ENVIRONMENTS

MAX_COUNTDOWN_S = 60


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
            max=MAX_ENVIRONMENTS - 1,
            help="Sampled environment; default: the one with the fewest trials.",
        ),
    ] = None,
    trials: Annotated[int | None, typer.Option(metavar="N", min=1, help="Stop after N trials.")] = None,
    deviation: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help='Measured deviation, "NAME X_MM Y_MM [HEADING_DEG]"; may be repeated.'),
    ] = None,
    outcome: Annotated[
        str | None, typer.Option(metavar="OUTCOME", help="Outcome of the trials, instead of asking.")
    ] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="Note on the trials, instead of asking.")] = None,
    car: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which built car of its design it is; nameless ones count as one.")
    ] = None,
    operator: Annotated[str, typer.Option(metavar="NAME", help="The driver's name; stored with each trial.")] = "",
    countdown: Annotated[
        int, typer.Option(metavar="S", min=0, max=MAX_COUNTDOWN_S, help="Seconds before the start.")
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
    media: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="A folder; photos and films that appear there are kept with their trials."),
    ] = None,
    components: Components = None,
) -> None:
    """Drive trials with a car on USB and keep them.

    The car moves only after the countdown, and stops after any error. After each trial its outcome can be changed, and
    the trial driven again; at the end it says what the trials have told.

    \b
    Example: foldcar log scenarios/width_study.json --experiment 1 --store study.db
    """
    from foldcar.interrupts import message_on_signal
    from foldcar.store.trial_records import TRIAL_OUTCOMES, checked_name
    from foldcar.trials.camera.markers import read_course
    from foldcar.trials.session import Session, SessionOptions

    if outcome is not None and outcome not in TRIAL_OUTCOMES:
        raise FoldcarError(f"--outcome {outcome}: not one of {', '.join(TRIAL_OUTCOMES)}")
    if media is not None and not media.is_dir():
        raise FoldcarError(f"--media {media}: is no folder")
    store = store or Path(f"{listing.stem}.db")
    options = SessionOptions(
        listing=listing,
        experiment=experiment,
        store=store,
        settings=design_settings(settings),
        sample=sample,
        trials=trials,
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
        media_folder=media,
    )
    with message_on_signal(lambda: f"stopped: the driven trials are in {store}"):
        session = Session(options)
        session.run(port)
        typer.echo(f"{len(session.driven)} trials; store: {store}")
        if session.driven and not yes:
            _print_session(store, session.driven)


def _print_session(store: Path, numbers: Collection[int]) -> None:
    """Print what the trials ``numbers`` of one experiment were, and what `compare` and `select` say with them."""
    from foldcar.commands.progress_bar import working
    from foldcar.inference.comparison import compare_evidence
    from foldcar.inference.evidence import read_evidence, swept_ids
    from foldcar.inference.selecting import MEASURE, measure_first, select_evidence
    from foldcar.shown_console import shown_console
    from foldcar.statistics.words import count
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import BUILT, SIMULATED

    with Store.open(store) as opened, working("weighing the trials"):
        mine = [trial for trial in opened.trials() if trial.id in numbers]
        experiment = mine[0].experiment
        # Trials of simulated cars are weighed, as such, where there are no others.
        counted = SIMULATED if all(trial.standing != BUILT for trial in mine) else BUILT
        swept = experiment in swept_ids(opened)
        evidence = read_evidence(opened, experiment, counted == SIMULATED) if swept else []
        compared, selections = compare_evidence(evidence), select_evidence(evidence, with_cost=False)
        if counted == BUILT:
            selections = [measure_first(opened, selection) for selection in selections]
    completed = [trial for trial in mine if trial.standing == counted and trial.completed]
    passed, others = sum(trial.outcome == "passed" for trial in completed), len(mine) - len(completed)
    more = f"; {count(others, 'more trial')} aborted or withdrawn" if others else ""
    lines = [f"This session: {passed} of {len(completed)} passed in experiment {experiment}{more}"]
    if counted == SIMULATED:
        lines.append("SIMULATED trials: they count in no rate of built cars.")
    driven = [trial.design for trial in mine]
    rows = [row for one in compared.experiments for row in one.designs if row.design in driven]
    lines += [f"{row.label}: {row.verdict or 'nothing to compare'}" for row in rows]
    if not swept:
        lines.append(f"Experiment {experiment} was not swept in {store}: there is no simulation to compare with.")
    for selection in selections:
        lines += [selection.sentence, *(remark for remark in selection.remarks if remark.startswith(MEASURE))]
    shown_console().print("\n".join(lines))
