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
    # A row is time, x, y, z, heading and more (docs/carsim.md).
    rows = numpy.asarray(path, dtype=float)
    x_steps_m, y_steps_m = numpy.diff(rows[:, 1]), numpy.diff(rows[:, 2])
    heading_rad = numpy.unwrap(rows[:, 4])
    mean_heading_rad = (heading_rad[1:] + heading_rad[:-1]) / 2
    forward_m = x_steps_m * numpy.cos(mean_heading_rad) + y_steps_m * numpy.sin(mean_heading_rad)
    return numpy.concatenate([[0.0], numpy.cumsum(forward_m)])


def driven_line(path: Sequence[Sequence[float]], margin_m: float, spacing_m: float = 1e-3) -> Line:
    """Return the line that the car's centre drove, with a point every ``spacing_m``.

    It is extended straight by ``margin_m`` at both ends. ``path`` has rows of time, x, y, z and heading (docs/carsim.md).
    """
    rows = numpy.asarray(path, dtype=float)
    travelled = travelled_m(path)
    # Leave out the rows in which the car has rolled back, so that the distance always grows.
    farthest = numpy.maximum.accumulate(travelled)
    is_farther = numpy.concatenate([[True], travelled[1:] > farthest[:-1]])
    path_distance_m = travelled[is_farther]
    path_x_m, path_y_m = rows[is_farther, 1], rows[is_farther, 2]
    path_heading_rad = numpy.unwrap(rows[:, 4])[is_farther]
    first_m, last_m = min(float(numpy.min(travelled)), 0.0) - margin_m, path_distance_m[-1] + margin_m
    distance_m = numpy.arange(first_m, last_m + spacing_m / 2, spacing_m)
    x_m = numpy.interp(distance_m, path_distance_m, path_x_m)
    y_m = numpy.interp(distance_m, path_distance_m, path_y_m)
    # Beyond both ends of the path, interp returns the place of the end. Add the rest of the distance in the direction
    # of the car there. Before the start this distance is negative.
    before_start_m = numpy.minimum(distance_m - path_distance_m[0], 0.0)
    beyond_end_m = numpy.maximum(distance_m - path_distance_m[-1], 0.0)
    start_rad, end_rad = path_heading_rad[0], path_heading_rad[-1]
    return Line(
        distance_m,
        x_m=x_m + before_start_m * numpy.cos(start_rad) + beyond_end_m * numpy.cos(end_rad),
        y_m=y_m + before_start_m * numpy.sin(start_rad) + beyond_end_m * numpy.sin(end_rad),
        heading_rad=numpy.interp(distance_m, path_distance_m, path_heading_rad),
    )


def straight_line(start: Mapping[str, Any], first_m: float, last_m: float) -> Line:
    """Return the straight line along a pose's heading between two distances, with a point every millimetre."""
    # Half a step is added, so that the last point is not lost by rounding.
    distance_m = numpy.arange(first_m, last_m + 5e-4, 1e-3, dtype=float)
    heading_rad = start["heading_rad"]
    return Line(
        distance_m,
        x_m=start["x_m"] + distance_m * numpy.cos(heading_rad),
        y_m=start["y_m"] + distance_m * numpy.sin(heading_rad),
        heading_rad=numpy.full(len(distance_m), heading_rad),
    )


def strip_heights_m(heights: Heights, scene: Mapping[str, Any], line: Line, left_m: float, width_m: float) -> Floats:
    """Return the maximum height, (n,) in m, across a strip ``width_m`` wide, ``left_m`` to the left of ``line``.

    At each point of the line the strip is a segment across the heading, sampled from edge to edge.
    """
    offsets = left_m + numpy.linspace(-width_m / 2, width_m / 2, ACROSS)[:, None]
    x = line.x_m - offsets * numpy.sin(line.heading_rad)
    y = line.y_m + offsets * numpy.cos(line.heading_rad)
    highest: Floats = heights(scene, x, y).max(axis=0)
    return highest
