"""Tables of a store as CSV or Parquet files: rows written, and read back with every value checked.

CSV: UTF-8, a header line, lines end with a line feed. Texts stand in double quotes, numbers do not, and an empty cell
is NULL; so a column that holds texts or numbers keeps them apart. Numbers read back to the last bit. Parquet has the
types of its columns; a column of texts or numbers is JSON there.
"""

import itertools
import json
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from foldcar.store.errors import StoreError
from foldcar.store.rows import Row, check_json, stored
from foldcar.store.tables import CHECKSUM, Table
from foldcar.typed_numbers import decimal_number, whole_number

FORMATS = ("csv", "parquet")
BATCH_ROWS = 10_000

_CELL = re.compile(r'(?:"([^"]*(?:""[^"]*)*)"|([^",]*))(,|\Z)')


def write_table(table: Table, rows: Iterable[Row], file: Path, kind: str) -> int:
    """Write a table with its checksums; gives the number of rows. OSError."""
    return (_write_csv if kind == "csv" else _write_parquet)(table, rows, file)


def read_table(table: Table, file: Path, kind: str) -> Iterator[Row]:
    """Rows of a file with their checksums; StoreError that names file, row (from 1) and column."""
    read: Callable[[Table, Path], Iterator[Row]] = _read_csv if kind == "csv" else _read_parquet
    rows = read(table, file)
    for number in itertools.count(1):
        try:
            cells = next(rows, None)
            if cells is None:
                return
            row = stored(table, cells)
            check_json(table, row)
            if cells[CHECKSUM] != row[CHECKSUM]:
                raise ValueError(f"{CHECKSUM}: does not match the row, which was changed after its export")
        except _HeaderError as error:
            raise StoreError(f"{file}: {error}") from None
        except UnicodeDecodeError:
            raise StoreError(f"{file}: row {number} or later: is no UTF-8 text") from None
        except ValueError as error:
            raise StoreError(f"{file}: row {number}: {error}") from None
        except OSError as error:
            raise StoreError(f"{file}: cannot be read: {error.strerror or error}") from None
        yield row


class _HeaderError(ValueError):
    """Columns that are not the table's."""


def _check_columns(table: Table, found: list[str]) -> None:
    expected = [*table.names, CHECKSUM]
    for name in found:
        if name not in expected:
            raise _HeaderError(f'unknown column "{name[:80]}"; known: {", ".join(expected)}')
    for name in expected:
        if found.count(name) != 1:
            raise _HeaderError(f'has {"no column" if name not in found else "twice the column"} "{name}"')


def _write_csv(table: Table, rows: Iterable[Row], file: Path) -> int:
    count = 0
    with file.open("w", encoding="utf-8", newline="") as text:
        text.write(",".join((*table.names, CHECKSUM)) + "\n")
        for row in rows:
            text.write(",".join(map(_csv_cell, row.values())) + "\n")
            count += 1
    return count


def _csv_cell(value: Any) -> str:
    if isinstance(value, str):
        return '"' + value.replace('"', '""') + '"'
    return "" if value is None else repr(value)


def _read_csv(table: Table, file: Path) -> Iterator[Row]:
    types = {column.name: column.type for column in table.columns} | {CHECKSUM: "INTEGER"}
    with file.open(encoding="utf-8", newline="") as text:
        records = _records(text)
        names = [text or number or "" for text, number in next(records, [])]
        _check_columns(table, names)
        for cells in records:
            if len(cells) != len(names):
                raise ValueError(f"has {len(cells)} cells, the header {len(names)}")
            yield {name: _value(name, types[name], *cell) for name, cell in zip(names, cells, strict=True)}


def _records(text: Iterable[str]) -> Iterator[list[tuple[str | None, str | None]]]:
    """Cells of each record: what stands in quotes and what stands without, one of them None."""
    pending: list[str] = []
    quotes = 0
    for line in text:
        pending.append(line)
        quotes += line.count('"')
        if quotes % 2 == 0:
            yield _cells("".join(pending).rstrip("\r\n"))
            pending, quotes = [], 0
    if pending:
        raise ValueError("a quoted text has no end")


def _cells(record: str) -> list[tuple[str | None, str | None]]:
    cells: list[tuple[str | None, str | None]] = []
    place = 0
    while True:
        match = _CELL.match(record, place)
        if match is None:
            raise ValueError(f"cell {len(cells) + 1}: its quotes are wrong")
        quoted, bare, end = match.groups()
        cells.append((None if quoted is None else quoted.replace('""', '"'), bare))
        if not end:
            return cells
        place = match.end()


def _value(name: str, kind: str, quoted: str | None, bare: str | None) -> str | int | float | None:
    if quoted is not None:
        return quoted
    if not bare:
        return None
    try:
        return whole_number(bare) if kind == "INTEGER" else decimal_number(bare)
    except ValueError:
        raise ValueError(f"{name}: {bare[:80]!r} is no {'whole ' * (kind == 'INTEGER')}number") from None


def _write_parquet(table: Table, rows: Iterable[Row], file: Path) -> int:
    import pyarrow as pa
    import pyarrow.parquet as pq

    of_type = {"INTEGER": pa.int64(), "REAL": pa.float64()}
    fields = [
        pa.field(column.name, of_type.get(column.type, pa.string()), metadata={"description": column.meaning})
        for column in table.columns
    ]
    schema = pa.schema([*fields, pa.field(CHECKSUM, pa.int64())])
    mixed = [column.name for column in table.columns if column.type == "VALUE"]
    count = 0
    source = iter(rows)
    with pq.ParquetWriter(file, schema, write_page_checksum=True) as writer:
        while batch := list(itertools.islice(source, BATCH_ROWS)):
            for row in batch:
                row.update({name: json.dumps(row[name]) for name in mixed if row[name] is not None})
            writer.write_table(pa.Table.from_pylist(batch, schema=schema))
            count += len(batch)
    return count


def _read_parquet(table: Table, file: Path) -> Iterator[Row]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    mixed = [column.name for column in table.columns if column.type == "VALUE"]
    try:
        with pq.ParquetFile(file, page_checksum_verification=True) as opened:
            _check_columns(table, opened.schema_arrow.names)
            for batch in opened.iter_batches(BATCH_ROWS):
                for row in batch.to_pylist():
                    yield {**row, **{name: json.loads(row[name]) for name in mixed if row[name] is not None}}
    except (pa.ArrowException, MemoryError) as error:
        raise ValueError(f"is no Parquet that can be read: {str(error).splitlines()[0][:200]}") from None
