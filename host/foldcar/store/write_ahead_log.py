"""Reads the write-ahead log beside a store and tells damage in it from a torn end (sqlite.org/fileformat2.html, 4).

SQLite takes the log up to the first frame whose checksum is wrong, and deletes the rest without a word. A killed program
leaves nothing behind such a frame: frames that follow and belong to the same log say that it was damaged later.
"""

import itertools
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from foldcar.store.errors import StoreError

HEADER = struct.Struct(">8I")
FRAME = struct.Struct(">6I")
# With the last bit set, checksums are of big-endian words.
MAGIC = 0x377F0682
_WORD = 0xFFFFFFFF


@dataclass(slots=True)
class WriteAheadLog:
    """The pages of the transactions that a log holds: (number, content), oldest first.

    ``damaged`` are pages of frames that do not match their checksums; their numbers are not certain either. ``bad`` are
    the numbers of these frames, from 1, and ``frames`` is how many there are.
    """

    frames: int = 0
    pages: list[tuple[int, bytes]] = field(default_factory=list)
    damaged: list[bytes] = field(default_factory=list)
    bad: list[int] = field(default_factory=list)
    header_damaged: bool = False

    @property
    def finding(self) -> str | None:
        """What is damaged, None if nothing is."""
        if self.header_damaged:
            return "its header is damaged: the transactions in it would be lost"
        if self.bad:
            lost = self.frames - self.bad[0] + 1
            return f"frame {self.bad[0]} of {self.frames} is damaged: {lost} pages of transactions would be lost"
        return None


def read_log(store: Path) -> WriteAheadLog:
    """The log beside ``store``, an empty one if there is none or if it is being begun anew. StoreError."""
    real = store.resolve()
    file = real.with_name(f"{real.name}-wal")
    try:
        with file.open("rb") as opened:
            content = opened.read()
            opened.seek(0)
            again = opened.read(HEADER.size)
    except FileNotFoundError:
        return WriteAheadLog()
    except OSError as error:
        raise StoreError(f"{file}: cannot be read: {error.strerror}") from error
    # The header of a log that begins anew is written first: what follows may be of either.
    return _read(content) if again == content[: HEADER.size] else WriteAheadLog()


def refuse_damaged_log(store: Path) -> None:
    """StoreError if the log beside the store is damaged: whoever opens the store would lose transactions."""
    finding = read_log(store).finding
    if finding is not None:
        where = f"{store}: its write-ahead log {store.name}-wal"
        raise StoreError(f"{where}: {finding}; `foldcar repair` saves what is whole")


def _read(content: bytes) -> WriteAheadLog:
    log = WriteAheadLog()
    if len(content) < HEADER.size + FRAME.size:
        return log
    magic, _, page_size, _, salt_1, salt_2, *sums = HEADER.unpack_from(content)
    order = ">" if magic & 1 else "<"
    header_sums = _sums(order, content[:24], (0, 0))
    if magic | 1 != MAGIC | 1 or header_sums != tuple(sums):
        log.header_damaged = True
        page_size, salt_1, salt_2 = _guessed(content)
        order = "<"
    if page_size < 512 or page_size & (page_size - 1) or page_size > 65536:
        return log
    found = list(_frames(content, page_size, (salt_1, salt_2), order, tuple(sums)))
    # Behind the last sound commit is a transaction that never was, or was being written when the program was killed.
    last = max((at for at, (_, commit, _, sound) in enumerate(found) if commit and sound), default=-1)
    log.frames = last + 1
    for at, (number, _, page, sound) in enumerate(found[: last + 1]):
        if sound:
            log.pages.append((number, page))
        else:
            log.bad.append(at + 1)
            log.damaged.append(page)
    return log


def _frames(
    content: bytes, page_size: int, salts: tuple[int, int], order: str, sums: tuple[int, ...]
) -> Iterator[tuple[int, int, bytes, bool]]:
    """Frames of that log: the page's number, the database's size if it ends a transaction, the page, if it is sound."""
    size, strangers = FRAME.size + page_size, 0
    # A frame's checksum goes on from that of the frame before, which may itself be damaged, as may be what it is of.
    written = chain = (sums[0], sums[1])
    for start in range(HEADER.size, len(content) - size + 1, size):
        number, commit, *rest = FRAME.unpack_from(content, start)
        page = content[start + FRAME.size : start + size]
        ours = (rest[0], rest[1]) == salts
        strangers = 0 if ours else strangers + 1
        if strangers > 1:
            # What an earlier log left.
            return
        chains = [_sums(order, page, _sums(order, content[start : start + 8], before)) for before in {written, chain}]
        written = (rest[2], rest[3])
        sound = ours and written in chains
        chain = written if sound else chains[0]
        yield number, commit, page, sound


def _sums(order: str, content: bytes, before: tuple[int, int]) -> tuple[int, int]:
    first, second = before
    words = struct.unpack(f"{order}{len(content) // 4}I", content)
    for even, odd in zip(itertools.islice(words, 0, None, 2), itertools.islice(words, 1, None, 2), strict=True):
        first = (first + even + second) & _WORD
        second = (second + odd + first) & _WORD
    return first, second


def _guessed(content: bytes) -> tuple[int, int, int]:
    """Page size and salts of a log with a damaged header: SQLite's usual size, the salts of the first frame."""
    _, _, salt_1, salt_2, _, _ = FRAME.unpack_from(content, HEADER.size)
    return 4096, salt_1, salt_2
