"""`foldcar trials` lists a store's trials, simulates them again, corrects, imports and exports them."""

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
    list[int], typer.Argument(metavar="TRIAL...", min=1, help="Numbers of trials (see `trials list`).")
]
Reason = Annotated[str, typer.Option(metavar="TEXT", help="Reason, stored with the change.")]
Operator = Annotated[str, typer.Option(metavar="NAME", help="Your name, stored with the change.")]

trials = typer.Typer(
    name="trials",
    help="List, correct and replay trials of cars.\n\n\b\nExample: foldcar trials list study.db",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@trials.command("list")
def list_trials(store: TrialStore, experiment: OneExperiment = None, as_json: Json = False) -> None:
    """List trials with their corrections, photos and films.

    \b
    Example: foldcar trials list study.db --experiment 1
    """
    from foldcar.commands.tables import correction_text, print_trials
    from foldcar.store.log_files import referred_file
    from foldcar.store.reader import Store

    with Store.open(store) as reader:
        rows = list(reader.trials(experiment))
        if experiment is not None and not rows:
            known_text = ", ".join(dict.fromkeys(trial.experiment for trial in reader.trials())) or "none"
            raise FoldcarError(
                f'{store}: has no trials of experiment "{experiment}"; experiments with trials: {known_text}'
            )
        corrected_ids = {trial.id for trial in rows if trial.corrections}
        corrections = [correction for correction in reader.corrections() if correction.trial in corrected_ids]
        trial_ids = {trial.id for trial in rows}
        media = [(item, referred_file(store, item.file).is_file()) for item in reader.media() if item.trial in trial_ids]
    if not as_json:
        print_trials(rows)
    result = {
        "trials": [asdict(item) for item in rows],
        "corrections": [asdict(item) for item in corrections],
        "media": [{**asdict(item), "missing": not exists} for item, exists in media],
    }
    files = [f"trial {item.trial}: {item.kind} {item.file}{'' if exists else ' (missing)'}" for item, exists in media]
    print_result(as_json, result, *map(correction_text, corrections), *files)


@trials.command()
def replay(
    store: TrialStore,
    number: TrialNumber,
    plot: Picture = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Simulate a trial's design in the trial's scene.

    Car and obstacles stand where they were measured. The command compares trial and simulation and summarises the
    trial's log. The picture shows the simulated run.

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
    with Store.open(store) as reader:
        trial, drive = reader.trial(number), reader.trial_drive(number)
    if drive is None:
        raise FoldcarError(f"{store}: trial {number} was imported without a scene and cannot be simulated")
    # The dynamic parts of a Scenic program are not simulated.
    body, settings, scene = map(json.loads, drive)
    answer = SimulatedRun(f"trial {number}", body, scene, settings, 0).simulate(carsim, path_interval_s=PATH_INTERVAL_S)
    outcome, simulated_s = outcome_of(answer), answer.get("elapsed_time_s")
    agrees = None
    if not trial.completed:
        verdict = "not compared: the trial was aborted"
    elif trial.standing == BUILT or (simulated_trials and trial.standing == SIMULATED):
        agrees = (trial.outcome == "passed") == (outcome == "passed")
        verdict = "trial and simulation agree" if agrees else "trial and simulation disagree"
    else:
        verdict = f"not compared: {STANDING_TEXTS[trial.standing]}"
    log_summary = None
    if trial.log is not None:
        try:
            log = intact_log(store, number, trial.log, trial.log_sha256)
            if log is not None:
                log_summary = log_features(log)
                _note_damage(log)
        except FoldcarError as error:
            print_note(f"{error}")
    mark = "" if trial.standing == BUILT else f"  ({STANDING_TEXTS[trial.standing]})"
    lines = [
        f"{'':<10}{'outcome':<12}{'time (s)':>9}",
        f"{'trial':<10}{trial.outcome:<12}{seconds_text(trial.elapsed_time_s):>9}{mark}",
        f"{'simulated':<10}{outcome:<12}{seconds_text(simulated_s):>9}",
        verdict,
        *(_log_lines(log_summary) if log_summary else ()),
    ]
    if plot is not None:
        from foldcar.figures.run import draw_run

        if "path" not in answer:
            raise FoldcarError(f"{plot}: a failed run has no picture")
        draw_run(body, scene, answer, answer["path"], carsim_heights(carsim), plot)
        lines.append(f"picture: {plot}")
    simulated = {"outcome": outcome, "elapsed_time_s": simulated_s, "message": answer.get("error")}
    result = {"trial": asdict(trial), "simulated": simulated, "agrees": agrees, "picture": plot}
    print_result(as_json, {**result, "log": log_summary and asdict(log_summary)}, *lines)


def _log_lines(log_summary: "LogFeatures") -> list[str]:
    """Return a line for each quantity that the log contains."""
    lines = []
    values = {name: value for name, value in asdict(log_summary).items() if value is not None}
    if "tilt_error_rad" in values:
        roll, pitch, error, turn, turn_error = (
            math.degrees(values[f"{name}_rad"])
            for name in ("max_roll", "max_pitch", "tilt_error", "heading_change", "heading_error")
        )
        lines.append(f"log: largest roll {roll:+.1f}°, pitch {pitch:+.1f}° (±{error:.1f}°)")
        lines.append(f"log: heading changed by {turn:+.1f}° (±{turn_error:.1f}°)")
    if log_summary.shocks_s:
        lines.append(f"log: shocks at {', '.join(f'{time_s:.1f}' for time_s in log_summary.shocks_s)} s")
    if log_summary.servo_battery_v is not None:
        lines.append(f"log: servos' battery {log_summary.servo_battery_v:.2f} V while driving")
    if log_summary.battery_sag_v is not None:
        lines.append(f"log: battery voltage dropped by up to {log_summary.battery_sag_v:.2f} V while driving")
    return lines


@trials.command()
def correct(
    store: TrialStore,
    number: TrialNumber,
    reason: Reason,
    outcome: Annotated[str | None, typer.Option(metavar="OUTCOME", help="Correct outcome.")] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="New note.")] = None,
    elapsed_time: Annotated[float | None, typer.Option(metavar="S", min=0, help="Correct driving time (s).")] = None,
    car: Annotated[
        str | None, typer.Option(metavar="CAR", help="built or simulated; only if the car did not report it.")
    ] = None,
    car_name: Annotated[str | None, typer.Option(metavar="NAME", help="Name of the built car.")] = None,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Correct a trial's data.

    The store keeps the old values and the reason.

    \b
    Example: foldcar trials correct study.db 7 --outcome tipped --reason "seen on the film"
    """
    from foldcar.store.trial_records import checked_name

    outcome, car = (None if word is None else word.lower() for word in (outcome, car))
    name = None if car_name is None else checked_name(car_name, "--car-name")
    new_values = {"outcome": outcome, "note": note, "elapsed_time_s": elapsed_time, "car": car, "car_name": name}
    changes = {name: value for name, value in new_values.items() if value is not None}
    if not changes:
        raise FoldcarError(
            "trials correct: nothing to change; use --outcome, --note, --elapsed-time, --car or --car-name"
        )
    _change("correct", store, reason, as_json, lambda writer: writer.correct(number, changes, reason, operator))


@trials.command()
def withdraw(
    store: TrialStore, numbers: TrialNumbers, reason: Reason, operator: Operator = "", as_json: Json = False
) -> None:
    """Exclude trials from all rates.

    Withdraw practice drives, for example. The store keeps withdrawn trials and their logs.

    \b
    Example: foldcar trials withdraw study.db 7 8 --reason practice
    """
    chosen = dict.fromkeys(numbers)
    _change("withdraw", store, reason, as_json, lambda writer: writer.withdraw(chosen, True, reason, operator))


@trials.command()
def restore(
    store: TrialStore, numbers: TrialNumbers, reason: Reason, operator: Operator = "", as_json: Json = False
) -> None:
    """Make withdrawn trials count again.

    The store keeps both changes with their reasons.

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
        typer.Argument(
            metavar="NAME=VALUE...", help="Measured values; NAME= deletes a value. Default: show the stored values."
        ),
    ] = None,
    experiment: OneExperiment = None,
    as_json: Json = False,
) -> None:
    """Store measurements of built cars and obstacles.

    `foldcar calibrate` uses these values as known. obstacle_height is the ratio of real to planned obstacle height.
    com_height_m is how much higher the centre of mass is than in the design, track_m how much wider the track is.

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
                raise FoldcarError(f"trials measure: {name}: is given twice; give each parameter once")
            changes[name] = value
    with Store.open(store) as reader:
        experiment_id = experiment_to_measure(reader, experiment)
    if changes:
        with write_calibrations(store) as writer:
            writer.measure(experiment_id, changes)
    with Store.open(store) as reader:
        measured = measured_values(reader, experiment_id)
    units = {parameter.name: parameter.unit for parameter in PARAMETERS}
    lines = [f"experiment {experiment_id}: {name} {value:g} {units[name]}" for name, value in measured.items()]
    print_result(
        as_json,
        {"experiment": experiment_id, "measured": measured},
        *(lines or [f"experiment {experiment_id}: no measured values"]),
    )


def _change(
    command: str, store: Path, reason: str, as_json: bool, change: "Callable[[TrialWriter], list[Correction]]"
) -> None:
    """Change trials of an existing store and print the corrections. Raises FoldcarError."""
    from foldcar.commands.tables import correction_text
    from foldcar.store.connection import require_store
    from foldcar.store.trial_writer import write_trials

    if not reason.strip():
        raise FoldcarError(f"trials {command}: --reason: is empty")
    require_store(store)
    with write_trials(store) as writer:
        corrections = change(writer)
    print_result(
        as_json, {"corrections": [asdict(correction) for correction in corrections]}, *map(correction_text, corrections)
    )


@trials.command("import")
def import_file(
    store: TrialStore,
    file: Annotated[Path, typer.Argument(metavar="CSV", help="CSV file of trials (see docs/trials.md).")],
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Experiment of rows without one.")] = None,
    as_json: Json = False,
) -> None:
    """Import trials from a CSV file.

    If a row is wrong, no trial is imported. Rows that were imported before are skipped. docs/trials.md lists the columns.

    \b
    Example: foldcar trials import study.db scenarios/published_trials.csv
    """
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.csv_import import import_notes, read_trials, swept_experiments

    rows = read_trials(file, experiment, swept_experiments(store), print_note)
    with write_trials(store) as writer:
        imported = writer.import_trials(rows)
    for text in import_notes(store, rows):
        print_note(text)
    repeated = len(rows) - len(imported)
    range_text = f", {imported[0]} to {imported[-1]}" if imported else ""
    known_text = f"; {repeated} were imported before" if repeated else ""
    line = f"{len(imported)} trials imported{range_text}{known_text}; store: {store}"
    print_result(as_json, {"store": store, "imported": imported, "known": repeated}, line)


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

    The log itself is a .tlog file, which MAVLink tools can open.

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

    with Store.open(store) as reader:
        trial, drive, filmed_track = reader.trial(number), reader.trial_drive(number), reader.track(number)
    if trial.log is None:
        raise FoldcarError(f"{store}: trial {number} was imported and has no log")
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
    count = export_mcap(log, mcap, facts, scene_update, start, filmed_track.rows if filmed_track else ())
    _note_damage(log)
    print_result(as_json, {"files": [mcap], "messages": count}, f"{mcap}: {count} messages")


def _note_damage(log: Path) -> None:
    from foldcar.link.tlog import log_damage

    if damage := log_damage(log):
        print_note(damage)


@trials.command()
def dialect(output: OutputFolder, as_json: Json = False) -> None:
    """Write foldcar's MAVLink dialect as XML.

    Other programs need the file, DIR/v1.0/foldcar.xml, to decode foldcar's own messages.

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
