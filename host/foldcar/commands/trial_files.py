"""`foldcar trials import`, `export` and `dialect`: trials from CSV, logs as MCAP, the messages for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, Number, StoreFile, output_file, output_folder, print_json
from foldcar.errors import FoldcarError


def import_file(
    store: StoreFile,
    file: Annotated[Path, typer.Argument(metavar="CSV", help="Trials as docs/trials.md describes them.")],
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="The experiment of rows that name none.")] = None,
    as_json: Json = False,
) -> None:
    """Take over trials from a CSV file.

    All of them or none; docs/trials.md has the columns.

    \b
    Example: foldcar trials import study.db scenarios/published_trials.csv
    """
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.csv_import import import_notes, read_trials, swept_experiments

    def say(note: str) -> None:
        typer.echo(f"note: {note}", err=True)

    found = read_trials(file, experiment, swept_experiments(store), say)
    with write_trials(store) as writer:
        for source in dict.fromkeys(trial["source"] for trial in found):
            if writer.source_is_there(source):
                raise FoldcarError(f'{file}: source: trials of "{source}" are in {store} already')
        numbers = writer.import_trials(found)
    for note in import_notes(store, found):
        say(note)
    if as_json:
        print_json({"store": store, "imported": list(numbers)})
    else:
        typer.echo(f"{len(numbers)} trials imported, {numbers[0]} to {numbers[-1]}; store: {store}")


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
    from foldcar.models.ground import smooth_ground, start_height_m
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.heights import carsim_heights
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
        grid = smooth_ground(scene, carsim_heights(Carsim()))
        scene_update = foxglove_scene(body, scene, grid)
        start = {**scene["start"], "z_m": start_height_m(body, scene, grid)}
    count = export_mcap(log, mcap, facts, scene_update, start)
    if as_json:
        print_json({"files": [mcap], "messages": count})
    else:
        typer.echo(f"{mcap}: {count} messages")


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
