"""The smooth part of a scene's ground as a grid of heights, for engines that take height fields.

Input: a scene (docs/carsim.md) and carsim, which is asked for the heights: smooth ground is
shaped in one place only. Output: a HeightGrid over what they cover, or None if the scene has none.
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
# Heights (m) at points: x and y in, z out.
Heights = Callable[[Floats, Floats], Floats]

# A car's length beyond the course: nothing drives farther.
MARGIN_M = 0.3
# The grid is as coarse as this error at the middles of its cells allows: contacts cost time by the cell.
# It is what carsim's own profiles keep to.
ERROR_M = 2e-4
SPACINGS_M = (0.02, 0.01, 0.005)
MOST_POINTS = 4_000_000


@dataclass(frozen=True)
class HeightGrid:
    """Heights ``z_m`` (rows along y, columns along x) over the rectangle from the first to the last point."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float
    z_m: Floats


def smooth_ground(scene: Mapping[str, Any], carsim: Carsim) -> HeightGrid | None:
    """The grid of the scene's smooth ground. FoldcarError if it would be too large."""
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
    """The coarsest of a few grids that is within ERROR_M at the cells' middles, else the finest."""
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
