"""`foldcar trials`: a store's trials - listed, simulated again as pairs, changed, imported, exported."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import (
    Json,
    OneExperiment,
    OutputFolder,
    Picture,
    SimulatedTrials,
    TrialNumber,
    TrialStore,
    output_file,
    print_note,
    print_result,
)
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.link.log_features import LogFeatures
    from foldcar.store.trial_records import Correction
    from foldcar.store.trial_writer import TrialWriter

TrialNumbers = Annotated[
    list[int], typer.Argument(metavar="TRIAL...", min=1, help="Numbers of trials, as `trials list` shows them.")
]
Reason = Annotated[str, typer.Option(metavar="TEXT", help="Why; it is kept with the change.")]
Operator = Annotated[str, typer.Option(metavar="NAME", help="Who changes it; kept with the change.")]

trials = typer.Typer(
    name="trials", help="List, correct and replay trials of cars.", no_args_is_help=True, rich_markup_mode=None
)


@trials.command("list")
def list_trials(store: TrialStore, experiment: OneExperiment = None, as_json: Json = False) -> None:
    """Show trials, one a line, their corrections, photos and films.

    \b
    Example: foldcar trials list study.db --experiment 1
    """
    from foldcar.commands.tables import correction_text, print_trials
    from foldcar.store.log_files import referred_file
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        found = list(opened.trials(experiment))
        if experiment is not None and not found:
            known = ", ".join(dict.fromkeys(trial.experiment for trial in opened.trials())) or "none"
            raise FoldcarError(f'{store}: has no trials of experiment "{experiment}"; experiments with trials: {known}')
        corrected = {trial.id for trial in found if trial.corrections}
        trail = [correction for correction in opened.corrections() if correction.trial in corrected]
        numbers = {trial.id for trial in found}
        media = [(one, referred_file(store, one.file).is_file()) for one in opened.media() if one.trial in numbers]
    if not as_json:
        print_trials(found)
    result = {
        "trials": [asdict(one) for one in found],
        "corrections": [asdict(one) for one in trail],
        "media": [{**asdict(one), "missing": not there} for one, there in media],
    }
    files = [f"trial {one.trial}: {one.kind} {one.file}{'' if there else ' (missing)'}" for one, there in media]
    print_result(as_json, result, *map(correction_text, trail), *files)


@trials.command()
def replay(
    store: TrialStore,
    number: TrialNumber,
    plot: Picture = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Simulate a trial again as it was placed.

    Trial and simulation are compared; what the log tells of the drive is shown; the picture shows the simulated run.

    \b
    Example: foldcar trials replay study.db 7 --plot pair.png
    """
    from foldcar.commands.listed_run import SimulatedRun
    from foldcar.commands.tables import STANDING_TEXTS, seconds_text
    from foldcar.link.log_features import log_features
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.heights import carsim_heights
    from foldcar.simulation.results import outcome_of
    from foldcar.simulation.runner import PATH_INTERVAL_S
    from foldcar.store.log_files import intact_log
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import BUILT, SIMULATED

    carsim = Carsim()
    with Store.open(store) as opened:
        trial, drive = opened.trial(number), opened.trial_drive(number)
    if drive is None:
        raise FoldcarError(f"{store}: trial {number} was imported without a scene and cannot be simulated")
    # The dynamic parts of a Scenic program are not simulated.
    body, settings, scene = map(json.loads, drive)
    answer = SimulatedRun(f"trial {number}", body, scene, settings, 0).by(carsim, path_interval_s=PATH_INTERVAL_S)
    outcome, simulated_s = outcome_of(answer), answer.get("elapsed_time_s")
    agrees = None
    if not trial.completed:
        verdict = "the trial was aborted: nothing to compare"
    elif trial.standing == BUILT or (simulated_trials and trial.standing == SIMULATED):
        agrees = (trial.outcome == "passed") == (outcome == "passed")
        verdict = "both agree" if agrees else "they disagree"
    else:
        verdict = f"not compared: {STANDING_TEXTS[trial.standing]}"
    felt = None
    if trial.log is not None:
        try:
            log = intact_log(store, number, trial.log, trial.log_sha256)
            if log is not None:
                felt = log_features(log)
                _note_damage(log)
        except FoldcarError as error:
            print_note(f"{error}")
    mark = "" if trial.standing == BUILT else f"  ({STANDING_TEXTS[trial.standing]})"
    lines = [
        f"{'':<10}{'outcome':<12}{'time (s)':>9}",
        f"{'trial':<10}{trial.outcome:<12}{seconds_text(trial.elapsed_time_s):>9}{mark}",
        f"{'simulated':<10}{outcome:<12}{seconds_text(simulated_s):>9}",
        verdict,
        *(_felt_lines(felt) if felt else ()),
    ]
    if plot is not None:
        from foldcar.figures.run import draw_run

        if "path" not in answer:
            raise FoldcarError(f"{plot}: a failed run has no picture")
        draw_run(body, scene, answer, answer["path"], carsim_heights(carsim), plot)
        lines.append(f"picture: {plot}")
    simulated = {"outcome": outcome, "elapsed_time_s": simulated_s, "message": answer.get("error")}
    result = {"trial": asdict(trial), "simulated": simulated, "agrees": agrees, "picture": plot}
    print_result(as_json, {**result, "log": felt and asdict(felt)}, *lines)


def _felt_lines(felt: "LogFeatures") -> list[str]:
    """What a log tells, in a line for each thing that it knows."""
    lines = []
    known = {name: value for name, value in asdict(felt).items() if value is not None}
    if "tilt_error_rad" in known:
        roll, pitch, error, turn, turn_error = (
            math.degrees(known[f"{name}_rad"])
            for name in ("max_roll", "max_pitch", "tilt_error", "heading_change", "heading_error")
        )
        lines.append(f"log: largest roll {roll:+.1f}°, pitch {pitch:+.1f}° (±{error:.1f}°)")
        lines.append(f"log: turned by {turn:+.1f}° (±{turn_error:.1f}°)")
    if felt.shocks_s:
        lines.append(f"log: shocks at {', '.join(f'{one:.1f}' for one in felt.shocks_s)} s")
    if felt.battery_sag_v is not None:
        lines.append(f"log: battery lower by {felt.battery_sag_v:.2f} V at most while driving")
    return lines


@trials.command()
def correct(
    store: TrialStore,
    number: TrialNumber,
    reason: Reason,
    outcome: Annotated[str | None, typer.Option(metavar="OUTCOME", help="The outcome it should have.")] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="The note it should have.")] = None,
    elapsed_time: Annotated[float | None, typer.Option(metavar="S", min=0, help="How long it drove, in seconds.")] = None,
    car: Annotated[
        str | None, typer.Option(metavar="CAR", help="What drove, built or simulated, if no car has said it itself.")
    ] = None,
    car_name: Annotated[str | None, typer.Option(metavar="NAME", help="Which built car of its design drove.")] = None,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Change what a trial says.

    What stood there is kept, with the reason.

    \b
    Example: foldcar trials correct study.db 7 --outcome tipped --reason "seen on the film"
    """
    from foldcar.store.trial_records import checked_name

    outcome, car = (None if word is None else word.lower() for word in (outcome, car))
    name = None if car_name is None else checked_name(car_name, "--car-name")
    given = {"outcome": outcome, "note": note, "elapsed_time_s": elapsed_time, "car": car, "car_name": name}
    changes = {name: value for name, value in given.items() if value is not None}
    if not changes:
        raise FoldcarError("trials correct: say what to change: --outcome, --note, --elapsed-time, --car or --car-name")
    _change("correct", store, reason, as_json, lambda writer: writer.correct(number, changes, reason, operator))


@trials.command()
def withdraw(
    store: TrialStore, numbers: TrialNumbers, reason: Reason, operator: Operator = "", as_json: Json = False
) -> None:
    """Withdraw trials, such as practice.

    They stay in the store with their logs, but count nowhere.

    \b
    Example: foldcar trials withdraw study.db 7 8 --reason practice
    """
    chosen = dict.fromkeys(numbers)
    _change("withdraw", store, reason, as_json, lambda writer: writer.withdraw(chosen, True, reason, operator))


@trials.command()
def restore(
    store: TrialStore, numbers: TrialNumbers, reason: Reason, operator: Operator = "", as_json: Json = False
) -> None:
    """Let withdrawn trials count again.

    Both changes are kept, with their reasons.

    \b
    Example: foldcar trials restore study.db 8 --reason "was no practice"
    """
    chosen = dict.fromkeys(numbers)
    _change("restore", store, reason, as_json, lambda writer: writer.withdraw(chosen, False, reason, operator))


@trials.command()
def measure(
    store: TrialStore,
    values: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME=VALUE...", help="Measured values; NAME= deletes a value. None: show what is kept."),
    ] = None,
    experiment: OneExperiment = None,
    as_json: Json = False,
) -> None:
    """Keep what was measured of built cars and obstacles.

    `foldcar calibrate` takes the values as known. obstacle_height is the height of obstacles relative to the planned one;
    com_height_m and track_m are what the centre of mass is higher, and the track wider, than drawn.

    \b
    Example: foldcar trials measure study.db obstacle_height=1.04 com_height_m=0.005 track_m=0.002
    """
    from foldcar.inference.calibration.observations import experiment_to_measure
    from foldcar.inference.calibration.parameters import NAMES, PARAMETERS, measured_value
    from foldcar.store.calibrations import measured_values, write_calibrations
    from foldcar.store.reader import Store

    names_to_delete = {text[:-1].strip() for text in values or () if text.endswith("=")}
    for name in names_to_delete - set(NAMES):
        raise FoldcarError(f"trials measure: {name}=: unknown parameter; known: {', '.join(NAMES)}")
    changes: dict[str, float | None] = dict.fromkeys(names_to_delete)
    for text in values or ():
        if not text.endswith("="):
            name, value = measured_value(text, "trials measure:")
            if name in changes:
                raise FoldcarError(f"trials measure: {name}: is given twice")
            changes[name] = value
    with Store.open(store) as opened:
        chosen = experiment_to_measure(opened, experiment)
    if changes:
        with write_calibrations(store) as writer:
            writer.measure(chosen, changes)
    with Store.open(store) as opened:
        kept = measured_values(opened, chosen)
    units = {parameter.name: parameter.unit for parameter in PARAMETERS}
    lines = [f"experiment {chosen}: {name} {value:g} {units[name]}" for name, value in kept.items()]
    print_result(
        as_json, {"experiment": chosen, "measured": kept}, *(lines or [f"experiment {chosen}: nothing was measured"])
    )


def _change(
    command: str, store: Path, reason: str, as_json: bool, change: "Callable[[TrialWriter], list[Correction]]"
) -> None:
    """Change trials of an existing store, and print the corrections that this made. FoldcarError."""
    from foldcar.commands.tables import correction_text
    from foldcar.store.connection import require_store
    from foldcar.store.trial_writer import write_trials

    if not reason.strip():
        raise FoldcarError(f"trials {command}: --reason: is empty")
    require_store(store)
    with write_trials(store) as writer:
        made = change(writer)
    print_result(as_json, {"corrections": [asdict(one) for one in made]}, *map(correction_text, made))


@trials.command("import")
def import_file(
    store: TrialStore,
    file: Annotated[Path, typer.Argument(metavar="CSV", help="Trials as docs/trials.md describes them.")],
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="The experiment of rows that name none.")] = None,
    as_json: Json = False,
) -> None:
    """Import trials from a CSV file.

    All of them or none; rows that were imported before are counted only. docs/trials.md has the columns.

    \b
    Example: foldcar trials import study.db scenarios/published_trials.csv
    """
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.csv_import import import_notes, read_trials, swept_experiments

    found = read_trials(file, experiment, swept_experiments(store), print_note)
    with write_trials(store) as writer:
        numbers = writer.import_trials(found)
    for one in import_notes(store, found):
        print_note(one)
    known = len(found) - len(numbers)
    range_text = f", {numbers[0]} to {numbers[-1]}" if numbers else ""
    known_text = f"; {known} were imported before" if known else ""
    line = f"{len(numbers)} trials imported{range_text}{known_text}; store: {store}"
    print_result(as_json, {"store": store, "imported": numbers, "known": known}, line)


@trials.command()
def export(
    store: TrialStore,
    number: TrialNumber,
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
    from foldcar.link.mcap_export import NO_START, export_mcap
    from foldcar.models.foxglove_scene import foxglove_scene
    from foldcar.models.ground import smooth_ground, start_height_m
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.heights import carsim_heights
    from foldcar.statistics.words import design_text
    from foldcar.store.log_files import intact_log, log_file
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        trial, drive, filmed = opened.trial(number), opened.trial_drive(number), opened.track(number)
    if trial.log is None:
        raise FoldcarError(f"{store}: trial {number} was imported: it has no log")
    facts = {
        "trial": str(trial.id),
        "experiment": trial.experiment,
        "design": design_text(trial.design),
        "sample": str(trial.sample),
        "outcome": trial.outcome,
        "note": trial.note,
        "car": trial.car or "unknown",
        "car_name": trial.car_name or "",
        "withdrawn": str(trial.withdrawn).lower(),
    }
    log = intact_log(store, number, trial.log, trial.log_sha256) or log_file(store, trial.log)
    scene_update, start = None, NO_START
    if drive is not None and log.is_file():
        body, scene = json.loads(drive[0]), json.loads(drive[2])
        grid = smooth_ground(scene, carsim_heights(Carsim()))
        scene_update = foxglove_scene(body, scene, grid)
        start = {**scene["start"], "z_m": start_height_m(body, scene, grid)}
    count = export_mcap(log, mcap, facts, scene_update, start, filmed.rows if filmed else ())
    _note_damage(log)
    print_result(as_json, {"files": [mcap], "messages": count}, f"{mcap}: {count} messages")


def _note_damage(log: Path) -> None:
    from foldcar.link.tlog import log_damage

    if damage := log_damage(log):
        print_note(damage)


@trials.command()
def dialect(output: OutputFolder, as_json: Json = False) -> None:
    """Write the MAVLink dialect as XML.

    With DIR/v1.0/foldcar.xml, other programs name foldcar's own messages too.

    \b
    Example: foldcar trials dialect -o dialect
    """
    from foldcar.link.dialect import DialectError, dialect_xml
    from foldcar.outputs import atomic_file, make_output_folder

    try:
        text = dialect_xml()
    except DialectError as error:
        raise FoldcarError(str(error)) from None
    make_output_folder(output)
    file = output / "v1.0" / "foldcar.xml"
    with atomic_file(file) as binary:
        binary.write(text.encode())
    print_result(as_json, {"files": [file]}, file)
