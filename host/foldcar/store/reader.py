"""Reads the results store: the facts of the study, and its runs as rows. docs/store.md describes the file."""

import itertools
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from sqlite3 import Connection
from typing import TYPE_CHECKING, Any, TypeVar

from foldcar.simulation.results import NUMBERS, Recorded, Result
from foldcar.store.connection import open_reading
from foldcar.store.designs import DesignCounts, design_counts
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.info import ExperimentInfo, StudyInfo, is_same_program
from foldcar.store.rows import Row, read_row, read_rows
from foldcar.store.tables import (
    BY_NAME,
    CORRECTION,
    DESIGN,
    ENVIRONMENT,
    EXPERIMENT,
    MEDIA,
    RECORDED,
    RESULT_JOIN,
    RUN,
    STUDY,
    TRIAL,
    Table,
)
from foldcar.store.trial_records import Correction, Media, Trial, TrialDrive

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule

__all__ = ["ExperimentInfo", "Store", "StoreError", "StudyInfo"]

# The columns of each run that :meth:`Store.run_batches` yields, and the maximum number of runs in a batch.
RUN_CELLS = RUN.names
BATCH_ROWS = 20_000

T = TypeVar("T")


class Store:
    """A snapshot of a store: ``with Store.open(path) as store: …``. All methods raise StoreError."""

    def __init__(self, path: Path, connection: Connection) -> None:
        self.path = path
        self._connection = connection
        self._read_once: dict[Any, Any] = {}

    @classmethod
    def open(cls, path: Path) -> "Store":
        """Open an existing store. Raises StoreError if there is no store of this version."""
        return cls(path, open_reading(path))

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def once(self, key: Any, read: Callable[[], T]) -> T:
        """Return the result of ``read``, cached under ``key``; an open store never changes."""
        if key not in self._read_once:
            self._read_once[key] = read()
        result: T = self._read_once[key]
        return result

    def holds_study(self) -> bool:
        """Return whether a sweep has begun; a store may contain only trials."""
        return next(self.rows(STUDY), None) is not None

    def info(self) -> StudyInfo:
        """Return the facts of the study, without its runs. Raises StoreError if no sweep has begun."""
        return self.once("info", self._info)

    def _info(self) -> StudyInfo:
        """Read the study's facts and experiments. Raises StoreError if the store has no study or it is damaged."""
        facts = {row["key"]: row["value"] for row in self.rows(STUDY)}
        if not facts:
            raise StoreError(f"{self.path}: has no study yet; sweep a listing into it")
        try:
            return StudyInfo(**facts, experiments={info.id: info for info in self._experiments()})
        except TypeError:
            raise StoreError(f"{self.path}: study: its facts are damaged") from None

    def experiment_ids(self, experiment: str | None = None) -> list[str]:
        """Return the swept experiments in their order, or only the named one. Raises StoreError if it does not exist."""
        ids = [row["id"] for row in self.rows(EXPERIMENT, "ORDER BY position")]
        if experiment is None:
            return ids
        if experiment not in ids:
            raise StoreError(f'{self.path}: has no experiment "{experiment}"; it has {", ".join(ids) or "none"}')
        return [experiment]

    def results(self, experiment: str | None = None) -> Iterator[Result]:
        """Yield stored runs, of all experiments or of one, ordered by experiment, design and sample."""
        for name in self.experiment_ids(experiment):
            yield from self._results(name)

    def designs(self, name: str) -> dict[int, Mapping[str, float | str]]:
        """Return the parameters of an experiment's designs by position in the family."""
        rows = self.rows(DESIGN, "WHERE experiment = ? ORDER BY position", name)
        return {row["position"]: json.loads(row["parameters"]) for row in rows}

    def run_batches(self, name: str) -> Iterator[tuple[Any, list[tuple[Any, ...]]]]:
        """Yield an experiment's runs, ordered by design and sample, in batches of at most BATCH_ROWS.

        A batch is two lists with one entry for each run. The first has (position of the design, sample), the second the
        run's values of the columns RUN_CELLS.
        """
        # RESULT_JOIN says what the letters of the tables mean.
        run_columns = ", ".join(f"r.{column}" for column in RUN_CELLS)
        query = f"SELECT d.position, s.sample, {run_columns} {RESULT_JOIN} AND e.id = ? ORDER BY d.position, s.sample"
        rows = self._rows(query, name)
        while batch := list(itertools.islice(rows, BATCH_ROWS)):
            yield [row[:2] for row in batch], [row[2:] for row in batch]

    def run_rows(self, name: str) -> Iterator[tuple[int, int, Row]]:
        """Yield an experiment's runs, ordered by design and sample: the design's position, the sample, the row."""
        for positions_and_samples, cells_of_runs in self.run_batches(name):
            for (position, sample), cells in zip(positions_and_samples, cells_of_runs, strict=True):
                yield position, sample, dict(zip(RUN_CELLS, cells, strict=True))

    def trials(self, experiment: str | None = None) -> Iterator[Trial]:
        """Yield all trials, also withdrawn and aborted ones, of all experiments or of one, in the order of numbers."""
        correction_counts = Counter(row["trial_id"] for row in self.rows(CORRECTION))
        for row in self.rows(TRIAL, "WHERE ?1 IS NULL OR experiment = ?1 ORDER BY id", experiment):
            values = {
                **row,
                "design": json.loads(row["design"]),
                "deviations": self._deviations(row),
                "withdrawn": bool(row["withdrawn"]),
                "corrections": correction_counts[row["id"]],
            }
            yield Trial(**{field.name: values[field.name] for field in fields(Trial)})

    def is_dynamic_trial(self, number: int) -> bool:
        """Return whether the Scenic program of a trial's environment runs during the simulation; False if unknown."""
        environment_id = self.row(TRIAL, id=number)["environment_id"]
        if environment_id is None:
            return False
        return bool(self.row(ENVIRONMENT, id=environment_id)["dynamic"])

    def trials_in_other_environments(self, info: ExperimentInfo) -> dict[int, str | None]:
        """Return which trials of an experiment were driven in another environment than its runs.

        The success rates of these trials cannot be compared with those of the runs. The result has the trial's Scenic
        program by the trial's number; the program is None if it is unknown. The environment of an imported trial without
        a sample is unknown. Such a trial is in the result only if its program is known and differs from that of the runs.
        """
        ids_in_environment = self.trials_in_environment(info)
        programs_by_trial = {}
        for row in self.rows(TRIAL, "WHERE experiment = ?", info.listed_id):
            if row["id"] in ids_in_environment:
                continue
            program = row["scenic_program"]
            if row["environment_id"] is not None or not is_same_program(program, info.scenic_program):
                programs_by_trial[row["id"]] = program
        return programs_by_trial

    def trials_in_environment(self, info: ExperimentInfo) -> set[int]:
        """Return the numbers of the trials that were driven in the environment of the experiment's runs.

        The same sample of such a trial and of the runs is the same scene, so they can be compared in pairs. Environments
        are equal if their samples are equal scenes, even if the program's text or foldcar has changed.
        """
        return self.once(("trials in environment", info.id), lambda: self._find_trials_in_environment(info))

    def _find_trials_in_environment(self, info: ExperimentInfo) -> set[int]:
        """Return the ids of the trials that were driven in scenes of the experiment's samples.

        There are three such cases. First, the trial has the environment of the experiment. Second, it has another
        environment with the same scenes: every sample that is stored for both has the same scene in both. Third, the
        trial's own scene is equal to the scene of its sample.
        """
        environment_id = self.listed_environment_id(info)
        trials = list(self.rows(TRIAL, "WHERE experiment = ? AND environment_id IS NOT NULL", info.listed_id))
        has_other_environments = any(trial["environment_id"] != environment_id for trial in trials)
        scenes = self._sampled_scenes(environment_id) if has_other_environments else {}
        # Whether an environment has the same scenes as that of the experiment, by its id.
        has_same_scenes = {environment_id: True}
        trial_ids = set()
        for trial in trials:
            trial_environment_id = trial["environment_id"]
            if trial_environment_id not in has_same_scenes:
                other_scenes = self._sampled_scenes(trial_environment_id)
                common_samples = other_scenes.keys() & scenes.keys()
                are_equal = all(other_scenes[sample] == scenes[sample] for sample in common_samples)
                has_same_scenes[trial_environment_id] = bool(common_samples) and are_equal
            if has_same_scenes[trial_environment_id] or self._is_planned_scene(trial, scenes):
                trial_ids.add(trial["id"])
        return trial_ids

    def _is_planned_scene(self, trial: Row, scenes: Mapping[int, str]) -> bool:
        """Return whether a trial's scene, as placed, equals the scene of its sample in ``scenes``."""
        for row in self.rows(BY_NAME["scene"], "WHERE id = ?", trial["scene_id"]):
            return bool(row["json"] == scenes.get(trial["sample"]))
        return False

    def _sampled_scenes(self, environment_id: int) -> dict[int, str]:
        """Return the stored scenes of an environment as JSON texts, by sample."""
        query = "SELECT s.sample, c.json FROM sample s JOIN scene c ON c.id = s.scene_id WHERE s.environment_id = ?"
        return dict(self._rows(query, environment_id))

    def environments_of_trials(self) -> dict[int, str]:
        """Return the fingerprint of the environment of each trial that has one, by the trial's number."""
        query = "SELECT t.id, e.fingerprint FROM trial t JOIN environment e ON e.id = t.environment_id"
        return dict(self._rows(query))

    def settings_of_trials(self) -> dict[int, str]:
        """Return the settings (JSON) that each trial was driven with, by the trial's number; unknown ones are missing."""
        return dict(self._rows("SELECT t.id, s.json FROM trial t JOIN settings s ON s.id = t.settings_id"))

    def listed_environment_id(self, info: ExperimentInfo) -> int:
        """Return the id of the environment that the listing names for the experiment; 0 if it is not stored.

        An experiment that was simulated in a reality has an environment of its own, which the reality has changed.
        """
        if info.reality is None:
            return int(self._experiment(info.id)["environment_id"])
        for row in self.rows(ENVIRONMENT, "WHERE fingerprint = ?", info.listed_environment):
            return int(row["id"])
        return 0

    def trial(self, number: int) -> Trial:
        """Return the trial with that number. Raises StoreError if it does not exist."""
        for trial in self.trials():
            if trial.id == number:
                return trial
        raise StoreError(f"{self.path}: has no trial {number}")

    def _deviations(self, row: Row) -> dict[str, tuple[float, float, float]]:
        """Return how far the car and obstacles of a trial stood from their planned positions, by name.

        A deviation is (x in m, y in m, turn in rad).
        """
        return {name: (x, y, turn) for name, (x, y, turn) in json.loads(row["deviations"]).items()}

    def corrections(self, trial: int | None = None) -> list[Correction]:
        """Return the corrections of all trials or of one, ordered by trial, oldest first."""
        corrections = []
        for row in self.rows(CORRECTION, "WHERE ?1 IS NULL OR trial_id = ?1 ORDER BY trial_id, id", trial):
            del row["id"]
            corrections.append(Correction(trial=row.pop("trial_id"), **row))
        return corrections

    def media(self, trial: int | None = None) -> list[Media]:
        """Return photos and films of all trials or of one, by trial, in the order in which they were attached."""
        rows = self.rows(MEDIA, "WHERE ?1 IS NULL OR trial_id = ?1 ORDER BY trial_id, added_utc, file", trial)
        return [Media(trial=row["trial_id"], kind=row["kind"], file=row["file"], sha256=row["sha256"]) for row in rows]

    def trial_drive(self, number: int) -> TrialDrive | None:
        """Return a trial's body, settings and scene; None if there is no such trial, or one of them is unknown."""
        for trial in self.rows(TRIAL, "WHERE id = ?", number):
            texts = {}
            for name in ("body", "settings", "scene"):
                for row in self.rows(BY_NAME[name], "WHERE id = ?", trial[f"{name}_id"]):
                    texts[name] = row["json"]
            if texts.keys() == {"body", "settings", "scene"}:
                return TrialDrive(**texts)
        return None

    def rows(self, table: Table, rest: str = "", *values: Any) -> Iterator[Row]:
        """Yield rows of a table; ``rest`` is SQL from WHERE on."""
        return read_rows(self.path, self._connection, table, rest, *values)

    def row(self, table: Table, **key: Any) -> Row:
        """Return the row whose columns have the values of ``key``."""
        return read_row(self.path, self._connection, table, **key)

    def failures(self, experiments: Sequence[str]) -> list[tuple[str, int]]:
        """Return the messages of failed runs with their counts, most frequent first.

        The number of a sample in a message is replaced by "…", so that messages of different samples count together.
        """
        # RESULT_JOIN joins the tables of experiments (e), designs, samples and runs (r), and ends with conditions.
        query = f"SELECT r.message, count(*) {RESULT_JOIN} AND e.id = ? AND r.outcome = 'failed' GROUP BY 1"
        counts: Counter[str] = Counter()
        for name in experiments:
            for message, count in self._rows(query, name):
                message_without_sample = re.sub(r"\bsample \d+", "sample …", message or "no message")
                counts[message_without_sample] += count
        return counts.most_common()

    def design_counts(self, experiment: str) -> DesignCounts:
        """Return how many runs of each of the experiment's designs are stored, and how many passed."""
        return self.once(("counts", experiment), lambda: design_counts(self.path, self._connection, experiment))

    def judged_experiments(self) -> set[str]:
        """Return the experiments that define when a run has passed."""
        return {row["id"] for row in self.rows(EXPERIMENT) if self._facts(row)["success_defined"]}

    def design_columns(self) -> list[str]:
        """Return the names of all design parameters in the store (``width_mm``, …), in order of appearance."""
        columns: dict[str, None] = {}
        for name in self.experiment_ids(None):
            for first_design in self.rows(DESIGN, "WHERE experiment = ? AND position = 0", name):
                columns.update(dict.fromkeys(json.loads(first_design["parameters"])))
        return list(columns)

    def holds_recorded(self) -> bool:
        """Return whether programs recorded values in any run."""
        return next(self._rows("SELECT 1 FROM recorded LIMIT 1"), None) is not None

    def recorded_types(self) -> dict[str, set[str]]:
        """Return the types of the values that Scenic programs recorded in runs, by the value's name, in name order.

        A type is ``series``, or what SQLite calls the type of a JSON value: ``integer``, ``real``, ``text``,
        ``true``, ``false``, ``null``, ``array``, ``object``. A value may have another type in each run.
        """
        query = (
            "SELECT DISTINCT v.name, CASE v.kind WHEN 'series' THEN 'series' ELSE json_type(v.value) END "
            "FROM result JOIN recorded v USING (build_id, body_id, scene_id, settings_id, variation_id) "
            "ORDER BY 1"
        )
        types_by_name: dict[str, set[str]] = {}
        for name, type_name in self._rows(query):
            types_by_name.setdefault(name, set()).add(type_name)
        return types_by_name

    def _results(self, name: str) -> Iterator[Result]:
        """Yield the results of an experiment's runs with their recorded values."""
        experiment = self._experiment(name)
        designs = self.designs(name)
        with_recorded = self.holds_recorded()
        for position, sample, run in self.run_rows(name):
            if position not in designs:
                raise StoreError(f"{self.path}: design (experiment={name}, position={position}) is missing")
            recorded = {}
            if with_recorded:
                for row in self.recorded_rows(run):
                    recorded[row["name"]] = Recorded(row["kind"], json.loads(row["value"]))
            yield Result(
                experiment=name,
                vehicle=experiment["vehicle"],
                environment=experiment["environment"],
                sample=sample,
                outcome=run["outcome"],
                metrics={metric: run[metric] for metric in NUMBERS},
                message=run["message"],
                design=designs[position],
                recorded=recorded,
            )

    def _experiment(self, name: str) -> Row:
        """Return the row of an experiment. Raises StoreError if it does not exist."""
        return self.row(EXPERIMENT, id=name)

    def recorded_rows(self, run: Row) -> Iterator[Row]:
        """Yield the values recorded in a run, ordered by name."""
        has_key_of_run = " AND ".join(f"{column} = ?" for column in RUN.key)
        return self.rows(RECORDED, f"WHERE {has_key_of_run} ORDER BY name", *(run[column] for column in RUN.key))

    def _experiments(self) -> Iterator[ExperimentInfo]:
        """Yield the swept experiments, each with the numbers of its designs and runs."""
        build_names = {row["id"]: row["name"] for row in self.rows(BY_NAME["build"])}
        for row in self.rows(EXPERIMENT, "ORDER BY position"):
            counts = self.design_counts(row["id"])
            facts = self._facts(row)
            until, decided = _stopping_rule(facts.pop("until", None), counts)
            # A sweep that has ended has stored how many runs it has. No more are planned.
            planned_runs = facts.pop("ended_runs", None)
            if planned_runs is None:
                planned_runs = 0
                for stored_runs, is_decided in zip(counts.runs, decided, strict=True):
                    # A design gets no more runs if the stopping rule has decided it, or if it belongs to a search.
                    is_complete = is_decided or facts.get("searched")
                    planned_runs += stored_runs if is_complete else row["environments"]
            facts.pop("files", None)
            if row["build_id"] not in build_names:
                raise StoreError(f"{self.path}: build (id={row['build_id']}) is missing")
            yield ExperimentInfo(
                id=row["id"],
                vehicle=row["vehicle"],
                environment=row["environment"],
                environments=row["environments"],
                carsim_build=build_names[row["build_id"]],
                planned_runs=planned_runs,
                stored_runs=sum(counts.runs),
                until=until,
                designs=len(decided),
                decided=sum(decided),
                **facts,
            )

    def _facts(self, experiment: Row) -> Any:
        """Return the facts of an experiment's row: the fields of ExperimentInfo that have no column."""
        return json.loads(experiment["facts"])

    def _rows(self, query: str, *values: Any) -> Iterator[Any]:
        """Yield the rows of an SQL query as tuples."""
        with store_errors(self.path):
            yield from self._connection.execute(query, values)


def _stopping_rule(facts: Mapping[str, Any] | None, counts: DesignCounts) -> "tuple[StoppingRule | None, list[bool]]":
    """Return a sweep's stopping rule, None without ``facts``, and for each design whether the rule has decided it."""
    if facts is None:
        return None, [False] * len(counts.runs)
    from foldcar.statistics.stopping import StoppingRule

    rule = StoppingRule.from_facts(facts)
    return rule, rule.decided(counts.passed, counts.counted).tolist()
