"""Reads the runs of an experiment in other realities, from which the success rate of built cars is learned.

Input: a store that is opened for reading or writing. Output: an experiment's runs as arrays, and the ids of its designs,
scenes and realities. Runs of other builds, designs, scenes or priors stay in the store and are not read.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from foldcar.store.errors import StoreError
from foldcar.store.rows import Row
from foldcar.store.tables import DESIGN, EXPERIMENT, REALITY_RUN, SAMPLE, SPREAD, Table

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
IntArray = np.ndarray[Any, np.dtype[np.intp]]
# Of each BLOCK of numbers, the first CHECK runs share a reality and a design, and differ in scene, car and start.
BLOCK, CHECK = 100, 20


class ReadableStore(Protocol):
    """A Store, or a StoreConnection."""

    path: Path

    def rows(self, table: Table, rest: str = "", *values: Any) -> Iterable[Row]:
        """Return rows of a table; ``rest`` is SQL from WHERE on."""


@dataclass(frozen=True)
class RealityRuns:
    """Runs of one experiment in realities of their own, in ascending order of their numbers.

    ``scores`` (n, parameters) are the realities' parameters in the order of belief/priors.py. ``design`` (n,) is the
    index of the design in the experiment's order, ``sample`` (n,) the scene's sample. ``passed`` (n,) is 1 if the run
    passed, 0 if not, NaN if its simulation failed. ``number`` (n,) is the run's number.
    """

    scores: FloatArray
    design: IntArray
    sample: IntArray
    passed: FloatArray
    number: IntArray

    def __len__(self) -> int:
        return len(self.passed)

    def taken(self, chosen: np.ndarray[Any, Any]) -> "RealityRuns":
        """Return the runs that a mask or indices choose."""
        arrays = (self.scores, self.design, self.sample, self.passed, self.number)
        return RealityRuns(*(array[chosen] for array in arrays))


@dataclass(frozen=True)
class RealityKeys:
    """The ids of an experiment's runs in other realities.

    ``planned`` is their number. ``designs`` are the ids (body, settings) of the designs in their order. ``scenes`` has
    the scene's id by sample.
    """

    planned: int
    build_id: int
    spread_id: int
    designs: list[tuple[int, int]]
    scenes: dict[int, int]


def reality_keys(store: ReadableStore, experiment: str) -> RealityKeys | None:
    """Return the ids of an experiment's runs in other realities; None if its last sweep planned no such runs."""
    for row in store.rows(EXPERIMENT, "WHERE id = ?", experiment):
        facts = json.loads(row["facts"])
        for spread_row in store.rows(SPREAD, "WHERE fingerprint = ?", facts.get("reality_spread")):
            designs = store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment)
            of_environment = "WHERE environment_id = ? AND sample < ? ORDER BY sample"
            samples = store.rows(SAMPLE, of_environment, row["environment_id"], row["environments"])
            return RealityKeys(
                facts.get("realities", 0),
                row["build_id"],
                spread_row["id"],
                [(design["body_id"], design["settings_id"]) for design in designs],
                {sample["sample"]: sample["scene_id"] for sample in samples},
            )
    return None


def read_reality_runs(store: ReadableStore, experiment: str) -> RealityRuns:
    """Return the stored runs of ``experiment`` in other realities, without runs if there are none. Raises StoreError.

    If an earlier sweep made more runs than the last one planned, these are not read.

    Example: ``read_reality_runs(store, "1").passed.mean()``
    """
    keys = reality_keys(store, experiment)
    found: list[tuple[int, int, int, list[float], float]] = []
    if keys is not None:
        # Designs may have equal bodies, and samples equal scenes.
        positions: dict[tuple[int, int], list[int]] = {}
        for position, design in enumerate(keys.designs):
            positions.setdefault(design, []).append(position)
        samples = {scene: sample for sample, scene in reversed(keys.scenes.items())}
        planned = "WHERE build_id = ? AND spread_id = ? AND number < ?"
        for row in store.rows(REALITY_RUN, planned, keys.build_id, keys.spread_id, keys.planned):
            equal_designs = positions.get((row["body_id"], row["settings_id"]))
            if equal_designs is not None and row["scene_id"] in samples:
                number, passed = row["number"], row["passed"]
                # The same for all runs of a block, because some of them share a design.
                design = equal_designs[number // BLOCK % len(equal_designs)]
                scores = json.loads(row["scores"])
                found.append((number, samples[row["scene_id"]], design, scores, np.nan if passed is None else passed))
    found.sort()
    if len({len(scores) for _, _, _, scores, _ in found}) > 1:
        raise StoreError(f"{store.path}: reality_run is damaged: its rows have different numbers of scores")
    return RealityRuns(
        scores=np.array([scores for _, _, _, scores, _ in found], dtype=float).reshape(len(found), -1 if found else 0),
        design=np.array([design for _, _, design, _, _ in found], dtype=np.intp),
        sample=np.array([sample for _, sample, _, _, _ in found], dtype=np.intp),
        passed=np.array([passed for _, _, _, _, passed in found], dtype=float),
        number=np.array([number for number, _, _, _, _ in found], dtype=np.intp),
    )


def stored_keys(store: ReadableStore, keys: RealityKeys) -> set[tuple[int, int, int, int]]:
    """Return number and ids (number, body, settings, scene) of the stored runs with that build and these realities."""
    rows = store.rows(REALITY_RUN, "WHERE build_id = ? AND spread_id = ?", keys.build_id, keys.spread_id)
    return {(row["number"], row["body_id"], row["settings_id"], row["scene_id"]) for row in rows}
