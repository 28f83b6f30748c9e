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
from foldcar.store.connection import StoreConnection, writing
from foldcar.store.errors import StoreError
from foldcar.store.info import listed_id
from foldcar.store.log_files import reference, sha256_of
from foldcar.store.other_drives import LIMIT_OVERRUN_S
from foldcar.store.rows import Row
from foldcar.store.tables import BY_NAME, CORRECTION, EXPERIMENT, MEDIA, SAMPLE, TRIAL
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

    ``scenic_program`` is the environment's program as the listing names it.
    """

    body: Mapping[str, Any]
    settings: Mapping[str, Any]
    scene: Mapping[str, Any]
    environment_fingerprint: str
    scenic_program: str
    sample: int


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


class TrialWriter(StoreConnection):
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
            row = {
                "uuid": str(uuid.uuid4()),
                "experiment": experiment,
                "vehicle_type": design.vehicle_type,
                "design": json.dumps(dict(design.columns)),
                "body_id": self._put_text("body", canonical_json(drive.body)),
                "settings_id": self._put_text("settings", canonical_json(drive.settings)),
                "environment_id": self._identify("environment", "fingerprint", drive.environment_fingerprint),
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
        facts = {**asdict(ending), "note": with_line_feeds(ending.note), "ended_utc": now_utc()}
        with self._transaction():
            self._update(TRIAL, {**self.row(TRIAL, id=trial), **facts})

    def unfinished(self) -> list[tuple[int, str, str]]:
        """Return number, log and outcome of trials whose session ended before they were completed."""
        rows = self.rows(TRIAL, "WHERE ending = ? ORDER BY id", RUNNING)
        return [(row["id"], str(row["log"]), str(row["outcome"])) for row in rows]

    def next_number(self) -> int:
        """Return the number of the next trial."""
        (last,) = self._run("SELECT max(id) FROM trial").fetchone()
        return int(last or 0) + 1

    def trial_counts(
        self, experiment: str, design: TrialDesign, environment_fingerprint: str, car: str = BUILT
    ) -> dict[int, int]:
        """Return how many completed trials of this design are stored, by sample; ``car`` is BUILT or SIMULATED."""
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
                if field not in CORRECTABLE:
                    known = ", ".join(CORRECTABLE)
                    raise StoreError(f"{self.path}: trial {trial}: {field} cannot be corrected, only {known}")
                choices = {"outcome": TRIAL_OUTCOMES, "car": CARS}.get(field)
                if choices is not None and after not in choices:
                    raise StoreError(f"{self.path}: trial {trial}: {field}: {after!r} is not one of {', '.join(choices)}")
                # Not `>`, so that NaN is refused, too.
                if isinstance(after, float) and not after <= LONGEST_S:
                    raise StoreError(f"{self.path}: trial {trial}: {field}: {after:g} is not at most {LONGEST_S:g}")
                row = self._trial(trial)
                # A person may set `car` only if the car itself did not report it, or if it was corrected before.
                car_corrections = self.rows(CORRECTION, "WHERE trial_id = ? AND field = 'car'", trial)
                if field == "car" and row["car"] is not None and row["source"] is None and not car_corrections:
                    reason_text = f"the car itself reported that it is {row['car']}; this cannot be corrected"
                    raise StoreError(f"{self.path}: trial {trial}: car: {reason_text}")
                if row[field] == after:
                    raise StoreError(f"{self.path}: trial {trial}: {field} is {after!r} already")
                corrections.append(self._change(row, field, after, reason, operator))
            if not {"outcome", "elapsed_time_s"}.isdisjoint(changes):
                self._require_passed_in_time(self._trial(trial))
        return corrections

    def _require_passed_in_time(self, trial: Row) -> None:
        """Raise StoreError if a trial has passed after the time limit with which it was driven."""
        settings = self.rows(BY_NAME["settings"], "WHERE id = ?", trial["settings_id"])
        if trial["outcome"] != "passed" or trial["elapsed_time_s"] is None or not settings:
            return
        time_s, limit_s = trial["elapsed_time_s"], json.loads(settings[0]["json"])["time_limit_s"]
        if time_s > limit_s + LIMIT_OVERRUN_S:
            reason = f"{time_s:g} is above the trial's time limit of {limit_s:g} s, so it has not passed"
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
        facts = with_line_feeds(reason), with_line_feeds(operator)
        correction = Correction(trial["id"], now_utc(), field, trial[field], after, *facts)
        row = asdict(correction)
        self._add(CORRECTION, {**row, "trial_id": row.pop("trial")})
        self._update(TRIAL, {**trial, field: after})
        return correction

    def swept_scene(self, environment_fingerprint: str, sample: int) -> Any | None:
        """Return the scene of a sample that a sweep has stored; None if there is none."""
        of_sample = "WHERE environment_id = (SELECT id FROM environment WHERE fingerprint = ?) AND sample = ?"
        for row in self.rows(SAMPLE, of_sample, environment_fingerprint, sample):
            (scene,) = self.rows(BY_NAME["scene"], "WHERE id = ?", row["scene_id"])
            return json.loads(scene["json"])
        return None

    def put_planned_scene(
        self, environment_fingerprint: str, sample: int, scene: Mapping[str, Any], objects: Sequence[Any]
    ) -> None:
        """Store the planned scene of a sample, with names and parameters of its ``objects``, if it is not stored yet.

        A trial whose obstacles stand elsewhere is recognised by it after the program's files or foldcar have changed.
        The program must not be one that runs beside the simulation.
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
            raise StoreError(f"{file}: {'is not a file' if file.exists() else 'no such file'}")
        name = reference(self.path, file)
        if decoded(name) != name:
            raise StoreError(f"{file}: its path is not UTF-8 text; rename it")
        result = Media(trial, kind, name, digest)
        row = {**asdict(result), "trial_id": trial, "added_utc": now_utc()}
        with self._transaction():
            self._trial(trial)
            self._insert(MEDIA, [row], "OR REPLACE")
        return result

    def import_trials(self, trials: list[dict[str, Any]]) -> list[int]:
        """Store those of the imported trials that are not stored yet; return their numbers.

        ``trials`` are rows of the table, including ``uuid``. If the trial's experiment was swept, its program is stored
        with the trial, and if the trial has a sample, its environment, too. A trial that another store exported has
        ``environment_fingerprint``, ``settings`` (JSON) and ``corrections`` (rows of that table), whose results its
        columns contain; of a stored trial the missing corrections are added. Raises StoreError if a trial is stored with
        other contents; then nothing is stored.
        """
        numbers = []
        with self._transaction():
            origins: dict[str, tuple[int | None, str | None]] = {}
            for exported in trials:
                trial = dict(exported)
                corrections: list[Row] = trial.pop("corrections", [])
                fingerprint = trial.pop("environment_fingerprint", None)
                if fingerprint is not None:
                    trial["environment_id"] = self._identify("environment", "fingerprint", fingerprint)
                settings = trial.pop("settings", None)
                if settings is not None:
                    trial["settings_id"] = self._put_text("settings", settings)
                stored = self.rows(TRIAL, "WHERE uuid = ?", trial["uuid"])
                if stored:
                    self._require_same(_uncorrected(trial, corrections), stored[0])
                    self._add_corrections(stored[0], corrections)
                    continue
                name = trial["experiment"]
                if name not in origins:
                    origins[name] = self._environment_and_program(name)
                environment_id, program = origins[name]
                row = {
                    "deviations": "{}", "ending": "imported", "note": "", "operator": "", "withdrawn": 0,
                    "environment_id": environment_id if trial.get("sample") is not None else None,
                    "scenic_program": program, **trial,
                }  # fmt: skip
                numbers.append(self._add(TRIAL, {**row, "design": json.dumps(row["design"])}))
                for correction in corrections:
                    self._add(CORRECTION, {**correction, "trial_id": numbers[-1]})
        return numbers

    def _add_corrections(self, trial: Row, corrections: Iterable[Row]) -> None:
        """Add those corrections of a stored trial that it lacks; of a field, the latest correction counts."""
        stored = self.rows(CORRECTION, "WHERE trial_id = ? ORDER BY id", trial["id"])
        for correction in corrections:
            row = {**correction, "trial_id": trial["id"]}
            if any(all(other[name] == row[name] for name in row) for other in stored):
                continue
            later = [other for other in stored if other["field"] == row["field"]]
            if all(other["corrected_utc"] <= row["corrected_utc"] for other in later):
                trial[row["field"]] = row["after"]
            self._add(CORRECTION, row)
        self._update(TRIAL, trial)

    def _require_same(self, trial: Mapping[str, Any], stored: Row) -> None:
        """Raise StoreError if an imported trial differs from the one that was imported from the same row before."""
        imported = _uncorrected(stored, self.rows(CORRECTION, "WHERE trial_id = ? ORDER BY id", stored["id"]))
        imported["design"] = json.loads(imported["design"])
        for name in ("experiment", "vehicle_type", "design", "sample", "outcome"):
            if trial.get(name) != imported[name]:
                same = f'row of "{trial["source"]}"' if trial.get("source") else "trial of another store"
                origin = f"trial {stored['id']} was imported from the same {same}"
                values = f"{name} was {imported[name]}, not {trial.get(name)}"
                raise StoreError(f"{self.path}: {origin}, but {values}: correct it, or give other rows another source")

    def _environment_and_program(self, experiment: str) -> tuple[int | None, str | None]:
        """Return environment id and Scenic program of a listed experiment's runs.

        Returns (None, None) if it was not swept, or was swept in several environments.
        """
        programs = {}
        for row in self.rows(EXPERIMENT):
            facts = json.loads(row["facts"])
            if facts.get("reality") is None and listed_id(row["id"], None, facts.get("engine", "")) == experiment:
                programs[row["environment_id"]] = facts.get("scenic_program")
        return next(iter(programs.items())) if len(programs) == 1 else (None, None)


@contextlib.contextmanager
def write_trials(path: Path) -> Iterator[TrialWriter]:
    """Open the store at ``path`` for trials; create it if it is missing. Raises StoreError if it is in use."""
    # A trial cannot be repeated, so each commit is written to the disk before the program continues.
    with writing(path, synchronous="FULL") as connection:
        yield TrialWriter(path, connection)


def _uncorrected(trial: Mapping[str, Any], corrections: Sequence[Row]) -> Row:
    """Return a trial as it was before its ``corrections``, which are ordered oldest first."""
    return {**trial, **{correction["field"]: correction["before"] for correction in reversed(corrections)}}


def now_utc() -> str:
    """Return the current date and time in UTC as it is stored, with a resolution of 1 s."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
