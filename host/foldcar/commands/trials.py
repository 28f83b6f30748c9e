"""`foldcar trials`: the trials in a store - listed, corrected, imported, exported, simulated again as pairs."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import output_file, output_folder
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.store.trial_records import Correction, Trial

StoreFile = Annotated[Path, typer.Argument(metavar="STORE", help="The store that holds the trials.")]
Number = Annotated[int, typer.Argument(metavar="TRIAL", min=1, help="The trial's number, as `trials list` shows it.")]

trials = typer.Typer(
    name="trials", help="List, correct and replay trials of built cars.", no_args_is_help=True, rich_markup_mode=None
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
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        found = list(opened.trials(experiment))
        trail = [one for trial in found if trial.corrections for one in opened.corrections(trial.id)]
    if as_json:
        print_json({"trials": [asdict(one) for one in found], "corrections": [asdict(one) for one in trail]})
        return
    _print_trials(found)
    for one in trail:
        typer.echo(_correction_text(one))


@trials.command()
def correct(
    store: StoreFile,
    number: Number,
    reason: Annotated[str, typer.Option(metavar="TEXT", help="Why; it is kept with the correction.")],
    outcome: Annotated[str | None, typer.Option(metavar="OUTCOME", help="The outcome it should have.")] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="The note it should have.")] = None,
    elapsed_time: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="How long it drove, in seconds.")
    ] = None,
    operator: Annotated[str, typer.Option(metavar="NAME", help="Who corrects it.")] = "",
    as_json: Json = False,
) -> None:
    """Change what a trial says.

    What stood there is kept, with the reason.

    \b
    Example: foldcar trials correct study.db 7 --outcome tipped --reason "seen on the film"
    """
    from foldcar.store.opening import require_store
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials

    changes = {"outcome": outcome, "note": note, "elapsed_time_s": elapsed_time}
    if all(value is None for value in changes.values()):
        raise FoldcarError("trials correct: say what to change: --outcome, --note or --elapsed-time")
    if not reason.strip():
        raise FoldcarError("trials correct: --reason: is empty")
    require_store(store)
    with write_trials(store) as writer:
        writer.correct(number, {k: v for k, v in changes.items() if v is not None}, reason, operator)
    with Store.open(store) as opened:
        trail = list(opened.corrections(number))
    if as_json:
        print_json({"corrections": [asdict(one) for one in trail]})
        return
    for one in trail:
        typer.echo(_correction_text(one))


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

    found = read_trials(file, experiment)
    with write_trials(store) as writer:
        for source in dict.fromkeys(trial["source"] for trial in found):
            if writer.source_is_there(source):
                raise FoldcarError(f'{file}: source: trials of "{source}" are in {store} already')
        numbers = writer.import_trials(found)
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
    as_json: Json = False,
) -> None:
    """Simulate a trial again as it was placed.

    Trial and simulation are compared; the picture shows the simulated run.

    \b
    Example: foldcar trials replay study.db 7 --plot pair.png
    """
    from foldcar.figures.output import check_format
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.results import outcome_of
    from foldcar.store.reader import Store
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
    agrees = agree(trial.outcome, outcome) if trial.counts else None
    if not as_json:
        typer.echo(f"{'':<10}{'outcome':<12}{'time (s)':>9}")
        typer.echo(f"{'trial':<10}{trial.outcome:<12}{_seconds(trial.elapsed_time_s):>9}")
        typer.echo(f"{'simulated':<10}{outcome:<12}{_seconds(simulated_s):>9}")
        words = {None: "the trial was aborted: nothing to compare", True: "both agree", False: "they disagree"}
        typer.echo(words[agrees])
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
    }
    scene_update, start = None, NO_START
    log = log_file(store, trial.log)
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


def _print_trials(found: "list[Trial]") -> None:
    from foldcar.commands.result_table import result_table

    console, table = result_table(200)
    shown = _varying(found)
    for head in ("trial", "experiment", *shown, "sample", "outcome", "time (s)", "ending", "started (UTC)", "note"):
        table.add_column(head, justify="left" if head in ("outcome", "ending", "note") else "right")
    for trial in found:
        corrected = "*" if trial.corrections else ""
        table.add_row(
            f"{trial.id}{corrected}",
            trial.experiment,
            *(f"{trial.design[name]:g}" if name in trial.design else "-" for name in shown),
            "-" if trial.sample is None else str(trial.sample),
            trial.outcome,
            _seconds(trial.elapsed_time_s),
            trial.ending,
            (trial.started_utc or "-").removesuffix("+00:00").replace("T", " "),
            trial.note or (trial.source or ""),
        )
    console.print(table)
    counted = [trial for trial in found if trial.counts]
    passed = sum(trial.outcome == "passed" for trial in counted)
    aborted = len(found) - len(counted)
    console.print(f"{len(found)} trials, {passed} of {len(counted)} passed, {aborted} aborted", markup=False)


def _varying(found: "list[Trial]") -> list[str]:
    """The design parameters in which the trials differ; width if they do not."""
    names = dict.fromkeys(name for trial in found for name in trial.design)
    return [name for name in names if len({trial.design.get(name) for trial in found}) > 1] or list(names)[:1]


def _correction_text(one: "Correction") -> str:
    by = f" by {one.operator}" if one.operator else ""
    return (
        f"* trial {one.trial}: {one.field} {_quoted(one.before)} -> {_quoted(one.after)} "
        f"on {one.corrected_utc[:10]}{by}: {one.reason}"
    )


def _quoted(value: object) -> str:
    return '"' + value + '"' if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else "none"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
