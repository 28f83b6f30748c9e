"""Draws a scene from above: terrain by height, course, start, goal, and the path of a car if there is one."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Circle, Rectangle
from matplotlib.transforms import Affine2D

from foldcar.figures.style import ACCENT, FAILURE, INK

HEIGHT_COLOURS = LinearSegmentedColormap.from_list("height", ["#f3e6c8", "#cfa65b", "#8a5a1c", "#3f2506"])
ARROW_LENGTH_M = 0.2


def height_scale(scenes: Sequence[Mapping[str, Any]]) -> ScalarMappable:
    """One colour scale for all heights (mm) of several scenes."""
    heights_mm = [piece["height_m"] * 1e3 for scene in scenes for piece in scene["terrain"]]
    return ScalarMappable(Normalize(0.0, max(heights_mm, default=1.0)), HEIGHT_COLOURS)


def draw_top_view(axes: Axes, scene: Mapping[str, Any], heights: ScalarMappable, path: Any = ()) -> None:
    """Draw ``scene`` (docs/carsim.md) in metres; ``path`` rows begin with time, x, y."""
    axes.set_aspect("equal")
    axes.grid(False)
    course = scene["course"]
    corner = (course["x_min_m"], course["y_min_m"])
    size = (course["x_max_m"] - corner[0], course["y_max_m"] - corner[1])
    axes.add_patch(
        Rectangle(corner, *size, facecolor="#f7f7f5", edgecolor="#777777", linewidth=1.0, zorder=0)
    )
    # The highest counts where boxes overlap, so it is drawn last.
    for box in sorted(scene["terrain"], key=lambda piece: float(piece["height_m"])):
        _draw_box(axes, box, heights.to_rgba(box["height_m"] * 1e3))
    _draw_goal(axes, scene)
    if len(path):
        rows = numpy.asarray(path, dtype=float)
        axes.plot(
            rows[:, 1],
            rows[:, 2],
            color=ACCENT,
            linewidth=1.6,
            zorder=5,
            solid_capstyle="round",
            label="path",
        )
    start = scene["start"]
    _draw_arrow(axes, start["x_m"], start["y_m"], start["heading_rad"], ARROW_LENGTH_M, INK)
    axes.plot([start["x_m"]], [start["y_m"]], "o", color=INK, markersize=4, zorder=6, label="start")
    axes.autoscale_view()
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _draw_box(axes: Axes, box: Mapping[str, Any], colour: Any) -> None:
    length, width = box["length_m"], box["width_m"]
    place = Affine2D().rotate(box["heading_rad"]).translate(box["x_m"], box["y_m"])
    axes.add_patch(
        Rectangle(
            (-length / 2, -width / 2),
            length,
            width,
            facecolor=colour,
            edgecolor="#00000066",
            linewidth=0.5,
            transform=place + axes.transData,
            zorder=2,
        )
    )


def _draw_goal(axes: Axes, scene: Mapping[str, Any]) -> None:
    goal = scene["goal"]
    x, y = goal["x_m"], goal["y_m"]
    if goal["kind"] == "disc":
        disc = Circle(
            (x, y), goal["radius_m"], fill=False, edgecolor=FAILURE, linestyle="--", zorder=4, label="goal"
        )
        axes.add_patch(disc)
        axes.plot([x], [y], "+", color=FAILURE, zorder=4)
        return
    ends = _line_in_course(x, y, goal["heading_rad"], scene["course"])
    axes.plot(ends[:, 0], ends[:, 1], "--", color=FAILURE, linewidth=1.4, zorder=4, label="goal line")
    _draw_arrow(axes, x, y, goal["heading_rad"], ARROW_LENGTH_M / 2, FAILURE)


def _line_in_course(x: float, y: float, heading_rad: float, course: Mapping[str, float]) -> Any:
    """The ends (2 × 2) of the line through the point across the heading, where it leaves the course."""
    along = numpy.array([-numpy.sin(heading_rad), numpy.cos(heading_rad)])
    reach = []
    for position, slope, axis in ((x, along[0], "x"), (y, along[1], "y")):
        if abs(slope) > 1e-12:
            limits = (course[f"{axis}_min_m"], course[f"{axis}_max_m"])
            reach.append(sorted((limit - position) / slope for limit in limits))
    low, high = max(r[0] for r in reach), min(r[1] for r in reach)
    return numpy.array([[x, y]]) + numpy.array([[low], [high]]) * along


def _draw_arrow(axes: Axes, x: float, y: float, heading_rad: float, length_m: float, colour: str) -> None:
    tip = (x + length_m * numpy.cos(heading_rad), y + length_m * numpy.sin(heading_rad))
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tip, xytext=(x, y), arrowprops=arrow, zorder=6)
