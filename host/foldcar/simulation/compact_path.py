"""Encodes the path of a run in a few hundred bytes, as carsim does: rounded, differenced twice, variable length.

Input: rows of a path of docs/carsim.md. Output: bytes that ``path.js`` of the report reads; rows of an answer's path.
The columns follow one another: x, y, z (PLACE_M), heading, pitch, roll and each hinge (ANGLE_RAD). A column's values are
differenced twice, each time with 0 before the first; summing twice restores them. Integers are zigzag LEB128: 7 bits a
byte, lowest bits first; the top bit says that more bytes follow.
"""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.simulation.runner import KEPT_INTERVAL_S

PLACE_M = 0.0005
ANGLE_RAD = 0.002
# Practical maximum of a row's bytes before compression, to estimate a page's size.
ROW_BYTES = 8

Integers = NDArray[numpy.int64]


def compact_path(path: Sequence[Sequence[float]]) -> bytes:
    """Return the path's bytes; the times of its rows, except the last, are multiples of INTERVAL_S."""
    rows = numpy.asarray(path, dtype=float)[:, 1:]
    # Make headings continuous, without jumps of a full turn.
    rows[:, 3] = numpy.unwrap(rows[:, 3])
    units = numpy.full(rows.shape[1], ANGLE_RAD)
    units[:3] = PLACE_M
    integers = numpy.rint(rows / units).astype(numpy.int64)
    return varints(numpy.concatenate([twice_differenced(column) for column in integers.T]))


def twice_differenced(values: Integers) -> Integers:
    """Return the differences of the differences, with 0 before the first value and the first difference."""
    return numpy.diff(numpy.diff(values, prepend=0), prepend=0)


def varints(values: Integers) -> bytes:
    """Encode integers as zigzag LEB128: 0, -1, 1, -2 … become 0, 1, 2, 3 …, in groups of 7 bits."""
    remaining = ((values << 1) ^ (values >> 63)).astype(numpy.uint64)
    groups = numpy.zeros((len(remaining), 10), dtype=numpy.uint8)
    is_used = numpy.zeros(groups.shape, dtype=bool)
    is_used[:, 0] = True
    for index in range(groups.shape[1]):
        groups[:, index] = remaining & numpy.uint64(0x7F)
        remaining = remaining >> numpy.uint64(7)
        if not remaining.any():
            break
        groups[remaining > 0, index] |= 0x80
        is_used[remaining > 0, index + 1] = True
    return groups[is_used].tobytes()


def answered_path(answer: Mapping[str, Any]) -> NDArray[numpy.float64]:
    """Decode the compact path of a run's answer to rows (rows, 7): time (s), x, y, z (m), heading, pitch, roll (rad)."""
    rows = answer["path"]["rows"]
    octets = numpy.frombuffer(base64.b64decode(answer["path"]["compact"]), dtype=numpy.uint8)
    ends = numpy.flatnonzero(octets < 0x80)
    starts = numpy.append(0, ends[:-1] + 1)
    shifts = 7 * (numpy.arange(len(octets)) - numpy.repeat(starts, ends - starts + 1))
    encoded = numpy.add.reduceat((octets & 0x7F).astype(numpy.int64) << shifts, starts)
    columns = numpy.cumsum(numpy.cumsum(((encoded >> 1) ^ -(encoded & 1)).reshape(-1, rows), axis=1), axis=1)[:6]
    units = numpy.array([PLACE_M] * 3 + [ANGLE_RAD] * 3)
    times_s = numpy.minimum(KEPT_INTERVAL_S * numpy.arange(rows), answer["elapsed_time_s"])
    result: NDArray[numpy.float64] = numpy.vstack([times_s, columns * units[:, None]]).T
    return result
