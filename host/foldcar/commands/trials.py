"""`foldcar trials`: a store's trials - listed, corrected, withdrawn, imported, exported, simulated again as pairs."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import output_file, output_folder
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
    name="trials", help="List, correct and replay trials of cars.", no_args_is_help=True, rich_markup_mode=None
)


@trials.command("list")
def list_trials(
    store: StoreFile,
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
    as_json: Json = False,
) -> None:
    """Show trials, one a line, and their corrections.

    \b
    Example: foldcar trials list study.db --experiment 1
    """
    from foldcar.commands.trial_table import correction_text, print_trials
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        found = list(opened.trials(experiment))
        if experiment is not None and not found:
            known = ", ".join(dict.fromkeys(trial.experiment for trial in opened.trials())) or "none"
            raise FoldcarError(f'{store}: has no trials of experiment "{experiment}"; experiments with trials: {known}')
        trail = [one for trial in found if trial.corrections for one in opened.corrections(trial.id)]
    if as_json:
        print_json({"trials": [asdict(one) for one in found], "corrections": [asdict(one) for one in trail]})
        return
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
    as_json: Json = False,
) -> None:
    """Change what a trial says.

    What stood there is kept, with the reason.

    \b
    Example: foldcar trials correct study.db 7 --outcome tipped --reason "seen on the film"
    """
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
        trail = list(opened.corrections(number))
    if as_json:
        print_json({"corrections": [asdict(one) for one in trail]})
        return
    for one in trail:
        typer.echo(correction_text(one))


@trials.command()
def withdraw(
    store: StoreFile, numbers: Numbers, reason: Reason, operator: Operator = "", as_json: Json = False
) -> None:
    """Withdraw trials, such as practice.

    They stay in the store with their logs, but count nowhere.

    \b
    Example: foldcar trials withdraw study.db 7 8 --reason practice
    """
    _withdraw("withdraw", store, numbers, True, reason, operator, as_json)


@trials.command()
def restore(
    store: StoreFile, numbers: Numbers, reason: Reason, operator: Operator = "", as_json: Json = False
) -> None:
    """Let withdrawn trials count again.

    Both changes are kept, with their reasons.

    \b
    Example: foldcar trials restore study.db 8 --reason "was no practice"
    """
    _withdraw("restore", store, numbers, False, reason, operator, as_json)


@trials.command("import")
def import_file(
    store: StoreFile,
    file: Annotated[Path, typer.Argument(metavar="CSV", help="Trials as docs/trials.md describes them.")],
    experiment: Annotated[
        str | None, typer.Option(metavar="ID", help="The experiment of rows that name none.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Take over trials from a CSV file.

    All of them or none; docs/trials.md has the columns.

    \b
    Example: foldcar trials import study.db scenarios/published_trials.csv
    """
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.csv_import import read_trials
    from foldcar.trials.import_notes import import_notes

    found = read_trials(file, experiment)
    with write_trials(store) as writer:
        for source in dict.fromkeys(trial["source"] for trial in found):
            if writer.source_is_there(source):
                raise FoldcarError(f'{file}: source: trials of "{source}" are in {store} already')
        numbers = writer.import_trials(found)
    for note in import_notes(store, found):
        typer.echo(f"note: {note}", err=True)
    if as_json:
        print_json({"store": store, "imported": list(numbers)})
    else:
        typer.echo(f"{len(numbers)} trials imported, {numbers[0]} to {numbers[-1]}; store: {store}")


@trials.command()
def replay(
    store: StoreFile,
    number: Number,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="Picture of the scene as it stood (.png, .svg, .pdf)."),
    ] = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Simulate a trial again as it was placed.

    Trial and simulation are compared; the picture shows the simulated run.

    \b
    Example: foldcar trials replay study.db 7 --plot pair.png
    """
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
    compared = trial.completed and (trial.standing == BUILT or (simulated_trials and trial.standing == SIMULATED))
    agrees = agree(trial.outcome, outcome) if compared else None
    if not as_json:
        mark = "" if trial.standing == BUILT else f"  ({STANDING_TEXTS[trial.standing]})"
        typer.echo(f"{'':<10}{'outcome':<12}{'time (s)':>9}")
        typer.echo(f"{'trial':<10}{trial.outcome:<12}{seconds_text(trial.elapsed_time_s):>9}{mark}")
        typer.echo(f"{'simulated':<10}{outcome:<12}{seconds_text(simulated_s):>9}")
        if agrees is not None:
            typer.echo("both agree" if agrees else "they disagree")
        elif not trial.completed:
            typer.echo("the trial was aborted: nothing to compare")
        else:
            typer.echo(f"not compared: {STANDING_TEXTS[trial.standing]}")
    if plot is not None:
        from foldcar.figures.ground import carsim_heights
        from foldcar.figures.run import draw_run

        if "path" not in answer:
            raise FoldcarError(f"{plot}: a failed run has no picture")
        draw_run(pair.body, pair.scene, answer, answer["path"], carsim_heights(carsim), plot)
        if not as_json:
            typer.echo(f"picture: {plot}")
    if as_json:
        simulated = {"outcome": outcome, "elapsed_time_s": simulated_s, "message": answer.get("error")}
        print_json({"trial": asdict(trial), "simulated": simulated, "agrees": agrees, "picture": plot})


@trials.command()
def export(
    store: StoreFile,
    number: Number,
    mcap: Annotated[
        Path,
        typer.Option(metavar="FILE", callback=output_file, help="MCAP file to write, for Foxglove and PlotJuggler."),
    ],
    as_json: Json = False,
) -> None:
    """Convert a trial's log to MCAP.

    The log itself, a .tlog, opens in MAVLink's own tools.

    \b
    Example: foldcar trials export study.db 7 --mcap trial7.mcap
    """
    import json

    from foldcar.link.mcap_export import NO_START, export_mcap
    from foldcar.models.foxglove_scene import foxglove_scene
    from foldcar.models.ground import smooth_ground
    from foldcar.models.put_down import start_height_m
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.log_files import log_file, sha256_of
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
    log = log_file(store, trial.log)
    if trial.log_sha256 is not None and sha256_of(log) not in (None, trial.log_sha256):
        raise FoldcarError(f"{log}: is not the log that trial {number} of {store} wrote: its SHA-256 is another")
    if drive is not None and log.is_file():
        body, scene = json.loads(drive[0]), json.loads(drive[2])
        grid = smooth_ground(scene, Carsim())
        scene_update = foxglove_scene(body, scene, grid)
        start = {**scene["start"], "z_m": start_height_m(body, scene, grid)}
    count = export_mcap(log, mcap, facts, scene_update, start)
    if as_json:
        print_json({"files": [mcap], "messages": count})
    else:
        typer.echo(f"{mcap}: {count} messages")


@trials.command()
def dialect(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", callback=output_folder, help="Folder to write v1.0/foldcar.xml in."
        ),
    ],
    as_json: Json = False,
) -> None:
    """Write the MAVLink dialect as XML.

    With it, other programs name foldcar's own messages too.

    \b
    Example: foldcar trials dialect -o dialect
    """
    from foldcar.atomic_file import atomic_file
    from foldcar.mavlink_dialect.generation import DialectError, dialect_xml
    from foldcar.output_folder import make_output_folder

    try:
        text = dialect_xml()
    except DialectError as error:
        raise FoldcarError(str(error)) from None
    make_output_folder(output)
    file = output / "v1.0" / "foldcar.xml"
    with atomic_file(file) as binary:
        binary.write(text.encode())
    if as_json:
        print_json({"files": [file]})
    else:
        typer.echo(f"{file}")


def _withdraw(
    command: str, store: Path, numbers: list[int], withdrawn: bool, reason: str, operator: str, as_json: bool
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
        trail = [opened.corrections(number)[-1] for number in chosen]
    if as_json:
        print_json({"corrections": [asdict(one) for one in trail]})
        return
    for one in trail:
        typer.echo(correction_text(one))


def _check_reason(command: str, reason: str) -> None:
    if not reason.strip():
        raise FoldcarError(f"trials {command}: --reason: is empty")
