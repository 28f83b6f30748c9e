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
    """Lists in the order of designs: position, numbers of stored and passed runs, and the highest stored sample + 1.

    ``counted`` are the stored runs that were not rejected.
    """

    positions: list[int]
    runs: list[int]
    counted: list[int]
    passed: list[int]
    reached: list[int]


def design_counts(path: Path, connection: Connection, experiment: str) -> DesignCounts:
    """Count the stored runs of each design of an experiment; designs without runs have zeros. Raises StoreError."""
    with store_errors(path):
        designs = "SELECT position FROM design WHERE experiment = ? ORDER BY position"
        positions = [position for (position,) in connection.execute(designs, (experiment,))]
        rows = connection.execute(
            f"SELECT d.position, count(*), sum(r.outcome <> '{REJECTED}'), sum(r.outcome = 'passed'), max(s.sample) + 1 "
            f"{RESULT_JOIN} AND e.id = ? GROUP BY d.position",
            (experiment,),
        )
        counts = {position: tuple(numbers) for position, *numbers in rows}
    # Four lists: runs, runs that count, passed runs, and the samples up to the last one with a run.
    columns = ([counts.get(position, (0, 0, 0, 0))[column] for position in positions] for column in range(4))
    return DesignCounts(positions, *columns)


@dataclass(frozen=True)
class StoredDesigns:
    """A family's designs as stored: their ``parameters`` by column, in order.

    ``fingerprint`` is a hash of everything that they depend on.
    """

    fingerprint: str
    parameters: list[Mapping[str, float]]


def stored_designs(path: Path, experiments: Iterable[str]) -> dict[str, StoredDesigns]:
    """Return the designs of those of the experiments that have them completely, by id.

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
        for row in read_rows(path, connection, EXPERIMENT, "WHERE id = ?", experiment):
            rows = list(read_rows(path, connection, DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
            is_complete = [design_row["position"] for design_row in rows] == list(range(row["designs"] or 0))
            if row["designs_fingerprint"] is not None and is_complete:
                parameters = [json.loads(design_row["parameters"]) for design_row in rows]
                return StoredDesigns(row["designs_fingerprint"], parameters)
    return None
