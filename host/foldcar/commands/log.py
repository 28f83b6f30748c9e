"""`foldcar log` drives trials of a built car over USB, logs them and stores them beside the simulated runs."""

from collections.abc import Collection
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import (
    Components,
    ExperimentId,
    Listing,
    Port,
    Settings,
    design_settings,
    output_store,
    print_note,
)
from foldcar.errors import FoldcarError
from foldcar.study.limits import MAX_ENVIRONMENTS

MAX_COUNTDOWN_S = 60
# Default countdowns; without a tether there must be time to pull the cable.
COUNTDOWN_S, UNTETHERED_COUNTDOWN_S = 3, 8


def log(
    listing: Listing,
    experiment: ExperimentId,
    port: Port = None,
    store: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", callback=output_store, help="Store for the trials; default: LISTING's name with .db."
        ),
    ] = None,
    settings: Settings = None,
    sample: Annotated[
        int | None,
        typer.Option(
            metavar="K",
            min=0,
            max=MAX_ENVIRONMENTS - 1,
            help="Which sampled environment, counted from 0; default: one with the fewest trials.",
        ),
    ] = None,
    trials: Annotated[int | None, typer.Option(metavar="N", min=1, help="Stop after N trials.")] = None,
    deviation: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TEXT",
            help='Deviation of an object from its planned place, "NAME X_MM Y_MM [HEADING_DEG]"; may be repeated.',
        ),
    ] = None,
    outcome: Annotated[
        str | None, typer.Option(metavar="OUTCOME", help="Outcome of all completed trials; default: ask after each.")
    ] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="Note on all trials; default: ask.")] = None,
    car: Annotated[
        str | None, typer.Option(metavar="NAME", help="Name of the built car; cars without a name count as one car.")
    ] = None,
    operator: Annotated[str, typer.Option(metavar="NAME", help="The driver's name, stored with each trial.")] = "",
    countdown: Annotated[
        int | None,
        typer.Option(metavar="S", min=0, max=MAX_COUNTDOWN_S, help="Seconds before the start; default: 3, untethered 8."),
    ] = None,
    untethered: Annotated[
        bool, typer.Option("--untethered", help="Drive without the USB cable; the car counts down and stores the log.")
    ] = False,
    button: Annotated[
        bool, typer.Option("--button", help="As --untethered, but the countdown starts when the car's button is pressed.")
    ] = False,
    any_build: Annotated[
        bool, typer.Option("--any-build", help="Drive even if the firmware's build differs from the simulated one.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Ask no questions; use the default answers.")] = False,
    media: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder to watch: new photos and films are attached to the current trial."),
    ] = None,
    components: Components = None,
) -> None:
    """Drive trials with a car on USB and store them.

    The car moves only after the countdown, and stops at any error. After each trial you can change its outcome or drive
    it again. At the end, the trials are compared with the simulation, and the next design is recommended.

    \b
    Example: foldcar log scenarios/width_study.json --experiment 1 --store study.db
    """
    from foldcar.interrupts import message_on_signal
    from foldcar.store.trial_records import TRIAL_OUTCOMES, checked_name
    from foldcar.trials.session import Session
    from foldcar.trials.session_options import SessionOptions

    if outcome is not None and outcome not in TRIAL_OUTCOMES:
        raise FoldcarError(f"--outcome {outcome}: not one of {', '.join(TRIAL_OUTCOMES)}")
    if media is not None and not media.is_dir():
        raise FoldcarError(f"--media {media}: not a folder")
    store = store or Path(f"{listing.stem}.db")
    is_untethered = untethered or button
    if is_untethered and yes and outcome is None:
        option = "--button" if button else "--untethered"
        raise FoldcarError(
            f"--yes: with {option}, neither car nor computer sees whether the car has passed; give --outcome, or leave "
            "--yes out to be asked"
        )
    default_countdown_s = UNTETHERED_COUNTDOWN_S if is_untethered else COUNTDOWN_S
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
        countdown_s=default_countdown_s if countdown is None else countdown,
        untethered=is_untethered,
        button=button,
        any_build=any_build,
        yes=yes,
        media_folder=media,
    )
    with message_on_signal(lambda: f"stopped: the trials driven so far are in {store}"):
        session = Session(options)
        for text in session.unlisted_values:
            print_note(text)
        session.run(port)
        from foldcar.statistics.words import count

        aborted = f", {session.aborted} aborted" if session.aborted else ""
        typer.echo(f"{count(len(session.driven), 'trial')} in this session{aborted}; store: {store}")
        if session.driven and not yes:
            _print_session(store, session.driven)
    # A script has nobody who reads that a trial has to be repeated.
    if yes and session.aborted:
        raise typer.Exit(1)


def _print_session(store: Path, numbers: Collection[int]) -> None:
    """Print a session's result: how many of its trials passed, and what `compare` and `select` now conclude.

    ``numbers`` are those of its trials, all of one experiment.
    """
    from foldcar.commands.progress_bar import working
    from foldcar.evidence.comparison import compare_evidence
    from foldcar.evidence.evidence import read_evidence, swept_ids
    from foldcar.evidence.selecting import select_evidence
    from foldcar.shown_console import shown_console
    from foldcar.statistics.words import count
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import BUILT, SIMULATED

    with Store.open(store) as reader, working("evaluating the trials"):
        session_trials = [trial for trial in reader.trials() if trial.id in numbers]
        experiment = session_trials[0].experiment
        # Trials of simulated cars are evaluated only if there are no others.
        standing = SIMULATED if all(trial.standing != BUILT for trial in session_trials) else BUILT
        is_swept = experiment in swept_ids(reader)
        evidence = read_evidence(reader, experiment, standing == SIMULATED) if is_swept else []
        comparison, selections = compare_evidence(evidence), select_evidence(evidence)
    completed = [trial for trial in session_trials if trial.standing == standing and trial.completed]
    passed_count = sum(trial.outcome == "passed" for trial in completed)
    first_line = f"This session: {passed_count} of {len(completed)} passed in experiment {experiment}"
    uncounted = len(session_trials) - len(completed)
    if uncounted:
        first_line += f"; {count(uncounted, 'more trial')} aborted or withdrawn"
    lines = [first_line]
    if standing == SIMULATED:
        lines.append("SIMULATED trials: other commands count them with --simulated-trials only.")
    driven_designs = [trial.design for trial in session_trials]
    for experiment_comparison in comparison.experiments:
        for design_comparison in experiment_comparison.designs:
            if design_comparison.design in driven_designs:
                verdict = design_comparison.verdict or "nothing to compare"
                lines.append(f"{design_comparison.label}: {verdict}")
    if not is_swept:
        lines.append(f"Experiment {experiment} was not swept in {store}: there is no simulation to compare with.")
    for selection in selections:
        lines += [sentence for sentence in (selection.works, selection.learn) if sentence]
    shown_console().print("\n".join(lines))
