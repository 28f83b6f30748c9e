"""A run of the simulator as the view page replays it: where car, hinges and wheels were, and the ground.

Input: a design's folded car, body and scene of docs/carsim.md, the run's path. Output: JSON in millimetres, seconds and
radians. The path has no angles of wheels: they turn here as if they rolled without slip, which the page says.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.figures.ground import Heights, height_map
from foldcar.figures.top_view import view_of
from foldcar.models.exported_car import main_segment
from foldcar.scenes.terrain_kinds import kind_of

INTERVAL_S = 0.02
MM = 1000.0
# Cells along the longer side of the ground: about 10 mm each, and 150 kB of text.
CELLS = 320
HEIGHT_MM = 0.5
ARC_STEPS = 48

Floats = NDArray[numpy.float64]


def recorded_run(
    body: Mapping[str, Any], scene: Mapping[str, Any], path: Sequence[Sequence[float]], heights: Heights, told: str
) -> dict[str, Any]:
    """The object that run.js reads; ``told`` says which run it is and what is to be known of it."""
    rows = numpy.asarray(path, dtype=float)
    rows[:, 4] = numpy.unwrap(rows[:, 4])
    turns = rolled_rad(body, rows)
    rows[:, 1:4] *= MM
    whole = numpy.column_stack([numpy.round(rows, 4), numpy.round(turns, 3)])
    ground, cell_mm = _ground(scene, path, heights)
    course = scene["course"]
    return {
        "told": f"{told} The wheels turn as if they did not slip: a path has no angles of wheels. "
        f"The ground is drawn in cells of {cell_mm:.0f} mm, brown above the floor, blue below it; orange: the goal"
        + ("; violet: a friction of its own." if _patches(scene) else "."),
        "rows": whole.tolist(),
        "main": main_segment(body),
        "ground": ground,
        "course": [round(course[key] * MM, 1) for key in ("x_min_m", "y_min_m", "x_max_m", "y_max_m")],
        "goal": _goal(scene),
        "patches": _patches(scene),
    }


def rolled_rad(body: Mapping[str, Any], rows: Floats) -> Floats:
    """Angles (rows, wheels) by which wheels turn that do not slip, on a path (SI, headings without leaps)."""
    middle = (rows[1:, 4] + rows[:-1, 4]) / 2
    x, y, z = (numpy.diff(rows[:, column]) for column in (1, 2, 3))
    level = x * numpy.cos(middle) + y * numpy.sin(middle)
    # Uphill the way is longer than its projection.
    ahead = numpy.copysign(numpy.hypot(level, z), level)
    turned = numpy.diff(rows[:, 4])
    found = numpy.zeros((len(rows), len(body["wheels"])))
    for column, wheel in enumerate(body["wheels"]):
        side = 1 if wheel["side"] == "left" else -1
        way = numpy.cumsum(ahead - side * body["track_m"] / 2 * turned)
        found[1:, column] = way / wheel["radius_m"]
    return found


def _ground(scene: Mapping[str, Any], path: Any, heights: Heights) -> tuple[dict[str, Any], float]:
    extent = view_of([scene], path)
    surface = height_map(heights, scene, extent, CELLS)
    whole = numpy.rint(surface.z_m.ravel() * MM / HEIGHT_MM).astype(int)
    rows, columns = surface.z_m.shape
    place = surface.extent
    return {
        "x_mm": round(place.x_min_m * MM, 3),
        "y_mm": round(place.y_min_m * MM, 3),
        "cell_mm": round(surface.cell_m * MM, 6),
        "columns": columns,
        "rows": rows,
        "height_mm": HEIGHT_MM,
        "heights": numpy.diff(whole, prepend=0).tolist() if whole.any() else None,
    }, surface.cell_m * MM


def _goal(scene: Mapping[str, Any]) -> list[list[list[float]]]:
    """The goal's outlines: a circle, or a line across the course."""
    goal = scene["goal"]
    if goal is None:
        return []
    if goal["kind"] == "disc":
        angles = numpy.linspace(0, 2 * math.pi, ARC_STEPS + 1)
        x, y = (goal["x_m"] + goal["radius_m"] * numpy.cos(angles), goal["y_m"] + goal["radius_m"] * numpy.sin(angles))
        return [_in_mm(zip(x.tolist(), y.tolist(), strict=True))]
    along = (-math.sin(goal["heading_rad"]), math.cos(goal["heading_rad"]))
    course, low, high = scene["course"], -math.inf, math.inf
    for axis, slope in zip("xy", along, strict=True):
        if abs(slope) > 1e-9:
            ends = sorted((course[f"{axis}_{end}_m"] - goal[f"{axis}_m"]) / slope for end in ("min", "max"))
            low, high = max(low, ends[0]), min(high, ends[1])
    return [_in_mm((goal["x_m"] + s * along[0], goal["y_m"] + s * along[1]) for s in (low, high))]


def _patches(scene: Mapping[str, Any]) -> list[list[list[float]]]:
    """The closed outlines of patches with a friction of their own."""
    found = []
    for piece in scene["terrain"]:
        if kind_of(piece).form == "patch":
            cos, sin = math.cos(piece["heading_rad"]), math.sin(piece["heading_rad"])
            x, y = piece["length_m"] / 2, piece["width_m"] / 2
            corners = [(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
            found.append(_in_mm((piece["x_m"] + a * cos - b * sin, piece["y_m"] + a * sin + b * cos) for a, b in corners))
    return found


def _in_mm(points: Any) -> list[list[float]]:
    return [[round(float(x) * MM, 1), round(float(y) * MM, 1)] for x, y in points]
