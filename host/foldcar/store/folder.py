"""A store as a folder of files that need no foldcar, written whole or not at all, and the store made of it again.

| file | what |
|---|---|
| `README.txt` | every file and column explained, with units |
| `manifest.json` | version, format, rows of each table, SHA-256 of each log (null for logs that are gone), all files |
| `TABLE.csv` or `TABLE.parquet` | a table of the store, its rows in the order of their keys |
| `listing.json` | the listing as it was last swept, if any was |
| `logs/…` | logs of trials under the names that the table `trial` has for them |
"""

import contextlib
import csv
import itertools
import json
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from foldcar.outputs import atomic_folder
from foldcar.store.connection import transaction
from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file, log_inside, sha256_of
from foldcar.store.migrations import VERSION
from foldcar.store.opening import check_new, new_store
from foldcar.store.reader import Store
from foldcar.store.rows import Row, check_json, insert_sql, stored
from foldcar.store.tables import BY_NAME, CHECKSUM, STUDY, TABLES, TRIAL, Column, Table
from foldcar.typed import decimal_number, whole_number

MANIFEST, README, LISTING, LOGS = "manifest.json", "README.txt", "listing.json", "logs"
BATCH_ROWS = 10_000

_HEAD = """A results store of foldcar: designs of folding cars, the environments they were simulated in, the results, and
trials of built cars. `foldcar import FOLDER --store FILE` makes the store again.

Names of columns end with their unit: _s seconds, _m metres, _mm millimetres, _rad radians, _j joules, _m_s metres a
second, _utc date and time in UTC. JSON texts use the same.

{notation}

The column checksum, in every table, is the CRC-32 of the table's name and the row as a JSON object: its other columns
without the empty ones, in alphabetical order, without spaces, characters beyond ASCII as \\uXXXX. The columns before and
after of the table correction hold texts or numbers, as JSON; the checksum is of the values.

An experiment shows the runs whose build is its own, whose body and settings are those of one of its designs, whose
scene is that of one of its environment's samples below its number of environments, and whose variation is that of the
same sample of its spread.
"""
_TAIL = """listing.json: the listing as it was last swept (also in study.{kind}); absent if nothing was swept
logs/: logs of trials (MAVLink .tlog: 8 bytes of time in us since 1970, big endian, then a packet)
manifest.json: version, format, number of rows of each table, SHA-256 of each log, all files
"""
_NOTATION = {
    "csv": "Tables are CSV files in UTF-8 with a header line. Texts stand in double quotes, numbers without; an empty\n"
    "cell is a value that is not there. Texts may hold line breaks.",
    "parquet": "Tables are Parquet files. A null is a value that is not there.",
}


@dataclass(frozen=True)
class Manifest:
    """What manifest.json holds: ``rows`` by table, ``logs`` with their SHA-256, None if they are gone."""

    kind: Literal["foldcar store"]
    version: int
    format: Literal["csv", "parquet"]
    rows: dict[str, int]
    logs: dict[str, str | None]
    files: list[str]


_MANIFEST = TypeAdapter(Manifest)


def export_folder(store: Store, folder: Path, kind: Literal["csv", "parquet"]) -> Manifest:
    """Write ``folder``, tables as ``csv`` or ``parquet``.

    FoldcarError if the folder holds anything but an earlier export, cannot be written, or if a row is damaged. Logs
    that are gone are null in the manifest's ``logs``; the others are copied as they are.
    """
    write = _write_csv if kind == "csv" else _write_parquet
    with atomic_folder(folder, MANIFEST) as target:
        rows = dict.fromkeys((table.name for table in TABLES), 0)
        for table in TABLES:
            write(table, _rows(store, table, rows), target / f"{table.name}.{kind}")
        logs = {row["log"]: _copy_log(store, row["log"], target) for row in store.rows(TRIAL, "WHERE log IS NOT NULL")}
        (target / README).write_text(_readme(kind), encoding="utf-8")
        for row in store.rows(STUDY, "WHERE key = 'listing_text'"):
            (target / LISTING).write_text(row["value"], encoding="utf-8", newline="")
        files = [str(file.relative_to(target)) for file in target.rglob("*") if file.is_file()]
        manifest = Manifest("foldcar store", VERSION, kind, rows, logs, sorted([MANIFEST, *files]))
        (target / MANIFEST).write_text(json.dumps(asdict(manifest), indent=1) + "\n", encoding="utf-8")
    return manifest


def _rows(store: Store, table: Table, counts: dict[str, int]) -> Iterator[Row]:
    """The rows as files have them, which are counted."""
    mixed = _mixed(table)
    for row in store.rows(table, f"ORDER BY {', '.join(table.key)}"):
        counts[table.name] += 1
        yield {**row, **{name: json.dumps(row[name]) for name in mixed if row[name] is not None}}


def _copy_log(store: Store, log: str, target: Path) -> str | None:
    """Copy a log into the folder; its SHA-256, None if it is gone."""
    source = log_file(store.path, log)
    if source.is_file():
        copy = target / LOGS / log
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    return sha256_of(source)


def _readme(kind: str) -> str:
    lines = [_HEAD.format(notation=_NOTATION[kind])]
    for table in TABLES:
        lines.append(f"{table.name}.{kind}: a row is {table.meaning}; told apart by {', '.join(table.key)}")
        for column in table.columns:
            refers = f" (id in {column.refers}.{kind})" if column.refers else ""
            choices = f": {', '.join(column.choices)}" if column.choices else ""
            json = "; JSON" if column.type in ("JSON", "VALUE") else ""
            lines.append(f"    {column.name}: {column.meaning}{choices}{refers}{json}")
        lines.append("")
    return "\n".join([*lines, _TAIL.format(kind=kind)])


def import_folder(folder: Path, store: Path) -> Manifest:
    """Make the store at ``store``, which must not exist, and the logs beside it; gives the folder's manifest.

    Every value is checked; what is missing, damaged or leads out of the folder is a StoreError that names file, row and
    column, and nothing is written.
    """
    check_new(store)
    manifest = _manifest(folder)
    with new_store(store) as (connection, logs), transaction(store, connection), _long_texts():
        for table in TABLES:
            _import_table(connection, table, folder, manifest)
        for name, _, referred, _ in connection.execute("PRAGMA foreign_key_check"):
            raise StoreError(f"{folder / name}.{manifest.format}: refers to a row of {referred} that is not there")
        for log, digest in manifest.logs.items():
            if digest is not None:
                source = folder / LOGS / log_inside(folder / LOGS, log, f"{folder / MANIFEST}: logs")
                if sha256_of(source) != digest:
                    raise StoreError(f"{source}: does not match its SHA-256 in {MANIFEST}")
                logs.append((source, log_file(store, log), digest))
    return manifest


def _manifest(folder: Path) -> Manifest:
    file = folder / MANIFEST
    if not folder.is_dir():
        raise StoreError(f"{folder}: not a folder")
    try:
        manifest = _MANIFEST.validate_json(file.read_bytes())
    except OSError as error:
        raise StoreError(f"{file}: cannot be read: {error.strerror}") from None
    except ValidationError:
        raise StoreError(f"{file}: is no manifest of an exported store") from None
    if manifest.version != VERSION:
        raise StoreError(f"{file}: version: is {manifest.version}, this foldcar imports folders of version {VERSION}")
    if manifest.rows.keys() != BY_NAME.keys():
        raise StoreError(f"{file}: rows: does not name the tables of version {VERSION}")
    for name in manifest.files:
        if not (folder / log_inside(folder, name, f"{file}: files")).is_file():
            raise StoreError(f"{folder / name}: is missing")
    return manifest


def _import_table(connection: sqlite3.Connection, table: Table, folder: Path, manifest: Manifest) -> None:
    file = folder / f"{table.name}.{manifest.format}"
    log_inside(folder, file.name, f"{file}")
    count = 0

    def rows() -> Iterator[tuple[Any, ...]]:
        nonlocal count
        for count, row in enumerate(_read_table(table, file, manifest.format), 1):
            if table is TRIAL and row["log"] is not None:
                log_inside(folder / LOGS, row["log"], f"{file}: row {count}: log")
                if row["log"] not in manifest.logs:
                    raise StoreError(f"{file}: row {count}: log: {MANIFEST} does not know it")
            yield tuple(row.values())

    try:
        connection.executemany(insert_sql(table), rows())
    except sqlite3.IntegrityError:
        raise StoreError(f"{file}: row {count}: {', '.join(table.key)}: is there twice") from None
    if count != manifest.rows[table.name]:
        raise StoreError(f"{file}: has {count} rows, {MANIFEST} says {manifest.rows[table.name]}")


def _read_table(table: Table, file: Path, kind: str) -> Iterator[Row]:
    """Rows of a file with their checksums; StoreError that names file, row (from 1) and column."""
    read: Callable[[Table, Path], Iterator[Row]] = _read_csv if kind == "csv" else _read_parquet
    rows = read(table, file)
    for number in itertools.count(1):
        try:
            cells = next(rows, None)
            if cells is None:
                return
            cells.update({name: json.loads(cells[name]) for name in _mixed(table) if cells[name] is not None})
            row = stored(table, cells)
            check_json(table, row)
            if cells[CHECKSUM] != row[CHECKSUM]:
                raise ValueError(f"{CHECKSUM}: does not match the row, which was changed after its export")
        except UnicodeDecodeError:
            raise StoreError(f"{file}: row {number} or later: is no UTF-8 text") from None
        except (ValueError, csv.Error) as error:
            raise StoreError(f"{file}: row {number}: {error}") from None
        except OSError as error:
            raise StoreError(f"{file}: cannot be read: {error.strerror or error}") from None
        yield row


def _check_columns(table: Table, file: Path, found: list[str]) -> None:
    expected = [*table.names, CHECKSUM]
    for name in found:
        if name not in expected or found.count(name) > 1:
            raise StoreError(f'{file}: column "{name[:80]}" is unknown or there twice; known: {", ".join(expected)}')
    late = [column.name for column in table.columns if column.late]
    for name in expected:
        if name not in found and name not in late:
            raise StoreError(f'{file}: has no column "{name}"')


def _mixed(table: Table) -> list[str]:
    """The columns that hold texts or numbers: JSON in files."""
    return [column.name for column in table.columns if column.type == "VALUE"]


def _write_csv(table: Table, rows: Iterable[Row], file: Path) -> None:
    with file.open("w", encoding="utf-8", newline="") as text:
        text.write(",".join((*table.names, CHECKSUM)) + "\n")
        text.writelines(",".join(map(_csv_cell, row.values())) + "\n" for row in rows)


def _csv_cell(value: Any) -> str:
    if isinstance(value, str):
        return '"' + value.replace('"', '""') + '"'
    return "" if value is None else repr(value)


@contextlib.contextmanager
def _long_texts() -> Iterator[None]:
    """Within the block cells of CSV files may be as long as scenes are."""
    shorter = csv.field_size_limit(2**31 - 1)
    try:
        yield
    finally:
        csv.field_size_limit(shorter)


def _read_csv(table: Table, file: Path) -> Iterator[Row]:
    columns = {column.name: column for column in (*table.columns, Column(CHECKSUM, "INTEGER", ""))}
    with file.open(encoding="utf-8", newline="") as text:
        reader = csv.reader(text, strict=True)
        names = next(reader, [])
        _check_columns(table, file, names)
        for cells in reader:
            if len(cells) != len(names):
                raise ValueError(f"has {len(cells)} cells, the header {len(names)}")
            yield {name: _value(columns[name], cell) for name, cell in zip(names, cells, strict=True)}


def _value(column: Column, cell: str) -> Any:
    if column.type not in ("INTEGER", "REAL"):
        return None if column.null and not cell else cell
    try:
        return (whole_number if column.type == "INTEGER" else decimal_number)(cell) if cell else None
    except ValueError:
        whole = "whole " * (column.type == "INTEGER")
        raise ValueError(f"{column.name}: {cell[:80]!r} is no {whole}number") from None


def _write_parquet(table: Table, rows: Iterable[Row], file: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    of_type = {"INTEGER": pa.int64(), "REAL": pa.float64()}
    fields = [
        pa.field(column.name, of_type.get(column.type, pa.string()), metadata={"description": column.meaning})
        for column in table.columns
    ]
    schema = pa.schema([*fields, pa.field(CHECKSUM, pa.int64())])
    source = iter(rows)
    with pq.ParquetWriter(file, schema, write_page_checksum=True) as writer:
        while batch := list(itertools.islice(source, BATCH_ROWS)):
            writer.write_table(pa.Table.from_pylist(batch, schema=schema))


def _read_parquet(table: Table, file: Path) -> Iterator[Row]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(file, page_checksum_verification=True) as opened:
            _check_columns(table, file, opened.schema_arrow.names)
            for batch in opened.iter_batches(BATCH_ROWS):
                yield from batch.to_pylist()
    except (pa.ArrowException, MemoryError) as error:
        raise ValueError(f"is no Parquet that can be read: {str(error).splitlines()[0][:200]}") from None
