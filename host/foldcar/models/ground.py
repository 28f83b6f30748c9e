"""The smooth part of a scene's ground as a grid of heights, and how high a level car stands at its start.

Input: body and scene of docs/carsim.md; heights as carsim computes them, so that shapes of smooth ground are defined
once. Output: a HeightGrid, or None if nothing is smooth; the height of the car's frame with which it all but touches the
ground. Tyres are cylinders and bellies boxes, as in the exported models. Against boxes, ramps and half-rounds the height
is exact across the car, and along it in slices of a 200th of a part; of a height field both ways to split a cell into
triangles count, because engines differ in them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
import shapely
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.models.exported_car import axle_m, tyre_center_m
from foldcar.scenes.terrain_kinds import bounds_m, kind_of
from foldcar.simulation.heights import Heights

Floats = NDArray[numpy.float64]

# The grid ends a car's length beyond the course, which no car leaves.
MARGIN_M = 0.3
# The grid is as coarse as this interpolation error at the cells' centres allows, because contacts cost time per
# cell. carsim's own profiles have the same tolerance.
ERROR_M = 2e-4
SPACINGS_M = (0.02, 0.01, 0.005)
MOST_POINTS = 4_000_000
# The car falls this far.
FALL_M = 5e-4
SLICES = 201
ACROSS_M = 1e-3
# As accurately as engines see contacts; the same height, whatever rounding a scene's numbers have.
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
    """Least and largest x, then y, of the scene's smooth ground as far as cars get; None without any."""
    bounds = [bounds_m(piece) for piece in scene["terrain"] if kind_of(piece).form == "smooth"]
    if not bounds:
        return None
    course = scene["course"]
    x_min = max(min(b[0] for b in bounds), course["x_min_m"] - MARGIN_M)
    x_max = min(max(b[1] for b in bounds), course["x_max_m"] + MARGIN_M)
    y_min = max(min(b[2] for b in bounds), course["y_min_m"] - MARGIN_M)
    y_max = min(max(b[3] for b in bounds), course["y_max_m"] + MARGIN_M)
    return x_min, x_max, y_min, y_max


def smooth_ground(
    scene: Mapping[str, Any], heights: Heights, spacings_m: Sequence[float] = SPACINGS_M
) -> HeightGrid | None:
    """The grid of the scene's smooth ground; None without any.

    It is the coarsest of ``spacings_m`` whose error at the cells' centres is within ERROR_M, else the finest.
    FoldcarError if even the coarsest has more than MOST_POINTS points.
    """
    found = smooth_bounds_m(scene)
    if found is None:
        return None
    x_min, x_max, y_min, y_max = found
    smooth = {**scene, "terrain": [piece for piece in scene["terrain"] if kind_of(piece).form == "smooth"]}
    grid = None
    for spacing_m in spacings_m:
        columns = max(2, math.ceil((x_max - x_min) / spacing_m) + 1)
        rows = max(2, math.ceil((y_max - y_min) / spacing_m) + 1)
        if rows * columns > MOST_POINTS:
            if grid is None:
                raise FoldcarError(f"terrain: {rows} x {columns} heights are above the limit {MOST_POINTS}")
            break
        x = numpy.linspace(x_min, x_max, columns, dtype=float)
        y = numpy.linspace(y_min, y_max, rows, dtype=float)
        z = heights(smooth, *numpy.meshgrid(x, y))
        grid = HeightGrid(x_min, x_max, y_min, y_max, z)
        if spacing_m == spacings_m[-1]:
            break
        between = heights(smooth, *numpy.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2))
        means = (z[1:, 1:] + z[1:, :-1] + z[:-1, 1:] + z[:-1, :-1]) / 4
        if numpy.abs(between - means).max() <= ERROR_M:
            break
    assert grid is not None
    return grid


@dataclass(frozen=True)
class _Part:
    """A rectangle of the car's frame (m): a tyre of that radius about (``x_m``, ``z_m``), or a flat belly at ``z_m``."""

    x_m: float
    y_m: float
    z_m: float
    half_length_m: float
    half_width_m: float
    radius_m: float | None = None

    def underside(self, x: Floats) -> Floats:
        """Heights (m) of the lowest points at places x."""
        if self.radius_m is None:
            return numpy.full_like(x, self.z_m)
        along = numpy.minimum(numpy.abs(x - self.x_m), self.radius_m)
        return self.z_m - numpy.sqrt(self.radius_m**2 - along**2)

    def slices(self, low: float, high: float) -> Floats:
        """Places between two, the lowest point of the part among them."""
        return numpy.append(numpy.linspace(low, high, SLICES), min(max(self.x_m, low), high))


def start_height_m(body: Mapping[str, Any], scene: Mapping[str, Any] | None, grid: HeightGrid | None) -> float:
    """Height (m) of the car's frame at the scene's start; without a scene on a level floor."""
    terrain = scene["terrain"] if scene else ()
    blocks = [piece for piece in terrain if kind_of(piece).form == "block"]
    needed = -math.inf
    for part in _parts(body):
        if scene is None or grid is None:
            needed = max(needed, -float(part.underside(numpy.array([part.x_m]))[0]))
        else:
            needed = max(needed, _over_grid(part, scene["start"], grid))
        if scene is not None:
            needed = max([needed, *(_over_block(part, scene["start"], block) for block in blocks)])
    ground = (0.0, 0.0) if grid is None else (float(numpy.min(grid.z_m)), float(numpy.max(grid.z_m)))
    level = float(f"{max(wheel['radius_m'] for wheel in body['wheels']):.9g}")
    low = level + min(0.0, ground[0]) - 0.01
    high = level + max(0.0, ground[1], *(block["height_m"] for block in blocks), 0.0) + 0.01
    while high - low > RASTER_M:
        middle = (low + high) / 2
        low, high = (middle, high) if middle < needed else (low, middle)
    return float(high + FALL_M)


def _parts(body: Mapping[str, Any]) -> list[_Part]:
    parts = []
    for segment in body["segments"]:
        bottom = segment["center_z_m"] - segment["height_m"] / 2
        parts.append(_Part(segment["x_m"], 0.0, bottom, segment["length_m"] / 2, segment["width_m"] / 2))
    for wheel in body["wheels"]:
        x, y, z = (a + b for a, b in zip(axle_m(body, wheel), tyre_center_m(wheel), strict=True))
        radius = wheel["radius_m"]
        parts.append(_Part(x, y, z, radius, wheel["width_m"] / 2, radius))
    return parts


def _over_block(part: _Part, start: Mapping[str, float], block: Mapping[str, Any]) -> float:
    """The least height (m) of the car's frame with the part above the block; -inf beside it."""
    turn = block["heading_rad"] - start["heading_rad"]
    cos, sin = math.cos(turn), math.sin(turn)
    # The block's middle in the car's frame.
    dx, dy = block["x_m"] - start["x_m"], block["y_m"] - start["y_m"]
    x0 = dx * math.cos(start["heading_rad"]) + dy * math.sin(start["heading_rad"])
    y0 = dy * math.cos(start["heading_rad"]) - dx * math.sin(start["heading_rad"])
    half_length, half_width, height = block["length_m"] / 2, block["width_m"] / 2, block["height_m"]
    corners = [(sx * half_length, sy * half_width) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    outline = shapely.Polygon([(x0 + a * cos - b * sin, y0 + a * sin + b * cos) for a, b in corners])
    rectangle = shapely.box(
        part.x_m - part.half_length_m,
        part.y_m - part.half_width_m,
        part.x_m + part.half_length_m,
        part.y_m + part.half_width_m,
    )
    common = outline.intersection(rectangle)
    if common.area < 1e-12:
        return -math.inf
    edge = numpy.asarray(common.exterior.coords)
    x = numpy.concatenate([part.slices(edge[:, 0].min(), edge[:, 0].max()), edge[:, 0]])
    # The ends of the slices: within the part, the block's length and its width.
    right, left = numpy.full_like(x, part.y_m - part.half_width_m), numpy.full_like(x, part.y_m + part.half_width_m)
    for offset, slope, half in (((x - x0) * cos, sin, half_length), ((x0 - x) * sin, cos, half_width)):
        if abs(slope) > 1e-9:
            sides = y0 + (numpy.array([[-half], [half]]) - offset) / slope
            right, left = numpy.maximum(right, sides.min(axis=0)), numpy.minimum(left, sides.max(axis=0))
    # On a slice the block is highest at an end, or where a half-round's ridge is.
    along = (x - x0) * cos + (numpy.stack([right, left]) - y0) * sin
    if block["kind"] == "box":
        top = numpy.full_like(x, height)
    elif block["kind"] == "ramp":
        top = numpy.clip((along.max(axis=0) / half_length + 1) / 2, 0.0, 1.0) * height
    else:
        radius = (half_length**2 + height**2) / (2 * height)
        beside = numpy.where(along[0] * along[1] < 0, 0.0, numpy.abs(along).min(axis=0))
        top = numpy.sqrt(numpy.maximum(radius**2 - beside**2, 0.0)) + height - radius
    return float(numpy.max(top - part.underside(x)))


def _over_grid(part: _Part, start: Mapping[str, float], grid: HeightGrid) -> float:
    """The least height (m) of the car's frame with the part above the grid and the level floor around it."""
    along = part.slices(part.x_m - part.half_length_m, part.x_m + part.half_length_m)
    count = max(2, math.ceil(2 * part.half_width_m / ACROSS_M) + 1)
    across = numpy.linspace(part.y_m - part.half_width_m, part.y_m + part.half_width_m, count)
    x, y = numpy.meshgrid(along, across)
    cos, sin = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    tops = _grid_tops(grid, start["x_m"] + x * cos - y * sin, start["y_m"] + x * sin + y * cos)
    return float(numpy.max(tops - part.underside(x)))


def _grid_tops(grid: HeightGrid, x: Floats, y: Floats) -> Floats:
    rows, columns = grid.z_m.shape
    u = (x - grid.x_min_m) / (grid.x_max_m - grid.x_min_m) * (columns - 1)
    v = (y - grid.y_min_m) / (grid.y_max_m - grid.y_min_m) * (rows - 1)
    inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    column = numpy.clip(u.astype(int), 0, columns - 2)
    row = numpy.clip(v.astype(int), 0, rows - 2)
    s, t = u - column, v - row
    a, b = grid.z_m[row, column], grid.z_m[row, column + 1]
    c, d = grid.z_m[row + 1, column], grid.z_m[row + 1, column + 1]
    rising = numpy.where(s >= t, a + s * (b - a) + t * (d - b), a + t * (c - a) + s * (d - c))
    falling = numpy.where(s + t <= 1, a + s * (b - a) + t * (c - a), d + (1 - s) * (c - d) + (1 - t) * (b - d))
    return numpy.where(inside, numpy.maximum(rising, falling), 0.0)
