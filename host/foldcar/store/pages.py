"""Reads the rows of an SQLite file from its pages, where SQLite itself gives up (sqlite.org/fileformat2.html, 1-2).

Input: pages. Output: the cells of each record on every page that is in use. Nothing is trusted: what cannot be decoded is
told, and whoever asks proves each row by its own checksum.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

DEFAULT_PAGE_BYTES = 4096
TABLE_LEAF, TABLE_INTERIOR, INDEX_LEAF, INDEX_INTERIOR = 13, 5, 10, 2
_INTEGER_BYTES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}


class PageError(Exception):
    """A page, or a record on it, is not what SQLite writes."""


@dataclass(frozen=True, slots=True)
class Record:
    """A record's cells; ``rowid`` is None on pages of tables without row numbers, and of indexes."""

    rowid: int | None
    cells: tuple[Any, ...]


def page_bytes(header: bytes) -> int:
    """The size of pages by the file's header; SQLite's usual one if that says nonsense."""
    (size,) = struct.unpack_from(">H", header, 16)
    size = 65536 if size == 1 else size
    return size if size >= 512 and size & (size - 1) == 0 else DEFAULT_PAGE_BYTES


class Pages:
    """A database's pages by their number, from 1."""

    def __init__(self, pages: dict[int, bytes], size: int) -> None:
        self._pages = pages
        self._size = size
        reserved = pages[1][20] if 1 in pages else 0
        self._usable = size - (reserved if reserved <= 32 else 0)

    def numbers(self) -> set[int]:
        """The numbers of all pages."""
        return set(self._pages)

    def version(self) -> int:
        """The user's version number in the header; 0 without one."""
        return int.from_bytes(self._pages.get(1, b"")[60:64], "big")

    def free(self) -> set[int] | None:
        """The pages that are not in use, which hold old rows; None if the list of them is damaged."""
        try:
            trunk, count = struct.unpack_from(">2I", self._page(1), 32)
            found: set[int] = set()
            while trunk:
                page = self._page(trunk)
                following, leaves = struct.unpack_from(">2I", page)
                listed = struct.unpack_from(f">{leaves}I", page, 8) if leaves <= self._size // 4 - 2 else ()
                if trunk in found or len(listed) != leaves:
                    return None
                found |= {trunk, *listed}
                trunk = following
        except (PageError, struct.error):
            return None
        return found if len(found) == count else None

    def tree(self, root: int, damaged: Callable[[], object]) -> Iterator[int]:
        """The pages of the tree with that root; ``damaged`` is called for each that cannot be read."""
        waiting, seen = [root], set()
        while waiting:
            number = waiting.pop()
            if number in seen:
                continue
            seen.add(number)
            try:
                kind, places, page = self._node(number)
                children = [struct.unpack_from(">I", page, place)[0] for place in places]
                if kind in (TABLE_INTERIOR, INDEX_INTERIOR):
                    waiting += [*children, struct.unpack_from(">I", page, _start(number) + 8)[0]]
            except (PageError, struct.error):
                damaged()
                continue
            yield number

    def records(self, number: int, damaged: Callable[[], object] = lambda: None) -> Iterator[Record]:
        """The records on a page; ``damaged`` is called for each that cannot be read, or for the page."""
        try:
            kind, places, page = self._node(number)
        except (PageError, struct.error):
            damaged()
            return
        for place in places if kind != TABLE_INTERIOR else ():
            try:
                yield self._record(kind, page, place)
            except (PageError, struct.error, UnicodeError):
                damaged()

    def records_of(self, page: bytes) -> Iterator[Record]:
        """The records of a page whose number is not known."""
        other = Pages({**self._pages, 0: page}, self._size)
        yield from other.records(0)

    def _page(self, number: int) -> bytes:
        page = self._pages.get(number, b"")
        if len(page) != self._size:
            raise PageError
        return page

    def _node(self, number: int) -> tuple[int, tuple[int, ...], bytes]:
        """A page of a tree: its kind, where its cells begin, its bytes."""
        page, start = self._page(number), _start(number)
        kind, _, count = struct.unpack_from(">BHH", page, start)
        if kind not in (TABLE_LEAF, TABLE_INTERIOR, INDEX_LEAF, INDEX_INTERIOR):
            raise PageError
        head = start + (12 if kind in (TABLE_INTERIOR, INDEX_INTERIOR) else 8)
        return kind, struct.unpack_from(f">{count}H", page, head), page

    def _record(self, kind: int, page: bytes, place: int) -> Record:
        at = place + (4 if kind == INDEX_INTERIOR else 0)
        length, at = _varint(page, at)
        rowid = None
        if kind == TABLE_LEAF:
            rowid, at = _varint(page, at)
        return Record(rowid, _cells(self._payload(kind, page, at, length)))

    def _payload(self, kind: int, page: bytes, at: int, length: int) -> bytes:
        usable = self._usable
        most = usable - 35 if kind == TABLE_LEAF else (usable - 12) * 64 // 255 - 23
        if length <= most:
            return page[at : at + length]
        least = (usable - 12) * 32 // 255 - 23
        local = least + (length - least) % (usable - 4)
        local = local if local <= most else least
        parts, left = [page[at : at + local]], length - local
        (following,) = struct.unpack_from(">I", page, at + local)
        while left > 0:
            overflow = self._page(following)
            (following,) = struct.unpack_from(">I", overflow)
            parts.append(overflow[4 : min(usable, 4 + left)])
            left -= usable - 4
        return b"".join(parts)


def _start(number: int) -> int:
    return 100 if number == 1 else 0


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number of 1 to 9 bytes, and where it ends."""
    value = 0
    for index in range(9):
        if at + index >= len(data):
            raise PageError
        byte = data[at + index]
        if index == 8:
            value = value << 8 | byte
            break
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            break
    return (value - 2**64 if value >= 2**63 else value), at + index + 1


def _cells(payload: bytes) -> tuple[Any, ...]:
    header, at = _varint(payload, 0)
    kinds = []
    while at < header:
        kind, at = _varint(payload, at)
        kinds.append(kind)
    at, cells = header, []
    for kind in kinds:
        cell, at = _cell(payload, kind, at)
        cells.append(cell)
    if at != len(payload):
        raise PageError
    return tuple(cells)


def _cell(payload: bytes, kind: int, at: int) -> tuple[Any, int]:
    if kind in (0, 8, 9):
        return (None, 0, 1)[max(0, kind - 7)], at
    if kind == 7:
        return struct.unpack_from(">d", payload, at)[0], at + 8
    if kind in _INTEGER_BYTES:
        end = at + _INTEGER_BYTES[kind]
        return int.from_bytes(payload[at:end], "big", signed=True), end
    if kind < 12:
        raise PageError
    end = at + (kind - 12) // 2
    part = payload[at:end]
    return (part.decode() if kind & 1 else part), end
