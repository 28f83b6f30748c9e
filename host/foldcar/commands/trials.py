"""`foldcar trials` lists a store's trials, simulates them again, corrects and imports them."""

import contextlib
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import (
    Components,
    Json,
    OneExperiment,
    OutputFolder,
    Picture,
    Port,
    SimulatedTrials,
    TrialNumber,
    TrialStore,
    print_lines,
    print_note,
    print_result,
)
from foldcar.commands.trial_changes import correct, measure, restore, withdraw
from foldcar.errors import FoldcarError
from foldcar.shown_text import shown_line

if TYPE_CHECKING:
    from foldcar.link.log_features import LogFeatures

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
        # The names of the parameters that vary in each experiment.
        infos = reader.info().experiments.values() if reader.holds_study() else ()
        varied_of = {info.listed_id: list(info.varied) for info in infos}
        trials_of_store = list(reader.trials(experiment))
        if experiment is not None and not trials_of_store:
            known_text = ", ".join(dict.fromkeys(trial.experiment for trial in reader.trials())) or "none"
            raise FoldcarError(
                f'{store}: has no trials of experiment "{experiment}"; experiments with trials: {known_text}'
            )
        trial_ids = {trial.id for trial in trials_of_store}
        corrections = [correction for correction in reader.corrections() if correction.trial in trial_ids]
        all_media = [media for media in reader.media() if media.trial in trial_ids]
    media_rows = []
    lines = [correction_text(correction) for correction in corrections]
    for media in all_media:
        is_missing = not referred_file(store, media.file).is_file()
        media_rows.append({**asdict(media), "missing": is_missing})
        missing_text = " (missing)" if is_missing else ""
        lines.append(f"trial {media.trial}: {media.kind} {shown_line(media.file)}{missing_text}")
    if not as_json:
        print_trials(trials_of_store, varied_of)
    result = {
        "trials": [asdict(trial) for trial in trials_of_store],
        "corrections": [asdict(correction) for correction in corrections],
        "media": media_rows,
    }
    print_result(as_json, result, *lines)


@trials.command("erase-logs")
def erase_car_logs(
    store: TrialStore,
    port: Port = None,
    yes: Annotated[bool, typer.Option("--yes", help="Erase without asking.")] = False,
) -> None:
    """List the logs of untethered trials in a car on USB, and erase them if STORE has all of them.

    If a log is not in STORE, nothing is erased.

    \b
    Example: foldcar trials erase-logs study.db
    """
    from foldcar.link.car import greeted
    from foldcar.link.stream import LinkLostError, choose_port
    from foldcar.trials.erasing import erase_stored_logs
    from foldcar.trials.person import PersonAnswers

    with greeted(choose_port(port)) as car:

        def keep_link_alive() -> None:
            """Receive the car's messages while the person types."""
            with contextlib.suppress(LinkLostError):
                car.connection.receive(0.0)

        erase_stored_logs(car, store, None if yes else PersonAnswers(keep_link_alive))


@trials.command()
def replay(
    store: TrialStore,
    number: TrialNumber,
    plot: Picture = None,
    simulated_trials: SimulatedTrials = False,
) -> None:
    """Simulate a trial's design in the trial's scene.

    Car and obstacles stand where they were measured. The command compares trial and simulation and summarises the
    trial's log. The picture shows the simulated run.

    \b
    Example: foldcar trials replay study.db 7 --plot run.png
    """
    from foldcar.commands.listed_run import RunInput
    from foldcar.commands.tables import STANDING_TEXTS, seconds_text
    from foldcar.link.log_features import log_features
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import engine_of
    from foldcar.simulation.heights import carsim_heights
    from foldcar.simulation.results import outcome_of
    from foldcar.simulation.runner import PATH_INTERVAL_S
    from foldcar.store.log_files import intact_log
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import BUILT, SIMULATED

    with Store.open(store) as reader:
        trial, drive, is_dynamic = reader.trial(number), reader.trial_drive(number), reader.is_dynamic_trial(number)
        infos = list(reader.info().experiments.values()) if reader.holds_study() else []
    if drive is None:
        raise FoldcarError(f"{store}: trial {number} was imported without a scene and cannot be simulated")
    # The experiment may have been swept with several engines. Its own name is that of the sweep with the default engine.
    swept = [info for info in infos if info.listed_id == trial.experiment and info.under is None]
    preferred = min(swept, key=lambda info: info.id != trial.experiment, default=None)
    engine = "" if preferred is None else preferred.engine
    carsim = Carsim(engine=engine_of(engine))
    cars_vary = any(info.variation for info in swept)
    body, settings, scene = map(json.loads, drive)
    answer = RunInput(f"trial {number}", body, scene, settings, 0).simulate(carsim, path_interval_s=PATH_INTERVAL_S)
    outcome, simulated_s = outcome_of(answer), answer.get("elapsed_time_s")
    if not trial.completed:
        verdict = "not compared: the trial was aborted"
    elif is_dynamic:
        verdict = "not compared: the trial's program runs during the simulation, and this simulation leaves it out"
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
                _print_damage(log)
        except FoldcarError as error:
            print_note(f"{error}")
    mark = "" if trial.standing == BUILT else f"  ({STANDING_TEXTS[trial.standing]})"
    lines = [
        f"{'':<10}{'outcome':<12}{'time (s)':>9}",
        f"{'trial':<10}{trial.outcome:<12}{seconds_text(trial.elapsed_time_s):>9}{mark}",
        f"{'simulated':<10}{outcome:<12}{seconds_text(simulated_s):>9}{f'  ({engine})' if engine else ''}",
        verdict,
        *(_log_lines(log_summary) if log_summary else ()),
    ]
    if cars_vary:
        lines.append(
            "The simulated car is exactly its design. `foldcar compare` simulates the car that the sweep has drawn for "
            "the sample, which differs from its design."
        )
    if plot is not None:
        from foldcar.figures.run import draw_run

        if "path" not in answer:
            raise FoldcarError(f"{plot}: a failed run has no picture")
        draw_run(body, scene, answer, answer["path"], carsim_heights(carsim), plot)
        lines.append(f"picture: {plot}")
    print_lines(*lines)


def _log_lines(log_summary: "LogFeatures") -> list[str]:
    """Return lines with the quantities that a log contains: tilt, change of heading, shocks, voltages."""
    from foldcar.statistics.words import signed

    lines = []
    values = {name: value for name, value in asdict(log_summary).items() if value is not None}
    if "tilt_error_rad" in values:
        roll, pitch = signed(math.degrees(values["max_roll_rad"]), 1), signed(math.degrees(values["max_pitch_rad"]), 1)
        tilt_error_deg = math.degrees(values["tilt_error_rad"])
        lines.append(f"log: largest roll {roll}°, pitch {pitch}° (±{tilt_error_deg:.1f}°)")
        turn = signed(math.degrees(values["heading_change_rad"]), 1)
        heading_error_deg = math.degrees(values["heading_error_rad"])
        lines.append(f"log: heading changed by {turn}° (±{heading_error_deg:.1f}°)")
    if log_summary.shocks_s:
        lines.append(f"log: shocks at {', '.join(f'{time_s:.1f}' for time_s in log_summary.shocks_s)} s")
    if log_summary.servo_battery_v is not None:
        lines.append(f"log: servos' battery {log_summary.servo_battery_v:.2f} V while driving")
    if log_summary.battery_sag_v is not None:
        lines.append(f"log: battery voltage dropped by up to {log_summary.battery_sag_v:.2f} V while driving")
    return lines


for _command in (correct, withdraw, restore, measure):
    trials.command()(_command)


@trials.command("import")
def import_file(
    store: TrialStore,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV or Parquet file of trials (see docs/trials.md), or another store.")
    ],
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Experiment of rows without one.")] = None,
    components: Components = None,
) -> None:
    """Import trials from a CSV or Parquet file, or take them from another store.

    If a row is wrong, no trial is imported. Rows that were imported before are skipped. docs/trials.md lists the columns.

    Another store may be of an earlier version of foldcar. Its trials come with their logs, corrections, photos, films and
    measured values.

    \b
    Example: foldcar trials import study.db scenarios/published_trials.csv
             foldcar trials import new.db old.db
    """
    from foldcar.outputs import is_database

    if is_database(file):
        from foldcar.store.check import damaged_logs
        from foldcar.store.trial_import import take_trials

        if experiment is not None:
            raise FoldcarError("trials import: --experiment: has no effect on the trials of a store; leave it out")
        taken = take_trials(store, file)
        for damage in damaged_logs(store):
            print_note(f"{store}: {damage}")
        print_lines(_imported_text(taken.new, taken.known, store))
        return
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.csv_import import import_notes, read_trials, swept_experiments

    rows = read_trials(file, experiment, swept_experiments(store), print_note)
    with write_trials(store) as writer:
        imported = writer.import_trials(rows)
    for text in import_notes(store, rows):
        print_note(text)
    print_lines(_imported_text(imported, len(rows) - len(imported), store))


def _imported_text(imported: list[int], known: int, store: Path) -> str:
    """Return a line with the numbers of the imported trials, and how many were ``known`` before."""
    from foldcar.statistics.words import count

    text = f"{count(len(imported), 'trial')} imported"
    if imported:
        text += f", {imported[0]}"
    if len(imported) > 1:
        text += f" to {imported[-1]}"
    if known:
        verb = "was" if known == 1 else "were"
        text += f"; {known} {verb} imported before"
    return f"{text}; store: {store}"


def _print_damage(log: Path) -> None:
    """Print a note that says how much of a log is damaged, if it is."""
    from foldcar.link.tlog import log_damage

    if damage := log_damage(log):
        print_note(damage)


@trials.command()
def dialect(output: OutputFolder) -> None:
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
    print_lines(file)
