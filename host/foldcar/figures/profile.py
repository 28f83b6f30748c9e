"""The ground under a car's tracks: the driven line, and the terrain's height along a strip beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.errors import FoldcarError

Floats = NDArray[numpy.float64]


@dataclass(frozen=True)
class Line:
    """A line on the ground, n points: increasing distance along it, x and y (m) and heading (rad)."""

    distance_m: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats


def travelled_m(path: Sequence[Sequence[float]]) -> Floats:
    """How far the car has come at each row of ``path`` (docs/carsim.md), counted back where it rolls back."""
    rows = numpy.asarray(path, dtype=float)
    heading = numpy.unwrap(rows[:, 4])
    middle = (heading[1:] + heading[:-1]) / 2
    forward = numpy.diff(rows[:, 1]) * numpy.cos(middle) + numpy.diff(rows[:, 2]) * numpy.sin(middle)
    return numpy.concatenate([[0.0], numpy.cumsum(forward)])


def driven_line(path: Sequence[Sequence[float]], margin_m: float, spacing_m: float = 1e-3) -> Line:
    """The line the car's middle drove, and straight on by ``margin_m``; a point every ``spacing_m``."""
    rows = numpy.asarray(path, dtype=float)
    travelled = travelled_m(path)
    # Where the car rolls back it covers ground it has covered: only new ground makes the line longer.
    furthest = numpy.maximum.accumulate(travelled)
    new = numpy.concatenate([[True], travelled[1:] > furthest[:-1]])
    s, x, y, heading = travelled[new], rows[new, 1], rows[new, 2], numpy.unwrap(rows[:, 4])[new]
    first, last = min(travelled.min(), 0.0) - margin_m, s[-1] + margin_m
    at = numpy.arange(first, last + spacing_m / 2, spacing_m)
    before, after = numpy.minimum(at - s[0], 0.0), numpy.maximum(at - s[-1], 0.0)
    return Line(
        at,
        numpy.interp(at, s, x) + before * numpy.cos(heading[0]) + after * numpy.cos(heading[-1]),
        numpy.interp(at, s, y) + before * numpy.sin(heading[0]) + after * numpy.sin(heading[-1]),
        numpy.interp(at, s, heading),
    )


def strip_heights_m(
    terrain: Sequence[Mapping[str, Any]], line: Line, left_m: float, width_m: float
) -> Floats:
    """The terrain's greatest height (m) across a strip ``width_m`` wide, ``left_m`` to the left of ``line``.

    At each point of the line the strip is a segment across the heading; a box counts where that segment meets
    its rectangle. Ground is 0.
    """
    across = numpy.stack([-numpy.sin(line.heading_rad), numpy.cos(line.heading_rad)], axis=1)
    start = numpy.stack([line.x_m, line.y_m], axis=1) + (left_m - width_m / 2) * across
    heights = numpy.zeros(len(line.x_m))
    for piece in terrain:
        if piece["kind"] != "box":
            raise FoldcarError(f"terrain of kind {piece['kind']!r} cannot be drawn")
        cos, sin = numpy.cos(piece["heading_rad"]), numpy.sin(piece["heading_rad"])
        to_box = numpy.array([[cos, -sin], [sin, cos]])
        origin = (start - [piece["x_m"], piece["y_m"]]) @ to_box
        half = numpy.array([piece["length_m"], piece["width_m"]]) / 2
        met = _meets(origin, across @ to_box * width_m, half)
        heights[met] = numpy.maximum(heights[met], piece["height_m"])
    return heights


def _meets(origin: Floats, step: Floats, half: Floats) -> NDArray[numpy.bool_]:
    """Whether each segment origin + t·step, 0 ≤ t ≤ 1, meets the rectangle |x| ≤ half[0], |y| ≤ half[1]."""
    enter, leave = numpy.zeros(len(origin)), numpy.ones(len(origin))
    for axis in (0, 1):
        slope, position = step[:, axis], origin[:, axis]
        level = numpy.abs(slope) < 1e-12
        safe = numpy.where(level, 1.0, slope)
        near, far = (-half[axis] - position) / safe, (half[axis] - position) / safe
        inside = numpy.abs(position) <= half[axis]
        low = numpy.where(level, numpy.where(inside, -numpy.inf, numpy.inf), numpy.minimum(near, far))
        high = numpy.where(level, numpy.where(inside, numpy.inf, -numpy.inf), numpy.maximum(near, far))
        enter, leave = numpy.maximum(enter, low), numpy.minimum(leave, high)
    return enter <= leave
