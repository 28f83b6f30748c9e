"""Finds the whole rows of a damaged store: on every page that is in use, those that match their checksums.

Input: a store's path, which is only read. Output: rows by table and key, and what is seen to be damaged. SQLite is not
asked: a damaged page costs the rows on it and no others, a damaged schema or inner page costs none.
"""

import contextlib
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from foldcar.store.errors import StoreError
from foldcar.store.pages import Pages, Record, page_bytes
from foldcar.store.rows import Row, is_intact
from foldcar.store.tables import BY_NAME, CALIBRATION, CHECKSUM, RUN, TABLES, TRIAL, Table
from foldcar.store.write_ahead_log import WriteAheadLog, read_log

HEADER_BYTES = 100
# What stands in the texts of tables that have the same columns.
_TELLING = {"body": "segments", "scene": "terrain", "settings": "time_limit_s"}


@dataclass(slots=True)
class Salvaged:
    """Whole rows by table and key. ``damaged`` counts, by table, rows and pages that were seen and are not whole.

    ``ambiguous`` counts keys of which there are two different whole rows, neither of them known to be the last. ``log``
    says what is damaged of the write-ahead log: rows may be as they were before the transactions in it.
    """

    rows: dict[str, dict[tuple[Any, ...], Row]] = field(default_factory=lambda: {table.name: {} for table in TABLES})
    damaged: Counter[str] = field(default_factory=Counter)
    pages: Counter[str] = field(default_factory=Counter)
    ambiguous: Counter[str] = field(default_factory=Counter)
    log: str | None = None


def salvage(path: Path) -> Salvaged:
    """The whole rows of the store at ``path``; StoreError if it cannot be read, or if its version proves no rows."""
    log = read_log(path)
    pages, loose = _pages(path, log)
    done = Salvaged(log=log.finding)
    schema = dict(_schema(pages))
    version = pages.version()
    # Where a table's pages are is not known without its place in the schema.
    done.pages.update(t.name for t in TABLES if t.name not in schema and not (t is CALIBRATION and version == 5))
    columns = {table.name: _columns(table, schema.get(table.name, (0, ""))[1], version) for table in TABLES}
    if CHECKSUM not in columns[RUN.name] or "withdrawn" not in columns[TRIAL.name]:
        raise StoreError(f"{path}: is of version {version}: rows of versions 1 to 4 cannot be proved to be whole")
    owners: dict[int, str] = {}
    free = pages.free()
    for name, (root, _) in schema.items():
        if name in BY_NAME:
            for number in pages.tree(root, lambda name=name: done.pages.update([name])):  # type: ignore[misc]
                owners.setdefault(number, name)
    # With the list of free pages lost, pages outside of the trees may hold rows that were replaced.
    live = set(owners) if free is None else pages.numbers() - free
    for number in sorted(live):
        owner = owners.get(number)
        broken: list[None] = []
        found = list(pages.records(number, lambda broken=broken: broken.append(None)))  # type: ignore[misc]
        unknown = sum(not _keep(done, columns, record, owner) for record in found)
        if owner is not None:
            done.damaged[owner] += unknown + len(broken)
    for page in loose:
        for record in pages.records_of(page):
            _keep(done, columns, record, None, replaces=False)
    for name, count in done.ambiguous.items():
        rows = done.rows[name]
        for key in [key for key, row in rows.items() if not row]:
            del rows[key]
        done.damaged[name] += count
    return done


def _pages(path: Path, log: WriteAheadLog) -> tuple[Pages, list[bytes]]:
    """The store's pages with its write-ahead log, and pages of the log whose numbers are not certain."""
    try:
        content = _rolled_back(path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    if len(content) < HEADER_BYTES:
        raise StoreError(f"{path}: is no foldcar store: it has {len(content)} bytes")
    size = page_bytes(content)
    pages = {at // size + 1: content[at : at + size] for at in range(0, len(content), size)}
    pages.update((number, page) for number, page in log.pages if len(page) == size)
    return Pages(pages, size), [page for page in log.damaged if len(page) == size]


def _rolled_back(path: Path) -> bytes:
    """The file's bytes; those of a copy in which SQLite has undone a transaction that was cut short, if one was."""
    journal = path.resolve().with_name(f"{path.resolve().name}-journal")
    if not journal.is_file() or journal.stat().st_size == 0:
        return path.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "store"
        shutil.copyfile(path, copy)
        shutil.copyfile(journal, Path(f"{copy}-journal"))
        with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(copy)) as connection:
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        return copy.read_bytes()


def _schema(pages: Pages) -> Iterator[tuple[str, tuple[int, str]]]:
    """The tables that the file's schema names, with their root pages and declarations."""
    for number in pages.tree(1, lambda: None):
        for record in pages.records(number):
            match record.cells:
                case ("table", str(name), _, int(root), str(sql)):
                    yield name, (root, sql)


def _columns(table: Table, sql: str, version: int) -> Sequence[str]:
    """The columns in the order of records: those of a key of several first, a metric that came later last."""
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(":memory:")) as connection:
        connection.execute(sql)
        told = connection.execute(f"PRAGMA table_info({table.name})").fetchall()
        if len(table.key) > 1:
            told.sort(key=lambda one: one[-1] or len(told) + one[0])
        found = [str(name) for _, name, *_ in told]
        # A damaged name is none of a column.
        if found and not set(found) - {*table.names, CHECKSUM}:
            return found
    first = table.order if version >= 7 else ()
    return (*first, *(name for name in table.names if name not in first), CHECKSUM)


def _keep(
    done: Salvaged, columns: dict[str, Sequence[str]], record: Record, owner: str | None, replaces: bool = True
) -> bool:
    """Keep a record that is a whole row; whether it is one. ``replaces`` is false for a doubtful copy."""
    tables = TABLES if owner is None else (BY_NAME[owner],)
    whole = [(table, row) for table in tables for row in _row(table, columns, record) if is_intact(table, row)]
    if len(whole) > 1:
        # Tables with the same columns: texts tell by their content.
        whole = [(table, row) for table, row in whole if f'"{_TELLING.get(table.name)}":' in str(row.get("json"))]
    if len(whole) != 1:
        return False
    ((table, row),) = whole
    rows, key = done.rows[table.name], tuple(row[name] for name in table.key)
    if key not in rows:
        rows[key] = row
    elif rows[key] and rows[key] != row and replaces:
        rows[key] = {}
        done.ambiguous[table.name] += 1
    return True


def _row(table: Table, columns: dict[str, Sequence[str]], record: Record) -> Iterator[Row]:
    """The record as a row of that table, if it can be one."""
    names = columns[table.name]
    numbered = len(table.key) == 1
    if (record.rowid is not None) is not numbered or len(record.cells) > len(names):
        return
    row: Row = dict.fromkeys((*table.names, CHECKSUM))
    row.update(zip(names, record.cells, strict=False))
    if not isinstance(row[CHECKSUM], int):
        return
    if table.columns[0].type == "INTEGER" and numbered and row["id"] is None:
        row["id"] = record.rowid
    for column in table.columns:
        # SQLite stores whole numbers of such columns as integers.
        if column.type == "REAL" and isinstance(row[column.name], int):
            row[column.name] = float(row[column.name])
    yield row
