"""Writes the results of sweeps to the store: one sweep at a time, one transaction per chunk.

A run's key is (build of carsim, body, scene, settings, variation), each identified by the hash of its text: a run whose
key is stored is never repeated, whichever experiment requires it. Scenes are stored by the environment's fingerprint,
variations by that of their spread.
"""

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from foldcar.simulation.results import NUMBERS, REJECTED, outcome_of
from foldcar.store.connection import writing
from foldcar.store.designs import DesignCounts, design_counts, designs_of
from foldcar.store.errors import StoreError
from foldcar.store.rows import scene_identity
from foldcar.store.store_connection import StoreConnection
from foldcar.store.tables import (
    BY_NAME,
    DESIGN,
    DRAW,
    ENVIRONMENT,
    EXPERIMENT,
    REALITY_RUN,
    RECORDED,
    RESULT_JOIN,
    RUN,
    SAMPLE,
    STUDY,
    Table,
)

# Number of rows that one query returns.
PAGE_ROWS = 1000


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """A run of an experiment: ``design`` is the design's position in the family; the ids are those of the run's inputs.

    ``outcome`` is None until the run has a result.
    """

    design: int
    sample: int
    body_id: int
    scene_id: int
    settings_id: int
    variation_id: int
    outcome: str | None


@dataclass(frozen=True, slots=True)
class StoredSweep:
    """The last sweep of an experiment: its number of environments, and the parameters of its designs, in their order."""

    environments: int
    designs: Sequence[Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class PlannedDesign:
    """A design of an experiment, with its input for the simulator."""

    columns: Mapping[str, float]
    body: Mapping[str, Any]
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class PlannedExperiment:
    """An experiment to be stored. ``facts`` are the fields of ExperimentInfo that have no column of their own."""

    id: str
    vehicle: str
    environment: str
    environment_id: int
    spread_id: int
    environments: int
    facts: Mapping[str, Any]


class StoreWriter(StoreConnection):
    """A store opened for a sweep. Create it with :func:`write_store`; all methods raise StoreError."""

    def __init__(self, path: Path, connection: Connection) -> None:
        super().__init__(path, connection)
        self._build_id = 0

    def begin_study(self, facts: Mapping[str, str], build: str) -> None:
        """Store a sweep's facts and the build of carsim.

        The fact ``created_utc`` stays that of the store's first sweep.
        """
        with self._transaction():
            self._build_id = self._identify("build", "name", build)
            facts = dict(facts)
            for row in self.rows(STUDY, "WHERE key = 'created_utc'"):
                facts["created_utc"] = row["value"]
            self._insert(STUDY, [{"key": key, "value": value} for key, value in facts.items()], "OR REPLACE")

    def put_experiment(
        self, plan: PlannedExperiment, designs: Iterable[PlannedDesign], fingerprint: str | None = None
    ) -> None:
        """Store an experiment and its designs. They replace a stored experiment with the same id. All runs are kept.

        ``fingerprint`` is a hash of everything that the designs depend on; None if this is not known. If the stored
        designs have the same fingerprint, they are kept, and ``designs`` is not read.
        """
        with self._transaction():
            kept_count = self._count_designs_to_keep(plan.id, fingerprint)
            if kept_count is None:
                self._run("DELETE FROM design WHERE experiment = ?", plan.id)
            position_by_id = {row["id"]: row["position"] for row in self.rows(EXPERIMENT)}
            experiment = {
                "id": plan.id,
                "position": position_by_id.get(plan.id, len(position_by_id)),
                "build_id": self._build_id,
                "environment_id": plan.environment_id,
                "spread_id": plan.spread_id,
                "environments": plan.environments,
                "vehicle": plan.vehicle,
                "environment": plan.environment,
                "facts": json.dumps(plan.facts),
                "designs": kept_count,
                "designs_fingerprint": fingerprint,
            }
            # The designs refer to the experiment, so it is inserted before them.
            self._insert(EXPERIMENT, [experiment], "OR REPLACE")
            if kept_count is not None:
                return
            design_count = 0
            for position, design in enumerate(designs):
                self._put_design(plan.id, position, design)
                design_count += 1
            if fingerprint is not None:
                # The number of designs is stored when all designs are. A program that finds no number knows that the
                # designs are incomplete.
                self._update(EXPERIMENT, {**experiment, "designs": design_count})

    def _count_designs_to_keep(self, experiment: str, fingerprint: str | None) -> int | None:
        """Return the number of stored designs if they are complete and have this fingerprint, otherwise None."""
        if fingerprint is None:
            return None
        stored_designs = designs_of(self.path, self._connection, experiment)
        if stored_designs is None or stored_designs.fingerprint != fingerprint:
            return None
        return len(stored_designs.parameters)

    def add_design(self, experiment: str, position: int, design: PlannedDesign) -> None:
        """Store one more design of an experiment, at the position after its last."""
        with self._transaction():
            self._put_design(experiment, position, design)

    def _put_design(self, experiment: str, position: int, design: PlannedDesign) -> None:
        """Store a design with its body and settings."""
        row = {
            "experiment": experiment,
            "position": position,
            "parameters": json.dumps(design.columns),
            "body_id": self._put_text("body", canonical_json(design.body)),
            "settings_id": self._put_text("settings", canonical_json(design.settings)),
        }
        self._insert(DESIGN, [row])

    def last_sweep(self, experiment: str, environment_id: int, spread_id: int) -> StoredSweep | None:
        """Return the last sweep of an experiment.

        Returns None if there is none, or if another build made it, in another environment or with another spread of cars.
        """
        for row in self.rows(EXPERIMENT, "WHERE id = ?", experiment):
            if (row["build_id"], row["environment_id"], row["spread_id"]) == (self._build_id, environment_id, spread_id):
                designs = self.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment)
                parameters = [json.loads(design["parameters"]) for design in designs]
                return StoredSweep(environments=row["environments"], designs=parameters)
        return None

    def environment(self, fingerprint: str) -> int:
        """Return the id of the environment with this fingerprint; add it if it is missing."""
        with self._transaction():
            return self._identify("environment", "fingerprint", fingerprint)

    def knows_environment(self, fingerprint: str) -> bool:
        """Return whether the environment with this fingerprint is stored."""
        return bool(self.rows(ENVIRONMENT, "WHERE fingerprint = ?", fingerprint))

    def program_files(self, experiment: str) -> Mapping[str, str] | None:
        """Return the files of the experiment's program at its last sweep; None if they are not stored."""
        return self.experiment_facts(experiment).get("files")

    def is_dynamic(self, environment_id: int, ask: Callable[[], bool]) -> bool:
        """Return whether an environment's Scenic program must run beside the simulation.

        If this is not stored yet, it is the result of ``ask``, and is stored.
        """
        row = self.row(ENVIRONMENT, id=environment_id)
        if row["dynamic"] is None:
            row["dynamic"] = int(ask())
            with self._transaction():
                self._update(ENVIRONMENT, row)
        return bool(row["dynamic"])

    def environment_facts(self, environment_id: int) -> dict[str, Any]:
        """Return the facts of any experiment that was swept in this environment; {} if there is no such experiment."""
        rows = self.rows(EXPERIMENT, "WHERE environment_id = ?", environment_id)
        return dict(json.loads(rows[0]["facts"])) if rows else {}

    def experiment_facts(self, experiment: str) -> dict[str, Any]:
        """Return the facts of an experiment as it was last swept; {} if it was not."""
        rows = self.rows(EXPERIMENT, "WHERE id = ?", experiment)
        return dict(json.loads(rows[0]["facts"])) if rows else {}

    def update_facts(self, experiment: str, **facts: Any) -> None:
        """Change some facts of a stored experiment."""
        with self._transaction():
            row = self.row(EXPERIMENT, id=experiment)
            all_facts = {**json.loads(row["facts"]), **facts}
            row["facts"] = json.dumps(all_facts)
            self._update(EXPERIMENT, row)

    def spread(self, fingerprint: str) -> int:
        """Return the id of the spread of cars with this fingerprint; add it if it is missing."""
        with self._transaction():
            return self._identify("spread", "fingerprint", fingerprint)

    def stored_samples(self, table: Table, number: int) -> set[int]:
        """Return the stored samples of the environment (table SAMPLE) or spread (DRAW) with this number."""
        rows = self._run(f"SELECT sample FROM {table.name} WHERE {table.key[0]} = ?", number)
        return {int(sample) for (sample,) in rows}

    def stored_scene(self, environment_id: int, sample: int) -> Any:
        """Return the scene of a stored sample."""
        row = self.row(BY_NAME["sample"], environment_id=environment_id, sample=sample)
        return json.loads(self.row(BY_NAME["scene"], id=row["scene_id"])["json"])

    def put_sample(
        self,
        environment_id: int,
        sample: int,
        scene: Mapping[str, Any],
        dynamic: bool = False,
        objects: Sequence[tuple[str, Mapping[str, float]]] | None = None,
    ) -> None:
        """Store the scene of a sample, and names and parameters of its terrain ``objects``, if they are known.

        Equal scenes are stored once, unless the Scenic program is ``dynamic``. Such a program runs beside the simulation,
        and may behave differently in samples with equal scenes. If the sample is stored already, nothing changes.
        """
        fingerprint = self.row(ENVIRONMENT, id=environment_id)["fingerprint"]
        identity = scene_identity(fingerprint, sample) if dynamic else ""
        with self._transaction():
            row = {
                "environment_id": environment_id,
                "sample": sample,
                "scene_id": self._put_text("scene", canonical_json(scene), identity),
                "objects": None if objects is None else json.dumps(objects, allow_nan=False),
            }
            self._insert(SAMPLE, [row], "OR IGNORE")

    def put_draw(self, spread_id: int, sample: int, variation: Mapping[str, Any], identity: str = "") -> None:
        """Store how the built car of a sample differs from its design: the ``variation`` that was drawn for the sample.

        ``spread_id`` is the database's id of the distribution from which it was drawn. Equal variations are stored once,
        unless their ``identity`` differs. If the sample's variation is stored already, nothing changes.
        """
        with self._transaction():
            row = {
                "spread_id": spread_id,
                "sample": sample,
                "variation_id": self._put_text("variation", canonical_json(variation), identity),
            }
            self._insert(DRAW, [row], "OR IGNORE")

    def design_counts(self, experiment: str) -> DesignCounts:
        """Return how many runs of each of the experiment's designs are stored, and how many passed."""
        return design_counts(self.path, self._connection, experiment)

    def run_counts(self, plan: PlannedExperiment, design: int, samples: range) -> tuple[int, int]:
        """Return how many stored runs of a design in those samples passed, and how many were not rejected."""
        # RESULT_JOIN joins the tables of experiments (e), designs (d), samples (s) and runs (r), among others.
        passed, not_rejected = self._run(
            f"SELECT total(r.outcome = 'passed'), total(r.outcome <> '{REJECTED}') {RESULT_JOIN} "
            "AND e.id = ? AND d.position = ? AND s.sample >= ? AND s.sample < ?",
            plan.id, design, samples.start, samples.stop,
        ).fetchone()  # fmt: skip
        return int(passed), int(not_rejected)

    def end_experiment(self, plan: PlannedExperiment, runs: int) -> None:
        """Store that the sweep has ended with ``runs`` runs, so that no more are planned for undecided designs."""
        self.update_facts(plan.id, ended_runs=runs)

    def planned_runs(self, plan: PlannedExperiment, sample: int) -> Iterator[PlannedRun]:
        """Yield the runs of all designs in one stored sample, in the order of designs.

        At most PAGE_ROWS runs are read at once, so that the caller can store results between them.
        """
        next_design = 0
        while True:
            # For each design (d): the scene of the sample (s), the variation of the cars in it (w), and the run with
            # these inputs (r), if it is stored.
            rows = self._run(
                "SELECT d.position, s.sample, d.body_id, s.scene_id, d.settings_id, w.variation_id, "
                "r.outcome FROM design d JOIN sample s ON s.environment_id = ? AND s.sample = ? "
                "JOIN draw w ON w.spread_id = ? AND w.sample = s.sample LEFT JOIN run r "
                "ON r.build_id = ? AND r.body_id = d.body_id AND r.scene_id = s.scene_id "
                "AND r.settings_id = d.settings_id AND r.variation_id = w.variation_id "
                "WHERE d.experiment = ? AND d.position >= ? ORDER BY d.position LIMIT ?",
                plan.environment_id, sample, plan.spread_id, self._build_id, plan.id, next_design, PAGE_ROWS,
            ).fetchall()  # fmt: skip
            # The query's columns are in the order of the fields.
            runs = [PlannedRun(*row) for row in rows]
            yield from runs
            is_last_page = len(runs) < PAGE_ROWS
            if is_last_page:
                return
            next_design = runs[-1].design + 1

    def texts(self, table: str, row_ids: Iterable[int]) -> dict[int, str]:
        """Return the JSON texts of rows of ``body``, ``scene``, ``settings`` or ``variation``, by the row's id.

        At most some thousands of rows can be read at once. Raises StoreError if one is missing.
        """
        ids = set(row_ids)
        placeholders = ", ".join("?" for _ in ids)
        rows = self.rows(BY_NAME[table], f"WHERE id IN ({placeholders})", *ids)
        text_by_id = {row["id"]: str(row["json"]) for row in rows}
        missing_ids = ids - text_by_id.keys()
        if missing_ids:
            raise StoreError(f"{self.path}: {table} (id={min(missing_ids)}) is missing")
        return text_by_id

    def result(self, run: PlannedRun) -> dict[str, Any]:
        """Return the stored outcome and metrics of a run that has a result."""
        row = self.row(RUN, **self._key(run))
        return {name: row[name] for name in ("outcome", *NUMBERS)}

    def _key(self, run: PlannedRun) -> dict[str, int]:
        """Return the key of a run's row: the ids of the build and of its inputs."""
        return {
            "build_id": self._build_id,
            "body_id": run.body_id,
            "scene_id": run.scene_id,
            "settings_id": run.settings_id,
            "variation_id": run.variation_id,
        }

    def add_results(self, results: Iterable[tuple[PlannedRun, Mapping[str, Any]]]) -> None:
        """Store runs with the simulator's answers (:mod:`foldcar.simulation.carsim`) in one transaction."""
        run_rows, recorded_rows = [], []
        for run, answer in results:
            key = self._key(run)
            run_row: dict[str, Any] = {**key, "outcome": outcome_of(answer)}
            run_rows.append(run_row)
            if "error" in answer:
                run_row["message"] = answer["error"]
                continue
            for metric in NUMBERS:
                run_row[metric] = answer[metric]
            for name, record in answer.get("recorded", {}).items():
                value = json.dumps(record["value"], allow_nan=False)
                recorded_rows.append({**key, "name": name, "kind": record["kind"], "value": value})
        with self._transaction():
            self._insert(RUN, run_rows, "OR IGNORE")
            self._insert(RECORDED, recorded_rows, "OR IGNORE")

    def add_reality_runs(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Store runs in other realities, as rows of REALITY_RUN, in one transaction."""
        with self._transaction():
            self._insert(REALITY_RUN, rows, "OR IGNORE")


@contextlib.contextmanager
def write_store(path: Path) -> Iterator[StoreWriter]:
    """Open the store at ``path`` for one sweep; create it if it is missing. Raises StoreError if it is in use."""
    with writing(path) as connection:
        yield StoreWriter(path, connection)


def canonical_json(value: Mapping[str, Any]) -> str:
    """Return the canonical JSON text of a value: sorted keys, no spaces."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
