"""The ground under a car's wheel tracks: a line on it, and the maximum height along a strip beside the line.

Input: a path or a start, a function for heights. Output: lines and heights in m.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.simulation.heights import Floats, Heights

# Points across a tyre's strip: a corner that overlaps it by less than a sixth of its width may be missed.
ACROSS = 7


@dataclass(frozen=True)
class Line:
    """A line on the ground; four (n,) arrays: increasing distance along it, x and y (m), heading (rad)."""

    distance_m: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats


def travelled_m(path: Sequence[Sequence[float]]) -> Floats:
    """Return the distance travelled at each row of ``path``, (n,) in m; it decreases where the car rolls back."""
    rows = numpy.asarray(path, dtype=float)
    heading = numpy.unwrap(rows[:, 4])
    middle = (heading[1:] + heading[:-1]) / 2
    forward = numpy.diff(rows[:, 1]) * numpy.cos(middle) + numpy.diff(rows[:, 2]) * numpy.sin(middle)
    return numpy.concatenate([[0.0], numpy.cumsum(forward)])


def driven_line(path: Sequence[Sequence[float]], margin_m: float, spacing_m: float = 1e-3) -> Line:
    """Return the line that the car's centre drove, with a point every ``spacing_m``.

    It is extended straight by ``margin_m`` at both ends. ``path`` has rows of time, x, y, z and heading (docs/carsim.md).
    """
    rows = numpy.asarray(path, dtype=float)
    travelled = travelled_m(path)
    # Rolling back does not lengthen the line.
    farthest = numpy.maximum.accumulate(travelled)
    is_farther = numpy.concatenate([[True], travelled[1:] > farthest[:-1]])
    s, x, y = travelled[is_farther], rows[is_farther, 1], rows[is_farther, 2]
    heading = numpy.unwrap(rows[:, 4])[is_farther]
    first_m, last_m = min(float(numpy.min(travelled)), 0.0) - margin_m, s[-1] + margin_m
    distances = numpy.arange(first_m, last_m + spacing_m / 2, spacing_m)
    # Beyond both ends interp keeps the values of the end; the distance beyond is added along the heading there.
    beyond_start, beyond_end = numpy.minimum(distances - s[0], 0.0), numpy.maximum(distances - s[-1], 0.0)
    return Line(
        distances,
        numpy.interp(distances, s, x) + beyond_start * numpy.cos(heading[0]) + beyond_end * numpy.cos(heading[-1]),
        numpy.interp(distances, s, y) + beyond_start * numpy.sin(heading[0]) + beyond_end * numpy.sin(heading[-1]),
        numpy.interp(distances, s, heading),
    )


def straight_line(start: Mapping[str, Any], first_m: float, last_m: float) -> Line:
    """Return the straight line along a pose's heading between two distances, with a point every millimetre."""
    distances = numpy.arange(first_m, last_m + 5e-4, 1e-3, dtype=float)
    heading = start["heading_rad"]
    x, y = start["x_m"] + distances * numpy.cos(heading), start["y_m"] + distances * numpy.sin(heading)
    return Line(distances, x, y, numpy.full(len(distances), heading))


def strip_heights_m(heights: Heights, scene: Mapping[str, Any], line: Line, left_m: float, width_m: float) -> Floats:
    """Return the maximum height, (n,) in m, across a strip ``width_m`` wide, ``left_m`` to the left of ``line``.

    At each point of the line the strip is a segment across the heading, sampled from edge to edge.
    """
    offsets = left_m + numpy.linspace(-width_m / 2, width_m / 2, ACROSS)[:, None]
    x = line.x_m - offsets * numpy.sin(line.heading_rad)
    y = line.y_m + offsets * numpy.cos(line.heading_rad)
    highest: Floats = heights(scene, x, y).max(axis=0)
    return highest
