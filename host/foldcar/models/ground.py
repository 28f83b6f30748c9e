"""The smooth part of a scene's ground as a grid of heights, for engines that support height fields.

Input: a scene (docs/carsim.md) and carsim, which computes the heights, so that the shapes of smooth ground are defined
once. Output: a HeightGrid over its area, or None if the scene has none.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.scenes.terrain_kinds import bounds_m, kind_of
from foldcar.simulation.carsim import Carsim

Floats = NDArray[numpy.float64]
# Function from x and y of points, (n,) each, to their heights, (n,); all in m.
Heights = Callable[[Floats, Floats], Floats]

# The grid ends a car's length beyond the course, which no car leaves.
MARGIN_M = 0.3
# The grid is as coarse as this interpolation error at the cells' centres allows, because contacts cost time per
# cell. carsim's own profiles have the same tolerance.
ERROR_M = 2e-4
SPACINGS_M = (0.02, 0.01, 0.005)
MOST_POINTS = 4_000_000


@dataclass(frozen=True)
class HeightGrid:
    """Heights ``z_m``, (rows, columns) along (y, x), at equidistant points of the rectangle, limits included (m)."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float
    z_m: Floats


def smooth_ground(scene: Mapping[str, Any], carsim: Carsim) -> HeightGrid | None:
    """The grid of the scene's smooth ground; None without any. FoldcarError if it is too large."""
    pieces = [piece for piece in scene["terrain"] if kind_of(piece).form == "smooth"]
    if not pieces:
        return None
    smooth_scene = json.dumps({**scene, "id": "smooth", "terrain": pieces})

    def heights(x_m: Floats, y_m: Floats) -> Floats:
        question = {"id": "grid", "scene": "smooth", "x_m": x_m.tolist(), "y_m": y_m.tolist()}
        (answer,) = carsim.answers([f'{{"scene": {smooth_scene}}}', json.dumps({"heights": question})])
        return numpy.asarray(answer["z_m"])

    return height_grid(pieces, scene["course"], heights)


def height_grid(
    pieces: Sequence[Mapping[str, Any]], course: Mapping[str, float], heights: Heights
) -> HeightGrid:
    """The coarsest grid of SPACINGS_M whose error at the cells' centres is within ERROR_M, else the finest.

    FoldcarError if even the coarsest has more than MOST_POINTS points.
    """
    bounds = [bounds_m(piece) for piece in pieces]
    x_min = max(min(b[0] for b in bounds), course["x_min_m"] - MARGIN_M)
    x_max = min(max(b[1] for b in bounds), course["x_max_m"] + MARGIN_M)
    y_min = max(min(b[2] for b in bounds), course["y_min_m"] - MARGIN_M)
    y_max = min(max(b[3] for b in bounds), course["y_max_m"] + MARGIN_M)
    grid = None
    for spacing_m in SPACINGS_M:
        columns = max(2, math.ceil((x_max - x_min) / spacing_m) + 1)
        rows = max(2, math.ceil((y_max - y_min) / spacing_m) + 1)
        if rows * columns > MOST_POINTS:
            if grid is None:
                raise FoldcarError(f"terrain: {rows} x {columns} heights are above the limit {MOST_POINTS}")
            break
        x = numpy.linspace(x_min, x_max, columns, dtype=float)
        y = numpy.linspace(y_min, y_max, rows, dtype=float)
        z = _sample(x, y, heights)
        grid = HeightGrid(x_min, x_max, y_min, y_max, z)
        between = _sample((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2, heights)
        means = (z[1:, 1:] + z[1:, :-1] + z[:-1, 1:] + z[:-1, :-1]) / 4
        if numpy.abs(between - means).max() <= ERROR_M:
            break
    assert grid is not None
    return grid


def _sample(x: Floats, y: Floats, heights: Heights) -> Floats:
    xs, ys = numpy.meshgrid(x, y)
    return heights(xs.ravel(), ys.ravel()).reshape(xs.shape)
