"""Reads the bytes of a damaged store, where SQLite reads no further: its whole rows, and damage in its write-ahead log.

Whole rows are all records on its pages that match a table's checksum. SQLite first puts in what a journal or a
write-ahead log beside the store holds; the shells of Debian and of PyPI are built without its `.recover`, so records are
taken from the pages as bytes (sqlite.org/fileformat2.html, 1.6 and 2.1). Nothing is trusted: a row that matches its
checksum is what was written.

SQLite takes a write-ahead log (4) up to the first frame whose checksum is wrong, and deletes the rest without a word. A
killed program leaves nothing behind such a frame: a whole transaction that follows says that it was damaged later.
"""

import contextlib
import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.store.errors import StoreError
from foldcar.store.rows import Row, is_intact
from foldcar.store.tables import CHECKSUM, TABLES, Table

TABLE_LEAF, INDEX_LEAF, INDEX_INTERIOR = 13, 10, 2
PAGE_BYTES = 4096
# Types of cells by their code: how many bytes a whole number has.
_INTEGER_BYTES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
HEADER, FRAME = struct.Struct(">8I"), struct.Struct(">6I")
# Of a write-ahead log; with the last bit set, checksums are of big-endian words.
MAGIC = 0x377F0682
Rows = dict[str, dict[tuple[Any, ...], Row]]


def salvage(store: Path, connection: sqlite3.Connection) -> Rows:
    """The whole rows of a store by table and key. ``connection`` is to it, if SQLite can read it.

    Two different whole rows of one key, neither of them known to be the last, are both left out.
    """
    found: Rows = {table.name: {} for table in TABLES}
    doubtful = set()
    columns = [(table, names) for table in TABLES for names in _orders(table, connection)]
    for rowid, cells in records(store.read_bytes()):
        for table, names in columns:
            row = _row(table, names, rowid, cells)
            if row is not None and is_intact(table, row):
                key = tuple(row[name] for name in table.key)
                if found[table.name].setdefault(key, row) != row:
                    doubtful.add((table.name, key))
    for name, key in doubtful:
        del found[name][key]
    return found


def _orders(table: Table, connection: sqlite3.Connection) -> list[list[str]]:
    """The columns in the orders that records may have: those of a key of several first, one that came later last."""
    late = [column.name for column in table.columns if column.late]
    # Where the schema is lost, checksums tell whether the store is older than the late columns.
    grown = [*(name for name in table.names if name not in late), CHECKSUM, *late]
    orders = [[*table.names, CHECKSUM], *([grown] if late else [])]
    keyed = table.order or table.key
    with contextlib.suppress(sqlite3.Error, UnicodeError):
        told = [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table.name})")]
        # A damaged name is none of a column.
        if told and set(told) <= set(orders[0]):
            orders = [told]
    if len(keyed) == 1:
        return orders
    return [[*keyed, *(name for name in order if name not in keyed)] for order in orders]


def _row(table: Table, names: list[str], rowid: int | None, cells: list[Any]) -> Row | None:
    """The record as a row of that table, if it can be one."""
    # A record from before a metric came has no cell for it.
    if len(cells) > len(names) or (rowid is None) is not (len(table.key) > 1):
        return None
    row: Row = dict.fromkeys((*table.names, CHECKSUM))
    row.update(zip(names, cells, strict=False))
    if "id" in row and row["id"] is None:
        row["id"] = rowid
    for column in table.columns:
        # SQLite stores whole numbers of such columns as integers.
        if column.type == "REAL" and isinstance(row[column.name], int):
            row[column.name] = float(row[column.name])
    return row


def records(content: bytes) -> Iterator[tuple[int | None, list[Any]]]:
    """Row number, if it has one, and cells of every record that can be read on any page."""
    for at in range(0, len(content), PAGE_BYTES):
        start, page = (0 if at else 100), content[at : at + PAGE_BYTES]
        with contextlib.suppress(struct.error, IndexError):
            kind, _, count = struct.unpack_from(">BHH", page, start)
            if kind in (TABLE_LEAF, INDEX_LEAF, INDEX_INTERIOR):
                head = start + (12 if kind == INDEX_INTERIOR else 8)
                for place in struct.unpack_from(f">{count}H", page, head):
                    with contextlib.suppress(struct.error, IndexError, UnicodeError, OverflowError):
                        yield _record(content, page, kind, place)


def _record(content: bytes, page: bytes, kind: int, place: int) -> tuple[int | None, list[Any]]:
    length, at = _varint(page, place + (4 if kind == INDEX_INTERIOR else 0))
    rowid = None
    if kind == TABLE_LEAF:
        rowid, at = _varint(page, at)
    payload = _payload(content, page, kind, at, length)
    end, at = _varint(payload, 0)
    cells, data = [], end
    while at < end:
        code, at = _varint(payload, at)
        size = _INTEGER_BYTES.get(code, 8 if code == 7 else max(0, code - 12) // 2)
        cells.append(_cell(code, payload[data : data + size]))
        data += size
    return rowid, cells


def _payload(content: bytes, page: bytes, kind: int, at: int, length: int) -> bytes:
    """A record's bytes, the rest of a long one on pages of its own; shorter if the file ends before it does."""
    least = (PAGE_BYTES - 12) * 32 // 255 - 23
    most = PAGE_BYTES - 35 if kind == TABLE_LEAF else (PAGE_BYTES - 12) * 64 // 255 - 23
    if length <= most:
        return page[at : at + length]
    local = least + (length - least) % (PAGE_BYTES - 4)
    local = local if local <= most else least
    parts, left, (following,) = [page[at : at + local]], length - local, struct.unpack_from(">I", page, at + local)
    while left > 0 and following:
        overflow = content[(following - 1) * PAGE_BYTES : following * PAGE_BYTES]
        (following,) = struct.unpack_from(">I", overflow)
        parts.append(overflow[4 : 4 + left])
        left -= PAGE_BYTES - 4
    return b"".join(parts)


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A whole number of 1 to 9 bytes, and where it ends. IndexError if the data end first."""
    value = 0
    for place in range(at, at + 8):
        value = value << 7 | data[place] & 0x7F
        if data[place] < 0x80:
            return value, place + 1
    value = value << 8 | data[at + 8]
    return (value - 2**64 if value >= 2**63 else value), at + 9


def _cell(code: int, content: bytes) -> Any:
    if code in _INTEGER_BYTES:
        return int.from_bytes(content, "big", signed=True)
    if code == 7:
        return struct.unpack(">d", content)[0]
    if code < 12:
        return {8: 0, 9: 1}.get(code)
    return content.decode() if code % 2 else content


def log_damage(log: Path) -> str | None:
    """What is damaged of a log; None if nothing is, if there is none, or if it is being begun anew. StoreError."""
    try:
        with log.open("rb") as opened:
            content = opened.read()
            opened.seek(0)
            # The header of a log that begins anew is written first: what follows may be of either.
            anew = opened.read(HEADER.size) != content[: HEADER.size]
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"{log}: cannot be read: {error.strerror}") from error
    if anew or len(content) < HEADER.size + FRAME.size:
        return None
    magic, _, page_size, _, *salts, first, second = HEADER.unpack_from(content)
    order = ">" if magic & 1 else "<"
    if magic | 1 != MAGIC | 1 or _sums(order, content[:24], (0, 0)) != (first, second):
        return "its header is damaged: the transactions in it would be lost"
    bad = last = 0
    sums, size = (first, second), FRAME.size + page_size
    for number, start in enumerate(range(HEADER.size, len(content) - size + 1, size), 1):
        _, commit, *frame_salts, first, second = FRAME.unpack_from(content, start)
        # A checksum goes on from that which the frame before has, whether that one is whole or not.
        begun = _sums(order, content[start : start + 8], sums)
        expected = _sums(order, content[start + FRAME.size : start + size], begun)
        sums = (first, second)
        # Frames of an earlier log have other salts.
        whole = frame_salts == salts and expected == sums
        if not whole:
            bad = bad or number
        elif commit:
            last = number
    if not 0 < bad < last:
        return None
    return f"frame {bad} of {last} is damaged: {last - bad + 1} pages of transactions would be lost"


def _sums(order: str, content: bytes, before: tuple[int, int]) -> tuple[int, int]:
    first, second = before
    words = struct.unpack(f"{order}{len(content) // 4}I", content)
    for even, odd in zip(words[::2], words[1::2], strict=True):
        first = (first + even + second) & 0xFFFFFFFF
        second = (second + odd + first) & 0xFFFFFFFF
    return first, second
