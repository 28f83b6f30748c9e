"""The height of a scene's ground as the simulator computes it.

Input: scenes of docs/carsim.md and points of the plane. Output: heights in metres.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.simulation.carsim import Carsim

Floats = NDArray[numpy.float64]
# Function (scene, x_m, y_m) -> z_m of arrays of equal shape.
Heights = Callable[[Mapping[str, Any], Floats, Floats], Floats]


@dataclass(frozen=True)
class Extent:
    """A rectangle of the plane (m)."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float

    @property
    def size_m(self) -> tuple[float, float]:
        """Length along x and along y."""
        return self.x_max_m - self.x_min_m, self.y_max_m - self.y_min_m


@dataclass(frozen=True)
class HeightMap:
    """Heights ``z_m``, (rows, columns) along (y, x), at the centres of square cells with side ``cell_m``."""

    extent: Extent
    cell_m: float
    z_m: Floats


def carsim_heights(carsim: Carsim) -> Heights:
    """A Heights function that asks ``carsim``; it raises CarsimError if carsim refuses the scene."""

    def heights(scene: Mapping[str, Any], x_m: Floats, y_m: Floats) -> Floats:
        question = {"id": "h", "scene": "s", "x_m": x_m.ravel().tolist(), "y_m": y_m.ravel().tolist()}
        lines = [json.dumps({"scene": {**scene, "id": "s"}}), json.dumps({"heights": question})]
        (answer,) = carsim.answers(lines)
        return numpy.asarray(answer["z_m"], dtype=float).reshape(x_m.shape)

    return heights


def height_map(heights: Heights, scene: Mapping[str, Any], extent: Extent, cells: int) -> HeightMap:
    """The ground over approximately ``extent``, with ``cells`` cells along its longer side."""
    cell = max(extent.size_m) / cells
    columns, rows = (max(2, round(size / cell)) for size in extent.size_m)
    x = extent.x_min_m + cell * (numpy.arange(columns) + 0.5)
    y = extent.y_min_m + cell * (numpy.arange(rows) + 0.5)
    covered = Extent(
        extent.x_min_m, extent.x_min_m + columns * cell, extent.y_min_m, extent.y_min_m + rows * cell
    )
    return HeightMap(covered, cell, heights(scene, *numpy.meshgrid(x, y)))
