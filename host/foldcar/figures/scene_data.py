"""The ground of a scene as pages draw it: blocks as they are, hills and rough ground as a grid of heights.

Input: a scene of docs/carsim.md. Output: what ``ground.js`` reads: a head and integers, row by row
from the lowest y, each point's difference from the one before it.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.models.ground import SPACINGS_M, smooth_bounds_m, smooth_ground
from foldcar.simulation.heights import Heights

HEIGHT_M = 0.0005
# Maximum points of one scene of a page, and of all scenes: carsim computes them in seconds, a browser draws them at once.
MAX_POINTS_OF_A_SCENE = 40_000
MAX_POINTS = 1_500_000
# The 64 bits of a number are at most so many groups of 7 bits.
MAX_GROUPS = 10


def ground_data(scene: Mapping[str, Any], heights: Heights, scenes: int = 1) -> tuple[dict[str, Any], bytes]:
    """Return the ground of a scene for the script ``ground.js``: a head ``{"scene", "grid"}``, and the heights as bytes.

    The grid describes where the heights of smooth ground are. It is coarser if a page has more ``scenes``. If the scene
    has no smooth ground, the grid is None and the bytes are empty.
    """
    bounds = smooth_bounds_m(scene)
    if bounds is None:
        return {"scene": dict(scene), "grid": None}, b""
    x_min, x_max, y_min, y_max = bounds
    max_points = min(MAX_POINTS_OF_A_SCENE, MAX_POINTS // scenes)
    spacing = max(SPACINGS_M[-1], math.sqrt((x_max - x_min) * (y_max - y_min) / max_points))
    grid = smooth_ground(scene, heights, (spacing,))
    assert grid is not None
    rows, columns = grid.z_m.shape
    head = {
        "x_min_m": grid.x_min_m,
        "y_min_m": grid.y_min_m,
        "x_step_m": (grid.x_max_m - grid.x_min_m) / (columns - 1),
        "y_step_m": (grid.y_max_m - grid.y_min_m) / (rows - 1),
        "columns": columns,
        "rows": rows,
        "height_m": HEIGHT_M,
    }
    # Neighbouring heights differ little, and small integers have short codes.
    integers = numpy.rint(grid.z_m.ravel() / HEIGHT_M).astype(numpy.int64)
    return {"scene": dict(scene), "grid": head}, varints(numpy.diff(integers, prepend=0))


def varints(values: NDArray[numpy.int64]) -> bytes:
    """Encode integers so that small numbers take few bytes (zigzag and LEB128).

    First, 0, -1, 1, -2 … become 0, 1, 2, 3 …. Then each number is written in groups of 7 bits, the lowest group first.
    The highest bit of a byte says whether another group follows.
    """
    # The sign is moved to the lowest bit, so that small negative numbers are short too.
    remaining = ((values << 1) ^ (values >> 63)).astype(numpy.uint64)
    # A row of bytes for each number. Not all bytes of a row are written.
    encoded = numpy.zeros((len(remaining), MAX_GROUPS), dtype=numpy.uint8)
    is_written = numpy.zeros(encoded.shape, dtype=bool)
    is_written[:, 0] = True
    for index in range(MAX_GROUPS):
        encoded[:, index] = remaining & numpy.uint64(0x7F)
        remaining = remaining >> numpy.uint64(7)
        if not remaining.any():
            break
        another_follows = remaining > 0
        encoded[another_follows, index] |= 0x80
        is_written[another_follows, index + 1] = True
    # All written bytes, row by row.
    return encoded[is_written].tobytes()
