"""The designs that experiments of a store have, to see without folding a car whether a sweep's are the same."""

import contextlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from sqlite3 import Connection

from foldcar.store.errors import StoreError
from foldcar.store.opening import connect_reading, require_version
from foldcar.store.rows import parsed, read_rows
from foldcar.store.tables import DESIGN, EXPERIMENT


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
            require_version(path, connection)
            found = {name: designs_of(path, connection, name) for name in experiments}
    except StoreError:
        # What opens it to write will say so.
        return {}
    return {name: designs for name, designs in found.items() if designs is not None}


def designs_of(path: Path, connection: Connection, experiment: str) -> StoredDesigns | None:
    """The designs of an experiment; None if they are not whole, or if it is not known what they follow from."""
    try:
        for row in read_rows(path, connection, EXPERIMENT, "WHERE id = ?", experiment):
            rows = list(read_rows(path, connection, DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
            whole = [one["position"] for one in rows] == list(range(row["designs"] or 0))
            if row["designs_fingerprint"] is not None and whole:
                parameters = [parsed(path, DESIGN, one, "parameters") for one in rows]
                return StoredDesigns(row["designs_fingerprint"], parameters)
    except StoreError:
        pass
    return None
