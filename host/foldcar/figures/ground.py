"""The height of a scene's ground over a rectangle of the plane, as pictures show it from above."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.simulation.heights import Floats, Heights


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


def height_map(heights: Heights, scene: Mapping[str, Any], extent: Extent, cells: int) -> HeightMap:
    """The ground over approximately ``extent``, with ``cells`` cells along its longer side."""
    cell = max(extent.size_m) / cells
    columns, rows = (max(2, round(size / cell)) for size in extent.size_m)
    x = extent.x_min_m + cell * (numpy.arange(columns) + 0.5)
    y = extent.y_min_m + cell * (numpy.arange(rows) + 0.5)
    covered = Extent(extent.x_min_m, extent.x_min_m + columns * cell, extent.y_min_m, extent.y_min_m + rows * cell)
    return HeightMap(covered, cell, heights(scene, *numpy.meshgrid(x, y)))
