"""How many runs of each design of an experiment are stored, how many of them count, and how many passed."""

from dataclasses import dataclass
from pathlib import Path
from sqlite3 import Connection

from foldcar.simulation.results import REJECTED
from foldcar.store.errors import store_errors
from foldcar.store.tables import RESULT_JOIN


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
