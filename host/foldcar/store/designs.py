"""The designs of a store's experiments, with their numbers of stored, counted and passed runs."""

import contextlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from sqlite3 import Connection
from typing import NamedTuple

from foldcar.simulation.results import REJECTED
from foldcar.store.connection import connect_reading
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.rows import read_row, read_rows
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


class _Counts(NamedTuple):
    """The counts of one design; see DesignCounts."""

    runs: int
    counted: int
    passed: int
    reached: int


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
        counts_by_position = {position: _Counts(*counts) for position, *counts in rows}
    no_runs = _Counts(runs=0, counted=0, passed=0, reached=0)
    counts = [counts_by_position.get(position, no_runs) for position in positions]
    return DesignCounts(
        positions=positions,
        runs=[design.runs for design in counts],
        counted=[design.counted for design in counts],
        passed=[design.passed for design in counts],
        reached=[design.reached for design in counts],
    )


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
    """Return the designs of an experiment.

    Returns None if the experiment is not stored, if its designs are incomplete or damaged, or if they have no
    fingerprint.
    """
    try:
        stored_experiment = read_row(path, connection, EXPERIMENT, id=experiment)
        designs = list(read_rows(path, connection, DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
    except StoreError:
        return None
    fingerprint = stored_experiment["designs_fingerprint"]
    if fingerprint is None:
        return None
    # A killed sweep may have stored fewer designs than the experiment has, or not even their number.
    design_count = stored_experiment["designs"] or 0
    positions = [design["position"] for design in designs]
    if positions != list(range(design_count)):
        return None
    return StoredDesigns(fingerprint, [json.loads(design["parameters"]) for design in designs])
