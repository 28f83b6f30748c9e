"""The smooth part of a scene's ground as a grid of heights, and how high a level car stands at its start.

Input: body and scene of docs/carsim.md; heights as carsim computes them, so that shapes of smooth ground are defined
once. Output: a HeightGrid, or None without smooth ground; the height of the car's frame just above contact with the
ground. Tyres are cylinders and bellies boxes, as in the exported models. They are compared with the ground at points,
also along every edge. Both ways to split a height field's cell into triangles count, because engines differ in them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy
import shapely
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.models.exported_car import axle_m, tyre_center_m
from foldcar.scenes.checks import rectangle
from foldcar.scenes.terrain_kinds import bounds_m, kind_of, reach_m
from foldcar.simulation.heights import Heights

Floats = NDArray[numpy.float64]

# The grid extends beyond the course, which no car leaves, by a car's length.
MARGIN_M = 0.3
# Maximum interpolation error at the cells' centres. The grid is as coarse as it allows, because contacts cost time per
# cell. carsim's own profiles have the same tolerance.
ERROR_M = 2e-4
SPACINGS_M = (0.02, 0.01, 0.005)
MAX_POINTS = 4_000_000
# The car starts this far above contact.
FALL_M = 5e-4
# Spacing of the points at which parts are compared with the ground. A common area up to the minimum is not a contact.
SPACING_M, MIN_AREA_M2 = 1e-3, 1e-12
# The accuracy of engines' contacts; rounding up to it gives the same height, whatever rounding a scene's numbers have.
RASTER_M = 1e-5


@dataclass(frozen=True)
class HeightGrid:
    """Heights ``z_m``, (rows, columns) along (y, x), at equidistant points of the rectangle, limits included (m)."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float
    z_m: Floats


class GroundLimits(NamedTuple):
    """The limits of a rectangle of ground (m)."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float


def smooth_bounds_m(scene: Mapping[str, Any]) -> GroundLimits | None:
    """Return the limits of the scene's smooth ground, as far as cars can reach it; None without smooth ground.

    Cars do not leave the course by more than MARGIN_M.
    """
    bounds = [bounds_m(piece) for piece in scene["terrain"] if kind_of(piece).form == "smooth"]
    if not bounds:
        return None
    course = scene["course"]
    x_mins, x_maxs, y_mins, y_maxs = zip(*bounds, strict=True)
    return GroundLimits(
        x_min_m=max(min(x_mins), course["x_min_m"] - MARGIN_M),
        x_max_m=min(max(x_maxs), course["x_max_m"] + MARGIN_M),
        y_min_m=max(min(y_mins), course["y_min_m"] - MARGIN_M),
        y_max_m=min(max(y_maxs), course["y_max_m"] + MARGIN_M),
    )


def smooth_ground(
    scene: Mapping[str, Any], heights: Heights, spacings_m: Sequence[float] = SPACINGS_M
) -> HeightGrid | None:
    """Return a grid with the heights of a scene's smooth ground, or None if the scene has no smooth ground.

    Grids are tried from the coarsest of ``spacings_m`` to the finest. The result is the first one whose error at the
    centres of its cells is at most ERROR_M. If there is none, it is the finest one that has at most MAX_POINTS points.
    Raises FoldcarError if even the coarsest grid has more points.
    """
    limits = smooth_bounds_m(scene)
    if limits is None:
        return None
    smooth_scene = {**scene, "terrain": [piece for piece in scene["terrain"] if kind_of(piece).form == "smooth"]}
    grid = None
    for spacing_m in spacings_m:
        x = _points_between(limits.x_min_m, limits.x_max_m, spacing_m)
        y = _points_between(limits.y_min_m, limits.y_max_m, spacing_m)
        if len(x) * len(y) > MAX_POINTS:
            if grid is None:
                raise FoldcarError(f"terrain: {len(y)} x {len(x)} heights are above the limit {MAX_POINTS}")
            break
        z = heights(smooth_scene, *numpy.meshgrid(x, y))
        grid = HeightGrid(*limits, z)
        is_finest = spacing_m == spacings_m[-1]
        if is_finest or _error_at_centres_m(heights, smooth_scene, x, y, z) <= ERROR_M:
            break
    assert grid is not None
    return grid


def _points_between(low_m: float, high_m: float, spacing_m: float) -> Floats:
    """Return equidistant points from ``low_m`` to ``high_m``, at most ``spacing_m`` apart, at least two."""
    number = max(2, math.ceil((high_m - low_m) / spacing_m) + 1)
    return numpy.linspace(low_m, high_m, number, dtype=float)


def _error_at_centres_m(heights: Heights, scene: Mapping[str, Any], x: Floats, y: Floats, z: Floats) -> float:
    """Return the largest error of a grid at the centres of its cells (m).

    ``x`` (columns,) and ``y`` (rows,) are the places of the grid's points, and ``z`` (rows, columns) their heights. In
    the grid, the height at a centre is the mean of the heights at the four corners of the cell.
    """
    true_heights = heights(scene, *numpy.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2))
    upper_rows, lower_rows = z[1:], z[:-1]
    means = (upper_rows[:, 1:] + upper_rows[:, :-1] + lower_rows[:, 1:] + lower_rows[:, :-1]) / 4
    return float(numpy.abs(true_heights - means).max())


@dataclass(frozen=True)
class _Part:
    """A part of the car that may touch the ground: a rectangle of the car's frame (m).

    It is a tyre of that radius about (``x_m``, ``z_m``), or a flat belly at ``z_m``.
    """

    x_m: float
    y_m: float
    z_m: float
    half_length_m: float
    half_width_m: float
    radius_m: float = math.inf

    def underside(self, x: Floats) -> Floats:
        """Return the heights (m) of the part's lowest points at places x."""
        if math.isinf(self.radius_m):
            return numpy.full_like(x, self.z_m)
        along = numpy.minimum(numpy.abs(x - self.x_m), self.radius_m)
        return self.z_m - numpy.sqrt(self.radius_m**2 - along**2)


class _Surface(NamedTuple):
    """A part of the ground: its area seen from above, and a function that returns its heights (m) at points x, y."""

    area: shapely.Polygon
    heights: Callable[[Floats, Floats], Floats]


def start_height_m(body: Mapping[str, Any], scene: Mapping[str, Any], grid: HeightGrid | None) -> float:
    """Return the height (m) of the car's frame at the start of a scene, so that no part of the car touches the ground.

    The height is rounded up to RASTER_M, and the car then falls by FALL_M. The ground below a part is examined at points
    of the part's footprint.
    """
    start = scene["start"]
    cos, sin = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    blocks = [piece for piece in scene["terrain"] if kind_of(piece).form == "block"]
    tops_of_blocks = [_Surface(rectangle(block, reach_m(block)), partial(_block_top, block)) for block in blocks]
    # For each part above each surface, the height of the frame at which the part just touches the surface.
    contact_heights = []
    for part in _parts(body):
        # The part's place in the scene: the car's frame is turned by the heading.
        part_x = start["x_m"] + (part.x_m * cos - part.y_m * sin)
        part_y = start["y_m"] + (part.x_m * sin + part.y_m * cos)
        footprint = rectangle({**start, "x_m": part_x, "y_m": part_y}, (part.half_length_m, part.half_width_m))
        floor = _Surface(footprint, partial(_grid_top, grid))
        for surface in (floor, *tops_of_blocks):
            overlap = footprint.intersection(surface.area)
            if overlap.area > MIN_AREA_M2:
                x, y = _points(overlap)
                x_in_car = (x - start["x_m"]) * cos + (y - start["y_m"]) * sin
                contact_heights.append(float(numpy.max(surface.heights(x, y) - part.underside(x_in_car))))
    return float(math.ceil(max(contact_heights) / RASTER_M) * RASTER_M + FALL_M)


def _parts(body: Mapping[str, Any]) -> list[_Part]:
    """Return the car's parts that may touch the ground: segments and wheels."""
    parts = []
    for segment in body["segments"]:
        bottom = segment["center_z_m"] - segment["height_m"] / 2
        half_length_m, half_width_m = segment["length_m"] / 2, segment["width_m"] / 2
        parts.append(_Part(segment["x_m"], 0.0, bottom, half_length_m, half_width_m))
    for wheel in body["wheels"]:
        x, y, z = (a + b for a, b in zip(axle_m(body, wheel), tyre_center_m(wheel), strict=True))
        radius = wheel["radius_m"]
        parts.append(_Part(x, y, z, half_length_m=radius, half_width_m=wheel["width_m"] / 2, radius_m=radius))
    return parts


def _points(area: shapely.Polygon) -> Floats:
    """Return points (2, n) of the area and along its edge, SPACING_M apart at most."""
    edge = shapely.get_coordinates(shapely.segmentize(area, SPACING_M)).T
    x_min, y_min, x_max, y_max = area.bounds
    inner = numpy.meshgrid(numpy.arange(x_min, x_max, SPACING_M), numpy.arange(y_min, y_max, SPACING_M))
    is_inside = shapely.contains_xy(area, *inner)
    return numpy.concatenate([edge, numpy.stack([axis[is_inside] for axis in inner])], axis=1)


def _block_top(block: Mapping[str, Any], x: Floats, y: Floats) -> Floats:
    """Return the heights (m) of the top of a box, a ramp or a half round at points x, y within it."""
    half, height = block["length_m"] / 2, block["height_m"]
    if block["kind"] == "box":
        return numpy.full_like(x, height)
    heading_rad = block["heading_rad"]
    along = (x - block["x_m"]) * math.cos(heading_rad) + (y - block["y_m"]) * math.sin(heading_rad)
    if block["kind"] == "ramp":
        # From 0 at the low end, where along is -half, to 1 at the high end.
        fraction = numpy.clip((along / half + 1) / 2, 0.0, 1.0)
        return numpy.asarray(fraction * height)
    # A half round is the segment of a circle through both ends of its base.
    radius = (half**2 + height**2) / (2 * height)
    return numpy.asarray(numpy.sqrt(numpy.maximum(radius**2 - along**2, 0.0)) + height - radius)


def _grid_top(grid: HeightGrid | None, x: Floats, y: Floats) -> Floats:
    """Return the heights (m) of the ground at points x, y: those of the grid, and 0 on the level floor around it.

    Engines divide each cell of a grid into two triangles, by one of its two diagonals. They differ in which one they
    take. So the result is the height that is higher with either diagonal.
    """
    if grid is None:
        return numpy.zeros_like(x)
    rows, columns = grid.z_m.shape
    # The points' places in the grid, in cells. The whole numbers are the grid's points.
    u = (x - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) * (columns - 1)
    v = (y - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) * (rows - 1)
    is_inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    column = numpy.clip(u.astype(int), 0, columns - 2)
    row = numpy.clip(v.astype(int), 0, rows - 2)
    # The place of each point in its cell, from 0 to 1, and the heights at the corners of the cell.
    s, t = u - column, v - row
    lower_left, lower_right = grid.z_m[row, column], grid.z_m[row, column + 1]
    upper_left, upper_right = grid.z_m[row + 1, column], grid.z_m[row + 1, column + 1]
    # With the diagonal from lower left to upper right: the height in the triangle below it, and in the one above it.
    below_rising = lower_left + s * (lower_right - lower_left) + t * (upper_right - lower_right)
    above_rising = lower_left + t * (upper_left - lower_left) + s * (upper_right - upper_left)
    with_rising = numpy.where(s >= t, below_rising, above_rising)
    # The same with the diagonal from upper left to lower right.
    below_falling = lower_left + s * (lower_right - lower_left) + t * (upper_left - lower_left)
    above_falling = upper_right + (1 - s) * (upper_left - upper_right) + (1 - t) * (lower_right - upper_right)
    with_falling = numpy.where(s + t <= 1, below_falling, above_falling)
    return numpy.where(is_inside, numpy.maximum(with_rising, with_falling), 0.0)
