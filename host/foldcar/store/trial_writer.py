"""Writes trials to the results store: a row before the car moves, completed afterwards; corrections are recorded.

Input: the inputs and the end of a trial. Output: rows of `trial` and `correction`, each in its own transaction, so that
a killed program loses at most the answer being typed.
"""

import contextlib
import json
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from foldcar.store.connection import StoreConnection, writing
from foldcar.store.errors import StoreError
from foldcar.store.info import listed_id
from foldcar.store.log_files import reference, sha256_of
from foldcar.store.rows import Row
from foldcar.store.tables import CORRECTION, EXPERIMENT, MEDIA, TRACK, TRIAL
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
    Track,
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

    ``car`` is one of CARS, None if the car did not say it; ``name`` is the operator's for the built car, None for none.
    """

    firmware_build: str
    design_hash: str
    port: str
    car: str | None
    name: str | None = None


class TrialWriter(StoreConnection):
    """A store opened for trials. Made by :func:`write_trials`; all methods raise StoreError."""

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
        """Store a trial as begun, which counts as aborted until :meth:`complete`; returns its number."""
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
                "deviations": canonical_json({name: list(by) for name, by in deviations.items()}),
                "outcome": "aborted",
                "ending": RUNNING,
                "note": "",
                "operator": operator,
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
        """Store the end of a begun trial, which is now."""
        with self._transaction():
            self._update(TRIAL, {**self._row(TRIAL, id=trial), **asdict(ending), "ended_utc": now_utc()})

    def unfinished(self) -> list[tuple[int, str, str]]:
        """Number, log and outcome of trials whose session ended before they were completed."""
        rows = self._rows(TRIAL, "WHERE ending = ? ORDER BY id", RUNNING)
        return [(row["id"], str(row["log"]), str(row["outcome"])) for row in rows]

    def next_number(self) -> int:
        """The number that the next trial gets."""
        (last,) = self._run("SELECT max(id) FROM trial").fetchone()
        return int(last or 0) + 1

    def trial_counts(
        self, experiment: str, design: TrialDesign, environment_fingerprint: str, car: str = BUILT
    ) -> dict[int, int]:
        """How many trials of cars of this design count, by sample of the environment; ``car`` is BUILT or SIMULATED."""
        rows = self._rows(
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
        """Change fields of a trial and record their old values; StoreError if there is no such trial or field."""
        made = []
        with self._transaction():
            for field, after in changes.items():
                if field not in CORRECTABLE:
                    known = ", ".join(CORRECTABLE)
                    raise StoreError(f"{self.path}: trial {trial}: {field} cannot be corrected, only {known}")
                choices = {"outcome": TRIAL_OUTCOMES, "car": CARS}.get(field)
                if choices is not None and after not in choices:
                    raise StoreError(f"{self.path}: trial {trial}: {field}: {after!r} is not one of {', '.join(choices)}")
                if isinstance(after, float) and not after <= LONGEST_S:
                    raise StoreError(f"{self.path}: trial {trial}: {field}: {after:g} is not at most {LONGEST_S:g}")
                found = self._trial(trial)
                # A person may say what drove where no car has said it.
                said = self._rows(CORRECTION, "WHERE trial_id = ? AND field = 'car'", trial)
                if field == "car" and found["car"] is not None and found["source"] is None and not said:
                    told = f"the car itself told that it is {found['car']}; this cannot be corrected"
                    raise StoreError(f"{self.path}: trial {trial}: car: {told}")
                if found[field] == after:
                    raise StoreError(f"{self.path}: trial {trial}: {field} is {after!r} already")
                made.append(self._change(found, field, after, reason, operator))
        return made

    def withdraw(self, trials: Iterable[int], withdrawn: bool, reason: str, operator: str) -> list[Correction]:
        """Withdraw trials, or restore them, all or none. Rows and logs stay. StoreError if one is so already."""
        made = []
        with self._transaction():
            for trial in trials:
                found = self._trial(trial)
                if bool(found["withdrawn"]) == withdrawn:
                    state = "is withdrawn already" if withdrawn else "is not withdrawn"
                    raise StoreError(f"{self.path}: trial {trial} {state}")
                made.append(self._change(found, "withdrawn", int(withdrawn), reason, operator))
        return made

    def _trial(self, number: int) -> Row:
        found = self._rows(TRIAL, "WHERE id = ?", number) if number <= MAX_ID else []
        if not found:
            raise StoreError(f"{self.path}: has no trial {number}")
        return found[0]

    def _change(self, trial: Row, field: str, after: str | float, reason: str, operator: str) -> Correction:
        made = Correction(trial["id"], now_utc(), field, trial[field], after, reason, operator)
        row = asdict(made)
        self._add(CORRECTION, {**row, "trial_id": row.pop("trial")})
        self._update(TRIAL, {**trial, field: after})
        return made

    def put_track(self, track: Track) -> None:
        """Store where a camera saw the car, in place of what it saw before; StoreError if there is no such trial."""
        with self._transaction():
            self._trial(track.trial)
            row = {
                "id": track.trial, "film": track.film, "film_sha256": track.film_sha256, "tracked_utc": now_utc(),
                "start_s": track.start_s, "outcome": track.outcome, "facts": json.dumps(track.facts),
                "rows": json.dumps(track.rows, separators=(",", ":")),
            }  # fmt: skip
            self._insert(TRACK, [row], "OR REPLACE")

    def put_media(self, trial: int, kind: str, file: Path) -> Media:
        """Attach a photo or film, which stays where it is; StoreError if there is no such file or trial."""
        digest = sha256_of(file)
        if digest is None:
            raise StoreError(f"{file}: no such file")
        result = Media(trial, kind, reference(self.path, file), digest)
        row = {**asdict(result), "added_utc": now_utc()}
        with self._transaction():
            self._trial(trial)
            self._insert(MEDIA, [{**row, "trial_id": row.pop("trial")}], "OR REPLACE")
        return result

    def place(
        self, trial: int, deviations: Mapping[str, tuple[float, float, float]], scene: Mapping[str, Any], reason: str,
        operator: str,
    ) -> list[Correction]:  # fmt: skip
        """Say where car and obstacles stood in a trial, ``scene``; what was said before is kept."""
        with self._transaction():
            found = self._trial(trial)
            texts = canonical_json({name: list(by) for name, by in deviations.items()})
            scene_id = self._put_text("scene", canonical_json(scene))
            if (found["deviations"], found["scene_id"]) == (texts, scene_id):
                return []
            # The scene follows from what was planned and the deviations.
            return [self._change({**found, "scene_id": scene_id}, "deviations", texts, reason, operator)]

    def import_trials(self, trials: list[dict[str, Any]]) -> list[int]:
        """Store those imported trials that are not there yet, all or none; returns their numbers.

        ``trials`` are columns of the table by name, ``uuid`` among them. If the store contains a trial's experiment, the
        trial is of that experiment's program, and its sample of the environment as it is now. StoreError if a trial is
        there with other contents.
        """
        numbers = []
        with self._transaction():
            places: dict[str, tuple[int | None, str | None]] = {}
            for trial in trials:
                known = self._rows(TRIAL, "WHERE uuid = ?", trial["uuid"])
                if known:
                    self._require_same(trial, known[0])
                    continue
                name = trial["experiment"]
                if name not in places:
                    places[name] = self._place(name)
                environment_id, program = places[name]
                row = {
                    "deviations": "{}", "ending": "imported", "note": "", "operator": "", "withdrawn": 0,
                    "environment_id": environment_id if trial.get("sample") is not None else None,
                    "scenic_program": program, **trial,
                }  # fmt: skip
                numbers.append(self._add(TRIAL, {**row, "design": json.dumps(row["design"])}))
        return numbers

    def _require_same(self, trial: Mapping[str, Any], known: Row) -> None:
        """StoreError if an imported trial differs from the one that was imported from its place before."""
        before = dict(known)
        for change in self._rows(CORRECTION, "WHERE trial_id = ? ORDER BY id DESC", known["id"]):
            before[change["field"]] = change["before"]
        before["design"] = json.loads(before["design"])
        for name in ("experiment", "vehicle_type", "design", "sample", "outcome"):
            if trial.get(name) != before[name]:
                origin = f'trial {known["id"]} was imported from the same row of "{trial["source"]}"'
                values = f"{name} was {before[name]}, not {trial.get(name)}"
                raise StoreError(f"{self.path}: {origin}, but {values}: correct it, or give other rows another source")

    def _place(self, experiment: str) -> tuple[int | None, str | None]:
        """Environment and program of an experiment of the listing; None if it was not swept, or in several."""
        found = {}
        for row in self._rows(EXPERIMENT):
            facts = json.loads(row["facts"])
            if facts.get("calibration") is None and listed_id(row["id"], None, facts.get("engine", "")) == experiment:
                found[row["environment_id"]] = facts.get("scenic_program")
        return next(iter(found.items())) if len(found) == 1 else (None, None)


@contextlib.contextmanager
def write_trials(path: Path) -> Iterator[TrialWriter]:
    """The store at ``path`` for trials; made, with its folder, if need be. StoreError if it is in use."""
    # A trial cannot be had again: each of its commits is on the disk before the program goes on.
    with writing(path, synchronous="FULL") as connection:
        yield TrialWriter(path, connection)


def now_utc() -> str:
    """The current date and time in UTC as stored, with a resolution of 1 s."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
