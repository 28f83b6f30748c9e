"""The results store, read: the facts of the study and its runs as rows. docs/store.md describes the file."""

import json
from collections.abc import Iterator
from pathlib import Path
from sqlite3 import Connection
from types import TracebackType
from typing import Any

from foldcar.simulation.results import Recorded, Result
from foldcar.store.info import ExperimentInfo, StudyInfo
from foldcar.store.schema import StoreError, open_reading, store_errors
from foldcar.store.trial_records import Correction, Trial

__all__ = ["ExperimentInfo", "Store", "StoreError", "StudyInfo"]


class Store:
    """A store as it was at one moment: ``with Store.open(path) as store: …``. Never changes a file."""

    def __init__(self, path: Path, connection: Connection) -> None:
        self.path = path
        self._connection = connection

    @classmethod
    def open(cls, path: Path) -> "Store":
        """Open an existing store; StoreError if there is none or it is of another version."""
        return cls(path, open_reading(path))

    def __enter__(self) -> "Store":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()

    def info(self) -> StudyInfo:
        """The facts of the study, without its runs; StoreError if no sweep has begun yet."""
        facts = {key: value for key, value in self._rows("SELECT key, value FROM study")}
        if not facts:
            raise StoreError(f"{self.path}: holds no study yet: sweep a listing into it")
        return StudyInfo(**facts, experiments={info.id: info for info in self._experiments()})

    def results(self, experiment: str | None = None) -> Iterator[Result]:
        """Stored runs, streamed by experiment, design and sample; of one experiment if it is named."""
        for name in self._experiment_ids(experiment):
            for *values, parameters, recorded in self._rows(
                "SELECT experiment, vehicle, environment, sample, outcome, elapsed_time_s, "
                "distance_to_target_m, consumed_energy_j, max_roll_rad, max_pitch_rad, message, parameters, "
                "recorded FROM result WHERE experiment = ? ORDER BY design_position, sample",
                name,
            ):
                named = {key: Recorded(**value) for key, value in json.loads(recorded).items()}
                yield Result(*(*values, json.loads(parameters), named))

    def trials(self, experiment: str | None = None) -> Iterator[Trial]:
        """Trials of built cars in their order; of one experiment if it is named."""
        for number, named, vehicle_type, design, sample, deviations, *rest in self._rows(
            "SELECT id, experiment, vehicle_type, design, sample, deviations, outcome, ending, elapsed_time_s, note, "
            "operator, started_utc, ended_utc, firmware_build, design_hash, log, log_sha256, source, "
            "(SELECT count(*) FROM correction c WHERE c.trial_id = t.id) FROM trial t "
            "WHERE ?1 IS NULL OR experiment = ?1 ORDER BY id",
            experiment,
        ):
            moved = {name: (x, y, heading) for name, (x, y, heading) in json.loads(deviations).items()}
            yield Trial(number, named, vehicle_type, json.loads(design), sample, moved, *rest)

    def trial(self, number: int) -> Trial:
        """The trial of that number; StoreError if there is none."""
        found = next((trial for trial in self.trials() if trial.id == number), None)
        if found is None:
            raise StoreError(f"{self.path}: has no trial {number}")
        return found

    def corrections(self, trial: int) -> list[Correction]:
        """What was changed of a trial, oldest first."""
        rows = self._rows(
            "SELECT trial_id, corrected_utc, field, before, after, reason, operator FROM correction "
            "WHERE trial_id = ? ORDER BY id",
            trial,
        )
        return [Correction(*row) for row in rows]

    def trial_drive(self, number: int) -> tuple[str, str, str] | None:
        """Body, settings and scene (as placed) of a trial as JSON; None if they are not known."""
        rows = self._rows(
            "SELECT b.json, s.json, c.json FROM trial t JOIN body b ON b.id = t.body_id "
            "JOIN settings s ON s.id = t.settings_id JOIN scene c ON c.id = t.scene_id WHERE t.id = ?",
            number,
        )
        return next(((str(body), str(settings), str(scene)) for body, settings, scene in rows), None)

    def design_columns(self) -> list[str]:
        """Names of all design parameters in the store (``width_mm``, …), in order of appearance."""
        columns: dict[str, None] = {}
        for (name,) in self._rows("SELECT id FROM experiment ORDER BY position"):
            for (parameters,) in self._rows(
                "SELECT parameters FROM design WHERE experiment = ? AND position = 0", name
            ):
                columns.update(dict.fromkeys(json.loads(parameters)))
        return list(columns)

    def recorded_types(self) -> dict[str, set[str]]:
        """Names of all recorded values that results show, in order of the alphabet, with their types.

        A type is ``series`` or SQLite's name for that of a JSON value: ``integer``, ``real``, ``text``,
        ``true``, ``false``, ``null``, ``array``, ``object``.
        """
        types: dict[str, set[str]] = {}
        for name, kind in self._rows(
            "SELECT DISTINCT v.name, CASE v.kind WHEN 'series' THEN 'series' ELSE json_type(v.value) END "
            "FROM result JOIN recorded v USING (build_id, body_id, scene_id, settings_id, variation_id) "
            "ORDER BY 1"
        ):
            types.setdefault(name, set()).add(kind)
        return types

    def _experiment_ids(self, experiment: str | None) -> list[str]:
        known = [name for (name,) in self._rows("SELECT id FROM experiment ORDER BY position")]
        if experiment is None:
            return known
        if experiment not in known:
            raise StoreError(
                f'{self.path}: has no experiment "{experiment}"; it has {", ".join(known) or "none"}'
            )
        return [experiment]

    def _experiments(self) -> Iterator[ExperimentInfo]:
        for name, vehicle, environment, environments, build, facts, designs, stored in self._rows(
            "SELECT e.id, e.vehicle, e.environment, e.environments, b.name, e.facts, "
            "(SELECT count(*) FROM design d WHERE d.experiment = e.id), "
            "(SELECT count(*) FROM result r WHERE r.experiment = e.id) "
            "FROM experiment e JOIN build b ON b.id = e.build_id ORDER BY e.position"
        ):
            yield ExperimentInfo(
                id=name,
                vehicle=vehicle,
                environment=environment,
                environments=environments,
                carsim_build=build,
                planned_runs=designs * environments,
                stored_runs=stored,
                **json.loads(facts),
            )

    def _rows(self, query: str, *values: Any) -> Iterator[Any]:
        with store_errors(self.path):
            yield from self._connection.execute(query, values)
