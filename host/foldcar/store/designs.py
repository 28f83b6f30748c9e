"""The designs that experiments of a store have, how many runs of each are stored, how many count and passed."""

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
    """Lists in the order of designs: position, stored runs, those that passed, and 1 + the highest stored sample.

    ``counted`` are the stored runs that belong in a rate: all but the rejected ones.
    """

    positions: list[int]
    runs: list[int]
    counted: list[int]
    passed: list[int]
    reached: list[int]


def design_counts(path: Path, connection: Connection, experiment: str) -> DesignCounts:
    """The counts of the experiment's designs, also of those without runs; StoreError."""
    with store_errors(path):
        designs = "SELECT position FROM design WHERE experiment = ? ORDER BY position"
        positions = [position for (position,) in connection.execute(designs, (experiment,))]
        found = connection.execute(
            f"SELECT d.position, count(*), sum(r.outcome <> '{REJECTED}'), sum(r.outcome = 'passed'), max(s.sample) + 1 "
            f"{RESULT_JOIN} AND e.id = ? GROUP BY d.position",
            (experiment,),
        )
        counts = {position: tuple(numbers) for position, *numbers in found}
    columns = ([counts.get(at, (0, 0, 0, 0))[which] for at in positions] for which in range(4))
    return DesignCounts(positions, *columns)


@dataclass(frozen=True)
class StoredDesigns:
    """Parameters by column, in the order of designs; ``fingerprint`` is the hash of all that the designs follow from."""

    fingerprint: str
    parameters: list[Mapping[str, float]]


def stored_designs(path: Path, experiments: Iterable[str]) -> dict[str, StoredDesigns]:
    """The whole designs of these experiments. A store that is missing, damaged or older holds none that are known."""
    if not path.is_file():
        return {}
    try:
        with contextlib.closing(connect_reading(path)) as connection:
            found = {name: designs_of(path, connection, name) for name in experiments}
    except StoreError:
        # What opens it to write will say so.
        return {}
    return {name: designs for name, designs in found.items() if designs is not None}


def designs_of(path: Path, connection: Connection, experiment: str) -> StoredDesigns | None:
    """The designs of an experiment; None if they are not whole, or if it is not known what they follow from."""
    with contextlib.suppress(StoreError):
        for row in read_rows(path, connection, EXPERIMENT, "WHERE id = ?", experiment):
            rows = list(read_rows(path, connection, DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
            whole = [one["position"] for one in rows] == list(range(row["designs"] or 0))
            if row["designs_fingerprint"] is not None and whole:
                parameters = [json.loads(one["parameters"]) for one in rows]
                return StoredDesigns(row["designs_fingerprint"], parameters)
    return None
