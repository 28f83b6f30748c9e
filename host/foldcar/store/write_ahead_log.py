"""Tells damage in the write-ahead log beside a store from a torn end (sqlite.org/fileformat2.html, 4).

SQLite takes the log up to the first frame whose checksum is wrong, and deletes the rest without a word. A killed program
leaves nothing behind such a frame: a whole transaction that follows says that the frame was damaged later.
"""

import struct
from pathlib import Path

from foldcar.store.errors import StoreError

HEADER = struct.Struct(">8I")
FRAME = struct.Struct(">6I")
# With the last bit set, checksums are of big-endian words.
MAGIC = 0x377F0682


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
