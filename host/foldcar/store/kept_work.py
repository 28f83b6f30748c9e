"""Work that could not be written to its store, kept as JSON in a file beside it until `foldcar import` takes it in.

Input: the end of a driven trial, or a calibration. Output: a file in the store's folder, else in that of temporary files;
if neither takes it, its text on standard error. Nothing here needs the store.
"""

import json
import math
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.outputs import atomic_file
from foldcar.store.calibrations import Calibration, write_calibrations
from foldcar.store.opening import require_store
from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import TrialWriter, now_utc, write_trials

TRIAL, CALIBRATION = "foldcar_kept_trial", "foldcar_kept_calibration"


def keep_trial(store: Path, number: int, log: str, ending: Ending) -> str:
    """Keep the end of a begun trial; gives the sentence that says where it is, and which command takes it in."""
    content = {TRIAL: number, "log": log, "ended_utc": now_utc(), "ending": asdict(ending)}
    return _keep(store, kept_trial(store, number).name, f"trial {number}", content)


def keep_calibration(store: Path, calibration: Calibration, replace: bool) -> str:
    """Keep a calibration; gives the sentence of :func:`keep_trial`."""
    content = {CALIBRATION: asdict(calibration), "replace": replace}
    return _keep(store, f"{store.name}.calibration-{calibration.name}.json", "the calibration", content)


def kept_trial(store: Path, number: int) -> Path:
    """Where the end of that trial is, if it is kept."""
    return store.with_name(f"{store.name}.trial-{number}.json")


def take_in(file: Path, store: Path) -> str:
    """Write what is kept in ``file`` to its store and delete the file; gives what it was. FoldcarError."""
    content = _read(file)
    require_store(store)
    if TRIAL in content:
        with write_trials(store) as writer:
            done = take_in_trial(writer, file)
    else:
        calibration, replace = _calibration(file, content)
        with write_calibrations(store) as calibrations:
            calibrations.put(calibration, replace)
        done = f'calibration "{calibration.name}"'
        file.unlink(missing_ok=True)
    return done


def take_in_trial(writer: TrialWriter, file: Path) -> str:
    """:func:`take_in` of a trial's end, for a store that is being written."""
    number, log, ended_utc, ending = _trial(file, _read(file))
    writer.complete_later(number, log, ending, ended_utc)
    file.unlink(missing_ok=True)
    return f"trial {number}: {ending.outcome}"


def _keep(store: Path, name: str, what: str, content: dict[str, Any]) -> str:
    text = json.dumps(content, indent=1)
    for folder in (store.parent, Path(tempfile.gettempdir())):
        file = folder / name
        try:
            with atomic_file(file) as binary:
                binary.write(f"{text}\n".encode())
        except FoldcarError:
            continue
        return f"{what} is kept in {file}: `foldcar import {file} --store {store}` takes it in"
    return (
        f"{what} cannot be kept in a file either. Save the following text in one; "
        f"`foldcar import FILE --store {store}` takes it in:\n{text}"
    )


def _read(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"), parse_constant=_no_number)
    except OSError as error:
        raise FoldcarError(f"{file}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict) or (TRIAL in content) == (CALIBRATION in content):
        raise FoldcarError(f"{file}: is neither an exported folder nor work that foldcar kept beside a store")
    return content


def _no_number(text: str) -> None:
    raise ValueError(f"{text} is no number")


def _trial(file: Path, content: dict[str, Any]) -> tuple[int, str, str, Ending]:
    match content:
        case {
            "foldcar_kept_trial": int(number),
            "log": str(log),
            "ended_utc": str(ended_utc),
            "ending": {
                "outcome": str(outcome),
                "ending": str(ending),
                "elapsed_time_s": (None | float() | int()) as elapsed_s,
                "note": str(note),
                "log_sha256": (None | str()) as digest,
            },
        } if elapsed_s is None or math.isfinite(elapsed_s):
            return number, log, ended_utc, Ending(outcome, ending, elapsed_s, note, digest)
    raise FoldcarError(f"{file}: is damaged: it is not the end of a trial that foldcar kept")


def _calibration(file: Path, content: dict[str, Any]) -> tuple[Calibration, bool]:
    match content:
        case {
            "foldcar_kept_calibration": {
                "name": str(name),
                "experiment": str(experiment),
                "build": str(build),
                "created_utc": str(created_utc),
                "draws": [dict(), *_] as draws,
                "summary": dict(summary),
            },
            "replace": bool(replace),
        } if all(isinstance(draw, dict) for draw in draws):
            return Calibration(name, experiment, build, created_utc, tuple(draws), summary), replace
    raise FoldcarError(f"{file}: is damaged: it is not a calibration that foldcar kept")
