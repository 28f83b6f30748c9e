"""Writes trials to the results store: a row before the car moves, which is completed afterwards; and corrections.

Input: the inputs and the end of a trial. Output: rows of `trial` and `correction`, each in its own transaction, so that
a killed program loses at most the answer being typed.
"""

import contextlib
import json
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from foldcar.shown_text import decoded, with_line_feeds
from foldcar.store.connection import writing
from foldcar.store.errors import StoreError
from foldcar.store.log_files import reference, sha256_of
from foldcar.store.other_drives import LIMIT_OVERRUN_S
from foldcar.store.rows import Row
from foldcar.store.tables import BY_NAME, CORRECTION, MEDIA, SAMPLE, TRIAL
from foldcar.store.trial_import_writer import TrialImportWriter
from foldcar.store.trial_records import (
    BUILT,
    CARS,
    CORRECTABLE,
    LONGEST_S,
    MAX_ID,
    RUNNING,
    TRIAL_OUTCOMES,
    Correction,
    Ending,
    Media,
    TrialDesign,
)
from foldcar.store.writer import canonical_json


@dataclass(frozen=True, slots=True)
class Drive:
    """The inputs of a trial's simulation: objects of docs/carsim.md, the scene as built on the floor.

    ``scenic_program`` is the environment's program as the listing names it. ``dynamic`` is whether the program runs
    during the simulation, None if this is unknown.
    """

    body: Mapping[str, Any]
    settings: Mapping[str, Any]
    scene: Mapping[str, Any]
    environment_fingerprint: str
    scenic_program: str
    sample: int
    dynamic: bool | None = None


@dataclass(frozen=True, slots=True)
class CarFacts:
    """The identity of the car: the firmware's build and the design's hash, as the car reported them, and the port.

    ``car`` is one of CARS, None if the car did not report it; ``name`` is the built car's name, None without one.
    """

    firmware_build: str
    design_hash: str
    port: str
    car: str | None
    name: str | None = None


class TrialWriter(TrialImportWriter):
    """A store opened for trials. Create it with :func:`write_trials`; all methods raise StoreError."""

    def begin(
        self,
        experiment: str,
        design: TrialDesign,
        drive: Drive,
        deviations: Mapping[str, tuple[float, float, float]],
        car: CarFacts,
        log: str,
        operator: str,
    ) -> int:
        """Store a trial before the car moves, and return its number. It counts as aborted until :meth:`complete`."""
        with self._transaction():
            environment_id = self._identify("environment", "fingerprint", drive.environment_fingerprint)
            if drive.dynamic is not None:
                self._run("UPDATE environment SET dynamic = ? WHERE id = ?", int(drive.dynamic), environment_id)
            row = {
                "uuid": str(uuid.uuid4()),
                "experiment": experiment,
                "vehicle_type": design.vehicle_type,
                "design": json.dumps(dict(design.columns)),
                "body_id": self._put_text("body", canonical_json(drive.body)),
                "settings_id": self._put_text("settings", canonical_json(drive.settings)),
                "environment_id": environment_id,
                "sample": drive.sample,
                "scene_id": self._put_text("scene", canonical_json(drive.scene)),
                "deviations": canonical_json({name: list(deviation) for name, deviation in deviations.items()}),
                "outcome": "aborted",
                "ending": RUNNING,
                "note": "",
                "operator": with_line_feeds(operator),
                "started_utc": now_utc(),
                "firmware_build": car.firmware_build,
                "design_hash": car.design_hash,
                "port": car.port,
                "log": log,
                "car": car.car,
                "car_name": car.name,
                "withdrawn": 0,
                "scenic_program": drive.scenic_program,
            }
            return self._add(TRIAL, row)

    def complete(self, trial: int, ending: Ending) -> None:
        """Store the end of a begun trial, with the current time."""
        changes = {**asdict(ending), "note": with_line_feeds(ending.note), "ended_utc": now_utc()}
        with self._transaction():
            row = self.row(TRIAL, id=trial)
            self._update(TRIAL, {**row, **changes})

    def unfinished(self) -> list[tuple[int, str, str]]:
        """Return (number, log, outcome) of each trial that was begun, but not completed before its session ended."""
        rows = self.rows(TRIAL, "WHERE ending = ? ORDER BY id", RUNNING)
        return [(row["id"], str(row["log"]), str(row["outcome"])) for row in rows]

    def next_number(self) -> int:
        """Return the number that the next trial will get."""
        (last_number,) = self._run("SELECT max(id) FROM trial").fetchone()
        return int(last_number or 0) + 1

    def trial_counts(
        self, experiment: str, design: TrialDesign, environment_fingerprint: str, car: str = BUILT
    ) -> dict[int, int]:
        """Return how many completed trials of this design in this environment are stored, by sample.

        ``car`` is BUILT or SIMULATED: only trials of such cars are counted. Withdrawn trials are not counted.
        """
        rows = self.rows(
            TRIAL,
            "WHERE experiment = ? AND vehicle_type = ? AND design = ? AND outcome <> 'aborted' "
            "AND car = ? AND NOT withdrawn "
            "AND environment_id = (SELECT id FROM environment WHERE fingerprint = ?)",
            experiment,
            design.vehicle_type,
            json.dumps(dict(design.columns)),
            car,
            environment_fingerprint,
        )
        return dict(Counter(row["sample"] for row in rows))

    def correct(self, trial: int, changes: Mapping[str, str | float], reason: str, operator: str) -> list[Correction]:
        """Change fields of a trial, and store a correction with the old value for each.

        Raises StoreError if the trial does not exist, or a field or value is not allowed; then nothing is changed.
        """
        corrections = []
        with self._transaction():
            for field, value in changes.items():
                after = with_line_feeds(value) if isinstance(value, str) else value
                self._require_correctable(trial, field, after)
                row = self._trial(trial)
                if field == "car":
                    self._require_not_reported_by_car(row)
                if row[field] == after:
                    raise StoreError(f"{self.path}: trial {trial}: {field} is {after!r} already")
                corrections.append(self._change(row, field, after, reason, operator))
            if "outcome" in changes or "elapsed_time_s" in changes:
                self._require_passed_in_time(self._trial(trial))
        return corrections

    def _require_correctable(self, trial: int, field: str, value: str | float) -> None:
        """Raise StoreError if a correction may not change ``field``, or may not set it to ``value``."""
        if field not in CORRECTABLE:
            listed = ", ".join(CORRECTABLE)
            raise StoreError(f"{self.path}: trial {trial}: {field} cannot be corrected, only {listed}")
        choices = {"outcome": TRIAL_OUTCOMES, "car": CARS}.get(field)
        if choices is not None and value not in choices:
            raise StoreError(f"{self.path}: trial {trial}: {field}: {value!r} is not one of {', '.join(choices)}")
        # Not `>`, so that NaN is refused, too.
        if isinstance(value, float) and not value <= LONGEST_S:
            raise StoreError(f"{self.path}: trial {trial}: {field}: {value:g} is not at most {LONGEST_S:g}")

    def _require_not_reported_by_car(self, trial: Row) -> None:
        """Raise StoreError if the car itself reported whether it is built or simulated: a person cannot know better."""
        is_reported = trial["car"] is not None and trial["source"] is None
        if is_reported and not self.rows(CORRECTION, "WHERE trial_id = ? AND field = 'car'", trial["id"]):
            reason = f"the car itself reported that it is {trial['car']}; this cannot be corrected"
            raise StoreError(f"{self.path}: trial {trial['id']}: car: {reason}")

    def _require_passed_in_time(self, trial: Row) -> None:
        """Raise StoreError if a trial has passed after the time limit with which it was driven."""
        elapsed_s = trial["elapsed_time_s"]
        if trial["outcome"] != "passed" or elapsed_s is None:
            return
        for settings in self.rows(BY_NAME["settings"], "WHERE id = ?", trial["settings_id"]):
            limit_s = json.loads(settings["json"])["time_limit_s"]
            if elapsed_s > limit_s + LIMIT_OVERRUN_S:
                reason = f"{elapsed_s:g} is above the trial's time limit of {limit_s:g} s, so it has not passed"
                raise StoreError(f"{self.path}: trial {trial['id']}: elapsed_time_s: {reason}")

    def withdraw(self, trials: Iterable[int], withdrawn: bool, reason: str, operator: str) -> list[Correction]:
        """Withdraw trials, or restore them if ``withdrawn`` is False; their rows and logs stay.

        Raises StoreError if a trial is missing or already in that state; then nothing is changed.
        """
        corrections = []
        with self._transaction():
            for trial in trials:
                row = self._trial(trial)
                if bool(row["withdrawn"]) == withdrawn:
                    state = "is withdrawn already" if withdrawn else "is not withdrawn"
                    raise StoreError(f"{self.path}: trial {trial} {state}")
                corrections.append(self._change(row, "withdrawn", int(withdrawn), reason, operator))
        return corrections

    def _trial(self, number: int) -> Row:
        """Return the row of a trial. Raises StoreError if it does not exist."""
        rows = self.rows(TRIAL, "WHERE id = ?", number) if number <= MAX_ID else []
        if not rows:
            raise StoreError(f"{self.path}: has no trial {number}")
        return rows[0]

    def _change(self, trial: Row, field: str, after: str | float, reason: str, operator: str) -> Correction:
        """Change a field of a trial and store the correction, with the current time."""
        correction = Correction(
            trial=trial["id"],
            corrected_utc=now_utc(),
            field=field,
            before=trial[field],
            after=after,
            reason=with_line_feeds(reason),
            operator=with_line_feeds(operator),
        )
        row = asdict(correction)
        row["trial_id"] = row.pop("trial")
        self._add(CORRECTION, row)
        self._update(TRIAL, {**trial, field: after})
        return correction

    def swept_scene(self, environment_fingerprint: str, sample: int) -> Any | None:
        """Return the scene of a sample of an environment as a sweep has stored it; None if it is not stored."""
        where = "WHERE environment_id = (SELECT id FROM environment WHERE fingerprint = ?) AND sample = ?"
        for row in self.rows(SAMPLE, where, environment_fingerprint, sample):
            (scene,) = self.rows(BY_NAME["scene"], "WHERE id = ?", row["scene_id"])
            return json.loads(scene["json"])
        return None

    def put_planned_scene(
        self, environment_fingerprint: str, sample: int, scene: Mapping[str, Any], objects: Sequence[Any]
    ) -> None:
        """Store the planned scene of a sample, with names and parameters of its ``objects``, if it is not stored yet.

        A trial is stored with its scene as it was built, in which obstacles may stand elsewhere than planned. With the
        planned scene, foldcar can recognise the trial's environment even if the fingerprint of the program has changed
        since. Do not call this for a program that runs beside the simulation.
        """
        with self._transaction():
            row = {
                "environment_id": self._identify("environment", "fingerprint", environment_fingerprint),
                "sample": sample,
                "scene_id": self._put_text("scene", canonical_json(scene)),
                "objects": json.dumps(objects, allow_nan=False),
            }
            self._insert(SAMPLE, [row], "OR IGNORE")

    def put_media(self, trial: int, kind: str, file: Path) -> Media:
        """Attach a photo or film to a trial; the file is not copied.

        Raises StoreError if file or trial is missing, or a store cannot hold the file's name.
        """
        digest = sha256_of(file)
        if digest is None:
            problem = "is not a file" if file.exists() else "no such file"
            raise StoreError(f"{file}: {problem}")
        name = reference(self.path, file)
        if decoded(name) != name:
            raise StoreError(f"{file}: its path is not UTF-8 text; rename it")
        row = {"trial_id": trial, "sha256": digest, "kind": kind, "file": name, "added_utc": now_utc()}
        with self._transaction():
            self._trial(trial)
            self._insert(MEDIA, [row], "OR REPLACE")
        return Media(trial=trial, kind=kind, file=name, sha256=digest)


@contextlib.contextmanager
def write_trials(path: Path) -> Iterator[TrialWriter]:
    """Open the store at ``path`` for trials; create it if it is missing. Raises StoreError if it is in use."""
    # A trial cannot be repeated, so each commit is written to the disk before the program continues.
    with writing(path, synchronous="FULL") as connection:
        yield TrialWriter(path, connection)


def now_utc() -> str:
    """Return the current date and time in UTC as it is stored, with a resolution of 1 s."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
