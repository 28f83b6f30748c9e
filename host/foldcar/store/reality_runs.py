"""Reads the runs of an experiment in other realities, from which the success rate of built cars is learned.

Input: a store that is opened for reading or writing. Output: an experiment's runs as arrays, and the ids of its designs,
scenes and realities. Runs of other builds, designs, scenes or priors stay in the store and are not read.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from foldcar.store.errors import StoreError
from foldcar.store.rows import Row
from foldcar.store.tables import DESIGN, EXPERIMENT, REALITY_RUN, SAMPLE, SPREAD, Table

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
IntArray = np.ndarray[Any, np.dtype[np.intp]]
# The runs are numbered, and each BLOCK of numbers begins with CHECK runs that share a reality and a design, and differ in
# scene, car and start. They show how well a success rate that was learned from single runs holds.
BLOCK, CHECK = 100, 20


class ReadableStore(Protocol):
    """A Store, or a StoreConnection."""

    path: Path

    def rows(self, table: Table, rest: str = "", *values: Any) -> Iterable[Row]:
        """Return rows of a table; ``rest`` is SQL from WHERE on."""


@dataclass(frozen=True)
class RealityRuns:
    """Runs of one experiment, each in a random reality, in ascending order of their numbers.

    A reality is a set of values of the simulator's parameters, such as friction, that could be true. ``scores`` (runs,
    parameters) are these values as scores, in the order of belief/priors.py. The other arrays have one entry for each
    run: ``design`` is the index of the design in the experiment's order, ``sample`` the scene's sample. ``passed`` is 1
    if the run passed, 0 if not, NaN if its simulation failed. ``number`` is the run's number, from 0.
    """

    scores: FloatArray
    design: IntArray
    sample: IntArray
    passed: FloatArray
    number: IntArray

    def __len__(self) -> int:
        return len(self.passed)

    def taken(self, chosen: np.ndarray[Any, Any]) -> "RealityRuns":
        """Return only the ``chosen`` runs: a boolean mask over the runs, or their indices."""
        return RealityRuns(
            scores=self.scores[chosen],
            design=self.design[chosen],
            sample=self.sample[chosen],
            passed=self.passed[chosen],
            number=self.number[chosen],
        )


@dataclass(frozen=True)
class RealityKeys:
    """The ids by which an experiment's runs in other realities are found in the store.

    ``planned`` is how many runs the last sweep planned. ``designs`` are the ids (body, settings) of the designs, in the
    experiment's order. ``scenes`` maps samples to the ids of their scenes.
    """

    planned: int
    build_id: int
    spread_id: int
    designs: list[tuple[int, int]]
    scenes: dict[int, int]


def reality_keys(store: ReadableStore, experiment: str) -> RealityKeys | None:
    """Return the ids by which an experiment's runs in other realities are found.

    Returns None if there is no such experiment, or if its last sweep planned no such runs.
    """
    row = _first_row(store, EXPERIMENT, "WHERE id = ?", experiment)
    if row is None:
        return None
    facts = json.loads(row["facts"])
    # The realities of a sweep are drawn from distributions, whose fingerprint the experiment has. An experiment without
    # such runs has no fingerprint.
    spread_row = _first_row(store, SPREAD, "WHERE fingerprint = ?", facts.get("reality_spread"))
    if spread_row is None:
        return None
    designs = store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment)
    of_experiment = "WHERE environment_id = ? AND sample < ? ORDER BY sample"
    samples = store.rows(SAMPLE, of_experiment, row["environment_id"], row["environments"])
    return RealityKeys(
        planned=facts.get("realities", 0),
        build_id=row["build_id"],
        spread_id=spread_row["id"],
        designs=[(design["body_id"], design["settings_id"]) for design in designs],
        scenes={sample["sample"]: sample["scene_id"] for sample in samples},
    )


def _first_row(store: ReadableStore, table: Table, condition: str, value: Any) -> Row | None:
    """Return the first row of a table that meets the condition, or None."""
    for row in store.rows(table, condition, value):
        return row
    return None


class _StoredRun(NamedTuple):
    """One of the RealityRuns. They are sorted by ``number``, the first field."""

    number: int
    sample: int
    design: int
    scores: list[float]
    passed: float


def read_reality_runs(store: ReadableStore, experiment: str) -> RealityRuns:
    """Return the stored runs of ``experiment`` in other realities; empty arrays if there are none. Raises StoreError.

    In a *reality*, the parameters of the simulator, such as friction, have other values, which could be the true ones.
    If an earlier sweep made more runs than the last one planned, the additional runs are left out.

    Example: ``read_reality_runs(store, "1").passed.mean()``
    """
    keys = reality_keys(store, experiment)
    runs = [] if keys is None else sorted(_stored_runs(store, keys))
    # Each run has a score for each parameter of the simulator.
    parameter_count = len(runs[0].scores) if runs else 0
    if any(len(run.scores) != parameter_count for run in runs):
        raise StoreError(f"{store.path}: reality_run is damaged: its rows have different numbers of scores")
    return RealityRuns(
        scores=np.array([run.scores for run in runs], dtype=float).reshape(len(runs), parameter_count),
        design=np.array([run.design for run in runs], dtype=np.intp),
        sample=np.array([run.sample for run in runs], dtype=np.intp),
        passed=np.array([run.passed for run in runs], dtype=float),
        number=np.array([run.number for run in runs], dtype=np.intp),
    )


def _stored_runs(store: ReadableStore, keys: RealityKeys) -> Iterator[_StoredRun]:
    """Yield the stored runs of an experiment in other realities, in the order in which the table has them.

    A run is stored with the ids of its body, its settings and its scene. Several designs may have equal bodies and
    settings, and several samples may have equal scenes; then these ids are equal, too.
    """
    designs_by_ids: dict[tuple[int, int], list[int]] = {}
    for design_index, ids in enumerate(keys.designs):
        designs_by_ids.setdefault(ids, []).append(design_index)
    # A run in one of several equal scenes belongs to the first of their samples.
    sample_by_scene: dict[int, int] = {}
    for sample, scene_id in keys.scenes.items():
        sample_by_scene.setdefault(scene_id, sample)
    where = "WHERE build_id = ? AND spread_id = ? AND number < ?"
    for row in store.rows(REALITY_RUN, where, keys.build_id, keys.spread_id, keys.planned):
        equal_designs = designs_by_ids.get((row["body_id"], row["settings_id"]))
        sample_of_run = sample_by_scene.get(row["scene_id"])
        if equal_designs is None or sample_of_run is None:
            # The experiment no longer has the design or the scene of the run.
            continue
        yield _StoredRun(
            number=row["number"],
            sample=sample_of_run,
            design=_design_of_run(row["number"], equal_designs),
            scores=json.loads(row["scores"]),
            passed=np.nan if row["passed"] is None else row["passed"],
        )


def _design_of_run(number: int, equal_designs: Sequence[int]) -> int:
    """Return to which of several equal designs the run with this number belongs.

    The runs are numbered, and every BLOCK numbers belong to the next of the designs. A block is not divided, because
    some of its runs must have the same design.
    """
    block = number // BLOCK
    return equal_designs[block % len(equal_designs)]


def stored_keys(store: ReadableStore, keys: RealityKeys) -> set[tuple[int, int, int, int]]:
    """Return (number, body id, settings id, scene id) of each stored run with the build and the spread of ``keys``."""
    rows = store.rows(REALITY_RUN, "WHERE build_id = ? AND spread_id = ?", keys.build_id, keys.spread_id)
    return {(row["number"], row["body_id"], row["settings_id"], row["scene_id"]) for row in rows}
