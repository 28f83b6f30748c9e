"""The designs of a store's experiments, with their numbers of stored, counted and passed runs."""

import contextlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from sqlite3 import Connection

from foldcar.simulation.results import REJECTED
from foldcar.store.connection import connect_reading
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.rows import read_rows
from foldcar.store.tables import DESIGN, EXPERIMENT, RESULT_JOIN


@dataclass(frozen=True)
class DesignCounts:
    """How many runs of each design are stored. The lists have one entry for each design, in the designs' order.

    ``positions`` are the designs' places in the family, from 0. ``runs`` are the numbers of stored runs, ``counted`` of
    those that were not rejected, ``passed`` of those that passed. ``reached`` is 1 plus the number of the last sample
    that the design has a run in.
    """

    positions: list[int]
    runs: list[int]
    counted: list[int]
    passed: list[int]
    reached: list[int]


def design_counts(path: Path, connection: Connection, experiment: str) -> DesignCounts:
    """Count the stored runs of each design of an experiment. Raises StoreError.

    All counts of a design without runs are 0.
    """
    with store_errors(path):
        designs_query = "SELECT position FROM design WHERE experiment = ? ORDER BY position"
        positions = [position for (position,) in connection.execute(designs_query, (experiment,))]
        # The letters are those of RESULT_JOIN: d is the table of designs, s of samples, r of runs, e of experiments.
        rows = connection.execute(
            f"SELECT d.position, count(*), sum(r.outcome <> '{REJECTED}'), sum(r.outcome = 'passed'), max(s.sample) + 1 "
            f"{RESULT_JOIN} AND e.id = ? GROUP BY d.position",
            (experiment,),
        )
        counts_by_position = {position: counts for position, *counts in rows}
    result = DesignCounts(positions, runs=[], counted=[], passed=[], reached=[])
    for position in positions:
        runs, counted, passed, reached = counts_by_position.get(position, (0, 0, 0, 0))
        result.runs.append(runs)
        result.counted.append(counted)
        result.passed.append(passed)
        result.reached.append(reached)
    return result


@dataclass(frozen=True)
class StoredDesigns:
    """The designs of a family as stored: the ``parameters`` of each by name, in the family's order.

    ``fingerprint`` is a hash of everything that the designs depend on.
    """

    fingerprint: str
    parameters: list[Mapping[str, float]]


def stored_designs(path: Path, experiments: Iterable[str]) -> dict[str, StoredDesigns]:
    """Return the stored designs of experiments by the experiment's id; experiments with incomplete designs are left out.

    Returns {} if the store is missing, damaged or of another version.
    """
    if not path.is_file():
        return {}
    try:
        with contextlib.closing(connect_reading(path)) as connection:
            designs_by_experiment = {name: designs_of(path, connection, name) for name in experiments}
    except StoreError:
        # Opening the store for writing will report the error.
        return {}
    return {name: designs for name, designs in designs_by_experiment.items() if designs is not None}


def designs_of(path: Path, connection: Connection, experiment: str) -> StoredDesigns | None:
    """Return the designs of an experiment; None if they are incomplete or have no fingerprint."""
    with contextlib.suppress(StoreError):
        for experiment_row in read_rows(path, connection, EXPERIMENT, "WHERE id = ?", experiment):
            designs = list(read_rows(path, connection, DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
            positions = [design["position"] for design in designs]
            # A killed sweep may have stored fewer designs than the experiment has.
            is_complete = positions == list(range(experiment_row["designs"] or 0))
            fingerprint = experiment_row["designs_fingerprint"]
            if fingerprint is not None and is_complete:
                parameters = [json.loads(design["parameters"]) for design in designs]
                return StoredDesigns(fingerprint, parameters)
    return None
