"""The ground of scenes as compact height maps, as the simulator itself computes it.

Input: scenes of docs/carsim.md. Output: for each a rectangle of square cells whose heights ``ground.js`` of the report
reads: row by row from the lowest y, each cell's difference from the one before it in units of HEIGHT_M, as integers of
compact_path.py.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy

from foldcar.figures.compact_path import varints
from foldcar.figures.ground import Extent
from foldcar.figures.top_view import view_of
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import side_by_side

HEIGHT_M = 0.0005
LEAST_CELL_M = 0.005
# What carsim computes in a few seconds, and a browser draws at once.
MOST_CELLS = 4_000_000
MOST_CELLS_OF_A_SCENE = 120_000


@dataclass(frozen=True)
class GroundMaps:
    """Maps of several scenes over one rectangle; ``maps`` are the bytes of each, None for a scene without heights."""

    extent: Extent
    cell_m: float
    columns: int
    rows: int
    maps: list[bytes | None]


def ground_maps(
    scenes: Sequence[dict[str, Any]], carsim: Carsim, jobs: int, done: Callable[[int], None] = lambda scenes: None
) -> GroundMaps:
    """The grounds of ``scenes``, at least one; ``done`` is told when one is ready. FoldcarError."""
    extent = view_of(scenes)
    length, width = extent.size_m
    most = min(MOST_CELLS_OF_A_SCENE, MOST_CELLS // len(scenes))
    cell = max(LEAST_CELL_M, math.sqrt(length * width / most))
    columns, rows = max(2, math.ceil(length / cell)), max(2, math.ceil(width / cell))
    x = extent.x_min_m + cell * (numpy.arange(columns) + 0.5)
    y = extent.y_min_m + cell * (numpy.arange(rows) + 0.5)
    along = ",".join(f"{one:.4f}" for one in x)
    # The points are the same in every scene: their text is written once.
    places = f'"x_m":[{",".join([along] * rows)}],"y_m":[{",".join(",".join([f"{one:.4f}"] * columns) for one in y)}]'

    def one_map(scene: dict[str, Any]) -> bytes | None:
        if not scene["terrain"]:
            return None
        question = f'{{"heights":{{"id":"h","scene":"s",{places}}}}}'
        (answer,) = carsim.answers([json.dumps({"scene": {**scene, "id": "s"}}), question])
        heights = numpy.rint(numpy.array(answer["z_m"]) / HEIGHT_M).astype(numpy.int64)
        return varints(numpy.diff(heights, prepend=0)) if heights.any() else None

    maps = []
    for made in side_by_side((partial(one_map, scene) for scene in scenes), jobs, carsim.stop):
        maps.append(made)
        done(1)
    return GroundMaps(extent, cell, columns, rows, maps)
