"""Work that could not be written to its store, kept as JSON in a file beside it until `foldcar import` takes it in.

Input: the end of a driven trial, or a calibration. Output: a file in the store's folder, else in that of temporary files;
if neither takes it, its text on standard error. Nothing here needs the store.
"""

import json
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from foldcar.errors import FoldcarError
from foldcar.outputs import atomic_file
from foldcar.store.calibrations import Calibration, write_calibrations
from foldcar.store.opening import require_store
from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import TrialWriter, now_utc, write_trials


@dataclass(frozen=True)
class KeptTrial:
    """The end of a begun trial: its number, log, and when it ended."""

    foldcar_kept_trial: int
    log: str
    ended_utc: str
    ending: Ending


@dataclass(frozen=True)
class KeptCalibration:
    """A calibration, and whether it replaces the one of its name."""

    foldcar_kept_calibration: Calibration
    replace: bool


_KEPT: "TypeAdapter[KeptTrial | KeptCalibration]" = TypeAdapter(KeptTrial | KeptCalibration)


def keep_trial(store: Path, number: int, log: str, ending: Ending) -> str:
    """Keep the end of a begun trial; gives the sentence that says where it is, and which command takes it in."""
    return _keep(store, kept_trial(store, number).name, f"trial {number}", KeptTrial(number, log, now_utc(), ending))


def keep_calibration(store: Path, calibration: Calibration, replace: bool) -> str:
    """Keep a calibration; gives the sentence of :func:`keep_trial`."""
    name = f"{store.name}.calibration-{calibration.name}.json"
    return _keep(store, name, "the calibration", KeptCalibration(calibration, replace))


def kept_trial(store: Path, number: int) -> Path:
    """Where the end of that trial is, if it is kept."""
    return store.with_name(f"{store.name}.trial-{number}.json")


def take_in(file: Path, store: Path) -> str:
    """Write what is kept in ``file`` to its store and delete the file; gives what it was. FoldcarError."""
    kept = _read(file)
    require_store(store)
    if isinstance(kept, KeptTrial):
        with write_trials(store) as writer:
            return take_in_trial(writer, file)
    with write_calibrations(store) as calibrations:
        calibrations.put(kept.foldcar_kept_calibration, kept.replace)
    file.unlink(missing_ok=True)
    return f'calibration "{kept.foldcar_kept_calibration.name}"'


def take_in_trial(writer: TrialWriter, file: Path) -> str:
    """:func:`take_in` of a trial's end, for a store that is being written."""
    kept = _read(file)
    if not isinstance(kept, KeptTrial):
        raise FoldcarError(f"{file}: is not the end of a trial")
    writer.complete_later(kept.foldcar_kept_trial, kept.log, kept.ending, kept.ended_utc)
    file.unlink(missing_ok=True)
    return f"trial {kept.foldcar_kept_trial}: {kept.ending.outcome}"


def _keep(store: Path, name: str, what: str, content: KeptTrial | KeptCalibration) -> str:
    text = json.dumps(asdict(content), indent=1)
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


def _read(file: Path) -> KeptTrial | KeptCalibration:
    try:
        return _KEPT.validate_json(file.read_bytes())
    except OSError as error:
        raise FoldcarError(f"{file}: cannot be read: {error.strerror or error}") from error
    except ValidationError:
        raise FoldcarError(f"{file}: is neither an exported folder nor work that foldcar kept beside a store") from None
