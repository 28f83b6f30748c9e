"""Writes trials to the results store: a row before the car moves, completed afterwards; corrections are recorded.

Input: the inputs and the end of a trial. Output: rows of `trial` and `correction`, each in its own transaction, so that
a killed program loses at most the answer being typed.
"""

import contextlib
import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from foldcar.store.connection import StoreConnection
from foldcar.store.errors import StoreError
from foldcar.store.opening import writing
from foldcar.store.rows import parsed
from foldcar.store.tables import BY_NAME, CORRECTION, TRIAL
from foldcar.store.trial_records import CORRECTABLE, RUNNING, TRIAL_OUTCOMES, Ending, TrialDesign
from foldcar.store.writer import canonical_json


@dataclass(frozen=True, slots=True)
class Drive:
    """The inputs of a trial's simulation: objects of docs/carsim.md, the scene as built on the floor."""

    body: Mapping[str, Any]
    settings: Mapping[str, Any]
    scene: Mapping[str, Any]
    environment_fingerprint: str
    sample: int


@dataclass(frozen=True, slots=True)
class CarFacts:
    """The identity of the car: the firmware's build and the design's hash, as the car reported them, and the port."""

    firmware_build: str
    design_hash: str
    port: str


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
            }
            return self._add(TRIAL, row)

    def complete(self, trial: int, ending: Ending) -> None:
        """Store the end of a begun trial."""
        _check_outcome(self.path, ending.outcome)
        with self._transaction():
            ended = {
                "outcome": ending.outcome,
                "ending": ending.ending,
                "elapsed_time_s": ending.elapsed_time_s,
                "note": ending.note,
                "log_sha256": ending.log_sha256,
                "ended_utc": now_utc(),
            }
            self._update(TRIAL, {**self._row(TRIAL, id=trial), **ended})

    def unfinished(self) -> list[tuple[int, str]]:
        """Number and log of trials whose session ended before they were completed."""
        rows = self._rows(TRIAL, "WHERE ending = ? ORDER BY id", RUNNING)
        return [(row["id"], str(row["log"])) for row in rows]

    def next_number(self) -> int:
        """The number that the next trial gets."""
        (last,) = self._run("SELECT max(id) FROM trial").fetchone()
        return int(last or 0) + 1

    def scene(self, environment_fingerprint: str, sample: int) -> dict[str, Any] | None:
        """The sampled scene that a sweep stored, None if there is none."""
        found = self._rows(
            BY_NAME["scene"],
            "WHERE id = (SELECT k.scene_id FROM environment e JOIN sample k ON k.environment_id = e.id "
            "WHERE e.fingerprint = ? AND k.sample = ?)",
            environment_fingerprint,
            sample,
        )
        return dict(parsed(self.path, BY_NAME["scene"], found[0], "json")) if found else None

    def trial_counts(self, experiment: str, design: TrialDesign, environment_fingerprint: str) -> dict[int, int]:
        """The numbers of this design's trials that were not aborted, by sample of the environment."""
        rows = self._rows(
            TRIAL,
            "WHERE experiment = ? AND vehicle_type = ? AND design = ? AND outcome <> 'aborted' "
            "AND environment_id = (SELECT id FROM environment WHERE fingerprint = ?)",
            experiment,
            design.vehicle_type,
            json.dumps(dict(design.columns)),
            environment_fingerprint,
        )
        return dict(Counter(row["sample"] for row in rows))

    def correct(self, trial: int, changes: Mapping[str, str | float], reason: str, operator: str) -> None:
        """Change fields of a trial and record their old values; StoreError if there is no such trial or field."""
        with self._transaction():
            for field, after in changes.items():
                if field not in CORRECTABLE:
                    known = ", ".join(CORRECTABLE)
                    raise StoreError(f"{self.path}: trial {trial}: {field} cannot be corrected, only {known}")
                if field == "outcome":
                    _check_outcome(self.path, str(after))
                if isinstance(after, float) and not math.isfinite(after):
                    raise StoreError(f"{self.path}: trial {trial}: {field}: {after} is no finite number")
                found = self._rows(TRIAL, "WHERE id = ?", trial)
                if not found:
                    raise StoreError(f"{self.path}: has no trial {trial}")
                correction = {
                    "trial_id": trial,
                    "corrected_utc": now_utc(),
                    "field": field,
                    "before": found[0][field],
                    "after": after,
                    "reason": reason,
                    "operator": operator,
                }
                self._add(CORRECTION, correction)
                self._update(TRIAL, {**found[0], field: after})

    def import_trials(self, trials: list[dict[str, Any]]) -> list[int]:
        """Store imported trials, all or none: columns of the table by name; returns their numbers."""
        numbers = []
        with self._transaction():
            for trial in trials:
                _check_outcome(self.path, trial["outcome"])
                row = {"deviations": "{}", "ending": "imported", "note": "", "operator": "", **trial}
                numbers.append(self._add(TRIAL, {**row, "design": json.dumps(row["design"])}))
        return numbers

    def source_is_there(self, source: str) -> bool:
        """Whether trials of this source were imported before."""
        return self._run("SELECT 1 FROM trial WHERE source = ? LIMIT 1", source).fetchone() is not None


@contextlib.contextmanager
def write_trials(path: Path) -> Iterator[TrialWriter]:
    """The store at ``path`` for trials; made, with its folder, if need be. StoreError if it is in use."""
    with writing(path) as connection:
        yield TrialWriter(path, connection)


def now_utc() -> str:
    """The current date and time in UTC as stored, with a resolution of 1 s."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")


def _check_outcome(path: Path, outcome: str) -> None:
    if outcome not in TRIAL_OUTCOMES:
        raise StoreError(f'{path}: outcome "{outcome}" is none of {", ".join(TRIAL_OUTCOMES)}')
