"""Stores of every version so far, as files (test/host/stores), and what is in a store, table by table."""

import contextlib
import gzip
import shutil
import sqlite3
from pathlib import Path
from typing import Any

from foldcar.simulation.results import NUMBERS
from foldcar.store.migrations import VERSION
from foldcar.store.rows import checksum
from foldcar.store.tables import BY_NAME, Table
from foldcar.store.trial_records import Track
from foldcar.store.trial_writer import write_trials

STORES = Path(__file__).parent / "stores"
VERSIONS = sorted(int(file.name[len("version_") : -len(".db.gz")]) for file in STORES.glob("version_*.db.gz"))

# Of the store's first trial.
TRACK = Track(1, "trial.mp4", "0" * 64, 1.25, "passed", {"end_s": 0.1}, [[0.05 * k, *[0.01 * k] * 15] for k in range(3)])


def old_store(version: int, path: Path) -> Path:
    """Make the store of that version at ``path``, with the logs of its trials beside it."""
    path.write_bytes(gzip.decompress((STORES / f"version_{version}.db.gz").read_bytes()))
    logs = STORES / f"version_{version}-logs"
    if logs.exists():
        shutil.copytree(logs, path.parent / "s-logs", dirs_exist_ok=True)
    with contextlib.closing(sqlite3.connect(path)) as connection:
        columns = {row[1] for row in connection.execute("PRAGMA table_info(run)")}
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if version == VERSION and not (columns.issuperset(NUMBERS) and tables.issuperset(BY_NAME)):
        # Today's carsim has metrics that the one of then had not; today's store has late tables.
        with write_trials(path) as writer:
            writer.put_track(TRACK)
            writer.put_media(1, "film", Path(__file__))
    return path


def contents(path: Path) -> dict[str, list[dict[str, Any]]]:
    """All rows of all tables, as SQLite itself reads them, without checksums."""
    with contextlib.closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        connection.row_factory = sqlite3.Row
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        found = {}
        for table in tables:
            rows = [dict(row) for row in connection.execute(f"SELECT * FROM {table}")]
            for row in rows:
                row.pop("checksum", None)
            found[table] = sorted(rows, key=lambda row: [str(value) for value in row.values()])
        return found


def change(store: Path, table: Table, where: str, **values: Any) -> None:
    """Give a row other values, with the right checksum: another simulator has written it."""
    with contextlib.closing(sqlite3.connect(store)) as connection:
        connection.row_factory = sqlite3.Row
        row = {**dict(connection.execute(f"SELECT * FROM {table.name} WHERE {where}").fetchone()), **values}
        row["checksum"] = checksum(table, row)
        changes = ", ".join(f"{name} = ?" for name in row)
        connection.execute(f"UPDATE {table.name} SET {changes} WHERE {where}", tuple(row.values()))
        connection.commit()


def alter(path: Path, statement: str) -> None:
    """Change a store behind foldcar's back."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute(statement)
        connection.commit()
