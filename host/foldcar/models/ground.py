"""The smooth part of a scene's ground as a grid of heights, and how high a level car stands at its start.

Input: body and scene of docs/carsim.md; heights as carsim computes them, so that shapes of smooth ground are defined
once. Output: a HeightGrid, or None without smooth ground; the height of the car's frame just above contact with the
ground. Tyres are cylinders and bellies boxes, as in the exported models. They are compared with the ground at points,
also along every edge. Both ways to split a height field's cell into triangles count, because engines differ in them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

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


def smooth_bounds_m(scene: Mapping[str, Any]) -> tuple[float, float, float, float] | None:
    """Return x_min, x_max, y_min, y_max of the scene's smooth ground within reach of cars; None without smooth ground."""
    bounds = [bounds_m(piece) for piece in scene["terrain"] if kind_of(piece).form == "smooth"]
    if not bounds:
        return None
    course = scene["course"]
    x_mins, x_maxs, y_mins, y_maxs = zip(*bounds, strict=True)
    return (
        max(min(x_mins), course["x_min_m"] - MARGIN_M),
        min(max(x_maxs), course["x_max_m"] + MARGIN_M),
        max(min(y_mins), course["y_min_m"] - MARGIN_M),
        min(max(y_maxs), course["y_max_m"] + MARGIN_M),
    )


def smooth_ground(
    scene: Mapping[str, Any], heights: Heights, spacings_m: Sequence[float] = SPACINGS_M
) -> HeightGrid | None:
    """Return a grid with the heights of a scene's smooth ground, or None if the scene has no smooth ground.

    Grids are tried from the coarsest of ``spacings_m`` to the finest. The result is the first one whose error at the
    centres of its cells is at most ERROR_M. If there is none, it is the finest one that has at most MAX_POINTS points.
    Raises FoldcarError if even the coarsest grid has more points.
    """
    bounds = smooth_bounds_m(scene)
    if bounds is None:
        return None
    x_min, x_max, y_min, y_max = bounds
    smooth_scene = {**scene, "terrain": [piece for piece in scene["terrain"] if kind_of(piece).form == "smooth"]}
    grid = None
    for spacing_m in spacings_m:
        columns = max(2, math.ceil((x_max - x_min) / spacing_m) + 1)
        rows = max(2, math.ceil((y_max - y_min) / spacing_m) + 1)
        if rows * columns > MAX_POINTS:
            if grid is None:
                raise FoldcarError(f"terrain: {rows} x {columns} heights are above the limit {MAX_POINTS}")
            break
        x = numpy.linspace(x_min, x_max, columns, dtype=float)
        y = numpy.linspace(y_min, y_max, rows, dtype=float)
        z = heights(smooth_scene, *numpy.meshgrid(x, y))
        grid = HeightGrid(x_min, x_max, y_min, y_max, z)
        if spacing_m == spacings_m[-1]:
            break
        centre_heights = heights(smooth_scene, *numpy.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2))
        interpolated = (z[1:, 1:] + z[1:, :-1] + z[:-1, 1:] + z[:-1, :-1]) / 4
        if numpy.abs(centre_heights - interpolated).max() <= ERROR_M:
            break
    assert grid is not None
    return grid


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


def start_height_m(body: Mapping[str, Any], scene: Mapping[str, Any], grid: HeightGrid | None) -> float:
    """Return the height (m) of the car's frame at the start of a scene, so that no part of the car touches the ground.

    The height is rounded up to RASTER_M, and the car then falls by FALL_M. The ground below a part is examined at points
    of the part's footprint.
    """
    start = scene["start"]
    # The frame must be at least so high that the part which needs most height just touches the ground.
    min_height = -math.inf
    cos, sin = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    blocks = [piece for piece in scene["terrain"] if kind_of(piece).form == "block"]
    # Each surface of the ground: its area, and a function that returns its height at points.
    surfaces = [(rectangle(block, reach_m(block)), partial(_block_top, block)) for block in blocks]
    for part in _parts(body):
        ahead, left = part.x_m * cos - part.y_m * sin, part.x_m * sin + part.y_m * cos
        place = {**start, "x_m": start["x_m"] + ahead, "y_m": start["y_m"] + left}
        footprint = rectangle(place, (part.half_length_m, part.half_width_m))
        for area, top in ((footprint, partial(_grid_top, grid)), *surfaces):
            overlap = footprint.intersection(area)
            if overlap.area > MIN_AREA_M2:
                x, y = _points(overlap)
                along = (x - start["x_m"]) * cos + (y - start["y_m"]) * sin
                needed_height = float(numpy.max(top(x, y) - part.underside(along)))
                min_height = max(min_height, needed_height)
    return float(math.ceil(min_height / RASTER_M) * RASTER_M + FALL_M)


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
    u = (x - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) * (columns - 1)
    v = (y - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) * (rows - 1)
    inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    column = numpy.clip(u.astype(int), 0, columns - 2)
    row = numpy.clip(v.astype(int), 0, rows - 2)
    # The corners of the cell are a and b in its lower row, and c and d in its upper row. s and t are the point's place
    # in the cell, from 0 to 1.
    s, t = u - column, v - row
    a, b = grid.z_m[row, column], grid.z_m[row, column + 1]
    c, d = grid.z_m[row + 1, column], grid.z_m[row + 1, column + 1]
    # The rising diagonal goes from a to d, the falling one from c to b.
    rising = numpy.where(s >= t, a + s * (b - a) + t * (d - b), a + t * (c - a) + s * (d - c))
    falling = numpy.where(s + t <= 1, a + s * (b - a) + t * (c - a), d + (1 - s) * (c - d) + (1 - t) * (b - d))
    return numpy.where(inside, numpy.maximum(rising, falling), 0.0)
