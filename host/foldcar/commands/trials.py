"""`foldcar trials`: a store's trials - listed, corrected, withdrawn, imported, exported, simulated again as pairs."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.simulated_trials_option import SimulatedTrials
from foldcar.errors import FoldcarError

StoreFile = Annotated[Path, typer.Argument(metavar="STORE", help="The store that holds the trials.")]
Number = Annotated[int, typer.Argument(metavar="TRIAL", min=1, help="The trial's number, as `trials list` shows it.")]

Numbers = Annotated[
    list[int], typer.Argument(metavar="TRIAL...", min=1, help="Numbers of trials, as `trials list` shows them.")
]
Reason = Annotated[str, typer.Option(metavar="TEXT", help="Why; it is kept with the change.")]
Operator = Annotated[str, typer.Option(metavar="NAME", help="Who changes it; kept with the change.")]

trials = typer.Typer(
    name="trials", help="Trials of cars in a store.", no_args_is_help=True, rich_markup_mode=None
)


@trials.command("list")
def list_trials(
    store: StoreFile,
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
) -> None:
    """Show trials, one a line, and what was corrected of them."""
    from foldcar.commands.trial_table import correction_text, print_trials
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        found = list(opened.trials(experiment))
        trail = [one for trial in found if trial.corrections for one in opened.corrections(trial.id)]
    print_trials(found)
    for one in trail:
        typer.echo(correction_text(one))


@trials.command()
def correct(
    store: StoreFile,
    number: Number,
    reason: Reason,
    outcome: Annotated[str | None, typer.Option(metavar="OUTCOME", help="The outcome it should have.")] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="The note it should have.")] = None,
    elapsed_time: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="How long it drove, in seconds.")
    ] = None,
    car: Annotated[
        str | None, typer.Option(metavar="CAR", help="What drove, built or simulated, if no car has said it itself.")
    ] = None,
    operator: Operator = "",
) -> None:
    """Change what a trial says. What stood there is kept, with the reason."""
    from foldcar.commands.trial_table import correction_text
    from foldcar.store.opening import require_store
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials

    changes = {"outcome": outcome, "note": note, "elapsed_time_s": elapsed_time, "car": car}
    if all(value is None for value in changes.values()):
        raise FoldcarError("trials correct: say what to change: --outcome, --note, --elapsed-time or --car")
    _check_reason("correct", reason)
    require_store(store)
    with write_trials(store) as writer:
        writer.correct(number, {k: v for k, v in changes.items() if v is not None}, reason, operator)
    with Store.open(store) as opened:
        for one in opened.corrections(number):
            typer.echo(correction_text(one))


@trials.command()
def withdraw(store: StoreFile, numbers: Numbers, reason: Reason, operator: Operator = "") -> None:
    """Withdraw trials, such as practice: they stay in the store with their logs, but count nowhere."""
    _withdraw("withdraw", store, numbers, True, reason, operator)


@trials.command()
def restore(store: StoreFile, numbers: Numbers, reason: Reason, operator: Operator = "") -> None:
    """Let trials count again that were withdrawn. Both changes are kept, with their reasons."""
    _withdraw("restore", store, numbers, False, reason, operator)


@trials.command("import")
def import_file(
    store: StoreFile,
    file: Annotated[Path, typer.Argument(metavar="CSV", help="Trials as docs/trials.md describes them.")],
    experiment: Annotated[
        str | None, typer.Option(metavar="ID", help="The experiment of rows that name none.")
    ] = None,
) -> None:
    """Take over trials from a CSV file, all of them or none."""
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.csv_import import read_trials

    found = read_trials(file, experiment)
    with write_trials(store) as writer:
        for source in dict.fromkeys(trial["source"] for trial in found):
            if writer.source_is_there(source):
                raise FoldcarError(f'{file}: source: trials of "{source}" are in {store} already')
        numbers = writer.import_trials(found)
    typer.echo(f"{len(numbers)} trials imported, {numbers[0]} to {numbers[-1]}; store: {store}")


@trials.command()
def replay(
    store: StoreFile,
    number: Number,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Picture of the scene as it stood (.png, .svg, .pdf).")
    ] = None,
    simulated_trials: SimulatedTrials = False,
) -> None:
    """Simulate a trial again as it was placed, and show both."""
    from foldcar.commands.trial_table import STANDING_TEXTS, seconds_text
    from foldcar.figures.output import check_format
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.results import outcome_of
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import BUILT, SIMULATED
    from foldcar.trials.replay import agree, simulate_pair

    if plot is not None:
        check_format(plot)
    carsim = Carsim()
    with Store.open(store) as opened:
        trial = opened.trial(number)
        pair = simulate_pair(opened, number, carsim)
    answer = pair.answer
    outcome = outcome_of(answer)
    simulated_s = answer.get("elapsed_time_s")
    typer.echo(f"{'':<10}{'outcome':<12}{'time (s)':>9}")
    mark = "" if trial.standing == BUILT else f"  ({STANDING_TEXTS[trial.standing]})"
    typer.echo(f"{'trial':<10}{trial.outcome:<12}{seconds_text(trial.elapsed_time_s):>9}{mark}")
    typer.echo(f"{'simulated':<10}{outcome:<12}{seconds_text(simulated_s):>9}")
    if not trial.completed:
        typer.echo("the trial was aborted: nothing to compare")
    elif trial.standing == BUILT or (simulated_trials and trial.standing == SIMULATED):
        typer.echo("both agree" if agree(trial.outcome, outcome) else "they disagree")
    else:
        typer.echo(f"not compared: {STANDING_TEXTS[trial.standing]}")
    if plot is not None:
        from foldcar.figures.ground import carsim_heights
        from foldcar.figures.run import draw_run

        if "path" not in answer:
            raise FoldcarError(f"{plot}: a failed run has no picture")
        draw_run(pair.body, pair.scene, answer, answer["path"], carsim_heights(carsim), plot)
        typer.echo(f"picture: {plot}")


@trials.command()
def export(
    store: StoreFile,
    number: Number,
    mcap: Annotated[Path, typer.Option(metavar="FILE", help="MCAP file to write, for Foxglove and PlotJuggler.")],
) -> None:
    """Convert a trial's log. The log itself, a .tlog, opens in MAVLink's own tools."""
    import json

    from foldcar.link.mcap_export import NO_START, export_mcap
    from foldcar.models.foxglove_scene import foxglove_scene
    from foldcar.models.ground import smooth_ground
    from foldcar.models.put_down import start_height_m
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.log_files import log_file
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        trial, drive = opened.trial(number), opened.trial_drive(number)
    if trial.log is None:
        raise FoldcarError(f"{store}: trial {number} was imported: it has no log")
    facts = {
        "trial": str(trial.id),
        "experiment": trial.experiment,
        "design": " ".join(f"{name}={value:g}" for name, value in trial.design.items()),
        "sample": str(trial.sample),
        "outcome": trial.outcome,
        "note": trial.note,
        "car": trial.car or "unknown",
        "withdrawn": str(trial.withdrawn).lower(),
    }
    scene_update, start = None, NO_START
    if drive is not None:
        body, scene = json.loads(drive[0]), json.loads(drive[2])
        grid = smooth_ground(scene, Carsim())
        scene_update = foxglove_scene(body, scene, grid)
        start = {**scene["start"], "z_m": start_height_m(body, scene, grid)}
    count = export_mcap(log_file(store, trial.log), mcap, facts, scene_update, start)
    typer.echo(f"{mcap}: {count} messages")


@trials.command()
def dialect(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write v1.0/foldcar.xml in.")],
) -> None:
    """Write the MAVLink dialect, with which other programs name our own messages too."""
    from foldcar.atomic_file import atomic_file
    from foldcar.mavlink_dialect.generation import DialectError, dialect_xml

    try:
        text = dialect_xml()
    except DialectError as error:
        raise FoldcarError(str(error)) from None
    file = output / "v1.0" / "foldcar.xml"
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(file) as binary:
        binary.write(text.encode())
    typer.echo(f"{file}")


def _withdraw(
    command: str, store: Path, numbers: list[int], withdrawn: bool, reason: str, operator: str
) -> None:
    from foldcar.commands.trial_table import correction_text
    from foldcar.store.opening import require_store
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials

    _check_reason(command, reason)
    require_store(store)
    chosen = list(dict.fromkeys(numbers))
    with write_trials(store) as writer:
        writer.withdraw(chosen, withdrawn, reason, operator)
    with Store.open(store) as opened:
        for number in chosen:
            typer.echo(correction_text(opened.corrections(number)[-1]))


def _check_reason(command: str, reason: str) -> None:
    if not reason.strip():
        raise FoldcarError(f"trials {command}: --reason: is empty")
