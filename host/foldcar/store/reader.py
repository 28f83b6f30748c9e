"""Reads the results store: the facts of the study, and its runs as rows. docs/store.md describes the file."""

import itertools
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from foldcar.simulation.results import NUMBERS, Recorded, Result
from foldcar.store.designs import DesignCounts, design_counts
from foldcar.store.errors import StoreError
from foldcar.store.info import ExperimentInfo, StudyInfo
from foldcar.store.rows import Row
from foldcar.store.tables import (
    BY_NAME,
    DESIGN,
    EXPERIMENT,
    RECORDED,
    RESULT_JOIN,
    RUN,
    STUDY,
)
from foldcar.store.trial_reader import TrialReader

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule

__all__ = ["ExperimentInfo", "Store", "StoreError", "StudyInfo"]

# The columns of each run that :meth:`Store.run_batches` yields, and the maximum number of runs in a batch.
RUN_CELLS = RUN.names
BATCH_ROWS = 20_000


class RunBatch(NamedTuple):
    """Some runs of an experiment. Each list has one entry for each run.

    ``positions`` are the positions of the designs in the family. ``cells`` are the values of the columns RUN_CELLS.
    """

    positions: list[int]
    samples: list[int]
    cells: list[tuple[Any, ...]]


class Store(TrialReader):
    """A snapshot of a store: ``with Store.open(path) as store: …``. All methods raise StoreError."""

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

    def run_batches(self, name: str) -> Iterator[RunBatch]:
        """Yield an experiment's runs, ordered by design and sample, in batches of at most BATCH_ROWS."""
        # RESULT_JOIN joins the tables of experiments (e), designs (d), samples (s) and runs (r).
        run_columns = ", ".join(f"r.{column}" for column in RUN_CELLS)
        query = f"SELECT d.position, s.sample, {run_columns} {RESULT_JOIN} AND e.id = ? ORDER BY d.position, s.sample"
        rows = self._rows(query, name)
        while batch := list(itertools.islice(rows, BATCH_ROWS)):
            yield RunBatch(
                positions=[row[0] for row in batch],
                samples=[row[1] for row in batch],
                cells=[row[2:] for row in batch],
            )

    def run_rows(self, name: str) -> Iterator[tuple[int, int, Row]]:
        """Yield an experiment's runs, ordered by design and sample: the design's position, the sample, the row."""
        for batch in self.run_batches(name):
            for position, sample, cells in zip(batch.positions, batch.samples, batch.cells, strict=True):
                yield position, sample, dict(zip(RUN_CELLS, cells, strict=True))

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
            if row["build_id"] not in build_names:
                raise StoreError(f"{self.path}: build (id={row['build_id']}) is missing")
            counts = self.design_counts(row["id"])
            facts = self._facts(row)
            stopping_rule_facts = facts.pop("until", None)
            run_count_at_end = facts.pop("ended_runs", None)
            facts.pop("files", None)
            rule = None if stopping_rule_facts is None else _stopping_rule(stopping_rule_facts)
            decided = _decided_designs(rule, counts)
            if run_count_at_end is not None:
                # The sweep has ended, so no more runs are planned.
                planned_runs = run_count_at_end
            else:
                is_search = bool(facts.get("searched"))
                planned_runs = _planned_runs(counts, decided, row["environments"], is_search)
            yield ExperimentInfo(
                id=row["id"],
                vehicle=row["vehicle"],
                environment=row["environment"],
                environments=row["environments"],
                carsim_build=build_names[row["build_id"]],
                planned_runs=planned_runs,
                stored_runs=sum(counts.runs),
                until=rule,
                designs=len(decided),
                decided=sum(decided),
                **facts,
            )

    def _facts(self, experiment: Row) -> Any:
        """Return the facts of an experiment's row: the fields of ExperimentInfo that have no column."""
        return json.loads(experiment["facts"])


def _stopping_rule(facts: Mapping[str, Any]) -> "StoppingRule":
    """Return the stopping rule of a sweep from its stored facts."""
    # Imported here, because SciPy, which the rules need, takes time to import.
    from foldcar.statistics.stopping import StoppingRule

    return StoppingRule.from_facts(facts)


def _decided_designs(rule: "StoppingRule | None", counts: DesignCounts) -> list[bool]:
    """Return for each design whether the sweep's stopping rule has decided it, so that it needs no more runs."""
    if rule is None:
        return [False] * len(counts.runs)
    decided: list[bool] = rule.decided(counts.passed, counts.counted).tolist()
    return decided


def _planned_runs(counts: DesignCounts, decided: Sequence[bool], environments: int, is_search: bool) -> int:
    """Return how many runs a sweep that goes on will have at its end.

    A design has a run in each of the ``environments``. It gets no more runs than it has if it is decided, or if the
    designs belong to a search.
    """
    planned_runs = 0
    for stored_runs, is_decided in zip(counts.runs, decided, strict=True):
        planned_runs += stored_runs if is_decided or is_search else environments
    return planned_runs
