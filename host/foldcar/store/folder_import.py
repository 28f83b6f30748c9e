"""Makes a store of a folder that :mod:`foldcar.store.folder_export` wrote, whole or not at all.

Every value is checked; what is missing, damaged or leads out of the folder is a StoreError that names file, row and
column. The store is written under a temporary name first.
"""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.store.errors import StoreError
from foldcar.store.folder import KIND, LISTING, LOGS, MANIFEST
from foldcar.store.folder_tables import FORMATS, read_table
from foldcar.store.log_files import log_file, log_inside, sha256_of
from foldcar.store.migrations import VERSION
from foldcar.store.opening import check_new, new_store
from foldcar.store.rows import Row, insert_sql
from foldcar.store.tables import STUDY, TABLES, TRIAL, Table


def import_folder(folder: Path, store: Path) -> dict[str, Any]:
    """Make the store at ``store``, which must not exist, and the logs beside it; gives the folder's manifest."""
    check_new(store)
    manifest = _manifest(folder)
    with new_store(store) as (connection, logs):
        for table in TABLES:
            _import_table(connection, table, folder, manifest)
        _check_references(connection, folder, manifest)
        for log, digest in manifest["logs"].items():
            if digest is not None:
                source = folder / LOGS / log_inside(folder / LOGS, log, f"{folder / MANIFEST}: logs")
                logs.append((source, log_file(store, log), digest))
    return manifest


def _manifest(folder: Path) -> dict[str, Any]:
    file = folder / MANIFEST
    if not folder.is_dir():
        raise StoreError(f"{folder}: not a folder")
    try:
        manifest = json.loads(file.read_text(encoding="utf-8"))
        kind, version = manifest["kind"], manifest["version"]
        sound = (
            manifest["format"] in FORMATS
            and set(manifest["rows"]) == {table.name for table in TABLES}
            and all(isinstance(rows, int) for rows in manifest["rows"].values())
            and all(digest is None or isinstance(digest, str) for digest in manifest["logs"].values())
            and all(isinstance(name, str) for name in manifest["files"])
        )
    except OSError as error:
        raise StoreError(f"{file}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise StoreError(f"{file}: is no manifest of an exported store") from None
    if kind != KIND:
        raise StoreError(f'{file}: kind: is not "{KIND}"')
    if version != VERSION:
        raise StoreError(f"{file}: version: is {version!r}, this foldcar imports folders of version {VERSION}")
    if not sound:
        raise StoreError(f"{file}: is no manifest of an exported store")
    for name in manifest["files"]:
        if not (folder / log_inside(folder, name, f"{file}: files")).is_file():
            raise StoreError(f"{folder / name}: is missing")
    result: dict[str, Any] = manifest
    return result


def _import_table(connection: sqlite3.Connection, table: Table, folder: Path, manifest: dict[str, Any]) -> None:
    file = folder / f"{table.name}.{manifest['format']}"
    log_inside(folder, file.name, f"{file}")
    count = 0

    def rows() -> Iterator[tuple[Any, ...]]:
        nonlocal count
        for count, row in enumerate(read_table(table, file, manifest["format"]), 1):
            if table is TRIAL:
                _check_log(row, file, count, folder, manifest)
            if table is STUDY and row["key"] == "listing_text":
                _check_listing(folder, row["value"])
            yield tuple(row.values())

    try:
        connection.executemany(insert_sql(table), rows())
    except sqlite3.IntegrityError:
        raise StoreError(f"{file}: row {count}: {', '.join(table.key)}: is there twice") from None
    if count != manifest["rows"][table.name]:
        raise StoreError(f"{file}: has {count} rows, {MANIFEST} says {manifest['rows'][table.name]}")


def _check_log(row: Row, file: Path, number: int, folder: Path, manifest: dict[str, Any]) -> None:
    if row["log"] is None:
        return
    where = f"{file}: row {number}: log"
    log = log_inside(folder / LOGS, row["log"], where)
    if row["log"] not in manifest["logs"]:
        raise StoreError(f"{where}: {MANIFEST} does not know it")
    expected = manifest["logs"][row["log"]]
    if expected is not None and sha256_of(folder / LOGS / log) != expected:
        raise StoreError(f"{folder / LOGS / log}: does not match its SHA-256 in {MANIFEST}")


def _check_listing(folder: Path, text: str) -> None:
    file = folder / LISTING
    try:
        with file.open(encoding="utf-8", newline="") as opened:
            same = opened.read() == text
    except (OSError, UnicodeDecodeError):
        same = False
    if not same:
        raise StoreError(f"{file}: is not the listing of the study")


def _check_references(connection: sqlite3.Connection, folder: Path, manifest: dict[str, Any]) -> None:
    for table, _, referred, _ in connection.execute("PRAGMA foreign_key_check"):
        raise StoreError(f"{folder / table}.{manifest['format']}: refers to a row of {referred} that is not there")
