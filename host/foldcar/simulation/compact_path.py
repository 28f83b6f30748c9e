"""The path of a run as a few hundred bytes, as carsim makes them of runs: rounded, differenced twice, variable length.

Input: rows of a path of docs/carsim.md. Output: bytes that ``path.js`` of the report reads; rows of an answer's path.
Columns one after the other: x, y, z (PLACE_M), heading, pitch, roll and each hinge (ANGLE_RAD). A column is its values
differenced twice, each with 0 before the first: summing twice gives it back. Integers are zigzag LEB128: 7 bits a byte,
lowest first, the top bit says that more follow.
"""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.simulation.runner import KEPT_INTERVAL_S

PLACE_M = 0.0005
ANGLE_RAD = 0.002
# What one row takes at most in practice before compression, to foresee a page's size.
ROW_BYTES = 8

Integers = NDArray[numpy.int64]


def compact_path(path: Sequence[Sequence[float]]) -> bytes:
    """The path's bytes; the times of its rows are multiples of INTERVAL_S but for the last."""
    rows = numpy.asarray(path, dtype=float)[:, 1:]
    # Headings beyond a half turn go on, so that there is no leap of a full turn.
    rows[:, 3] = numpy.unwrap(rows[:, 3])
    units = numpy.full(rows.shape[1], ANGLE_RAD)
    units[:3] = PLACE_M
    whole = numpy.rint(rows / units).astype(numpy.int64)
    return varints(numpy.concatenate([twice_differenced(column) for column in whole.T]))


def twice_differenced(values: Integers) -> Integers:
    """Differences of the differences, as if the values and their differences began with 0."""
    return numpy.diff(numpy.diff(values, prepend=0), prepend=0)


def varints(values: Integers) -> bytes:
    """Zigzag LEB128: 0, -1, 1, -2 … become 0, 1, 2, 3 …, in groups of 7 bits."""
    left = ((values << 1) ^ (values >> 63)).astype(numpy.uint64)
    groups = numpy.zeros((len(left), 10), dtype=numpy.uint8)
    kept = numpy.zeros(groups.shape, dtype=bool)
    kept[:, 0] = True
    for place in range(groups.shape[1]):
        groups[:, place] = left & numpy.uint64(0x7F)
        left = left >> numpy.uint64(7)
        if not left.any():
            break
        groups[left > 0, place] |= 0x80
        kept[left > 0, place + 1] = True
    return groups[kept].tobytes()


def answered_path(answer: Mapping[str, Any]) -> NDArray[numpy.float64]:
    """The rows (rows, 7) of the compact path of a run's answer: time (s), x, y, z (m), heading, pitch, roll (rad)."""
    rows = answer["path"]["rows"]
    octets = numpy.frombuffer(base64.b64decode(answer["path"]["compact"]), dtype=numpy.uint8)
    ends = numpy.flatnonzero(octets < 0x80)
    starts = numpy.append(0, ends[:-1] + 1)
    shifts = 7 * (numpy.arange(len(octets)) - numpy.repeat(starts, ends - starts + 1))
    left = numpy.add.reduceat((octets & 0x7F).astype(numpy.int64) << shifts, starts)
    columns = numpy.cumsum(numpy.cumsum(((left >> 1) ^ -(left & 1)).reshape(-1, rows), axis=1), axis=1)[:6]
    units = numpy.array([PLACE_M] * 3 + [ANGLE_RAD] * 3)
    times_s = numpy.minimum(KEPT_INTERVAL_S * numpy.arange(rows), answer["elapsed_time_s"])
    result: NDArray[numpy.float64] = numpy.vstack([times_s, columns * units[:, None]]).T
    return result
