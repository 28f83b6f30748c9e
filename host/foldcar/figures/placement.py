"""Draws the placement of car and obstacles for a trial, with letters and positions as in the instructions."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.transforms import Affine2D

from foldcar.figures.ground import height_map, height_scale
from foldcar.figures.output import check_format, save_figure
from foldcar.figures.style import ACCENT, INK, drawing_style
from foldcar.figures.top_view import draw_top_view, view_of
from foldcar.scenes.obstacles import CAR, Obstacle
from foldcar.simulation.heights import Heights

WIDTH_IN, MAX_HEIGHT_IN = 10.0, 9.0
TITLE_AND_LEGEND_IN = 0.8
CELLS = 600
# An edge is long if its half length is above this.
LONG_M = 0.2
LETTER = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": INK, "linewidth": 0.8}


def draw_placement(
    scene: Mapping[str, Any],
    obstacles: Mapping[str, Obstacle],
    length_m: float,
    width_m: float,
    heights: Heights,
    file: Path,
    title: str,
) -> None:
    """Draw a picture that shows where a person places the car and the obstacles of a scene, and save it as ``file``.

    ``scene`` is a scene of docs/carsim.md. ``obstacles`` are its obstacles by letter. ``length_m`` and ``width_m`` are
    the size of the car. Raises FoldcarError.
    """
    check_format(file)
    extent = view_of([scene])
    ground = height_map(heights, scene, extent, CELLS)
    scale = height_scale([ground])
    long_m, wide_m = extent.size_m
    with drawing_style():
        height_in = min(MAX_HEIGHT_IN, WIDTH_IN * wide_m / long_m + TITLE_AND_LEGEND_IN)
        figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        axes = figure.subplots()
        draw_top_view(axes, scene, ground, scale)
        _draw_car(axes, scene["start"], length_m, width_m)
        for letter, obstacle in obstacles.items():
            _draw_obstacle(axes, letter, obstacle, obstacle.near_edge_m(scene["terrain"]))
        axes.plot([0], [0], "x", color=ACCENT, markersize=8, zorder=7, label="mark on the floor, 0, 0")
        if obstacles:
            axes.plot([], [], ".-", color=ACCENT, label="edges to measure by tape: x, y (mm)")
        axes.set_title(title)
        if scene["terrain"]:
            figure.colorbar(scale, ax=axes, label="height (mm)", shrink=0.7, aspect=25)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        save_figure(figure, [file])


def _draw_obstacle(axes: Any, letter: str, obstacle: Obstacle, edge_m: Sequence[tuple[float, float]]) -> None:
    """Draw an obstacle's middle with its letter, and its near edge with the positions (mm) of both ends.

    ``edge_m`` has the ends of the edge, (x, y).
    """
    middle = (obstacle.x_m, obstacle.y_m)
    axes.plot(*middle, "+", color="white", markersize=9, markeredgewidth=3, zorder=7)
    axes.plot(*middle, "+", color=INK, markersize=7, zorder=7)
    axes.annotate(
        letter, middle, (10, 10), textcoords="offset points", bbox=LETTER, ha="center", va="center", fontsize=9, zorder=8
    )
    axes.plot(*zip(*edge_m, strict=True), ".-", color=ACCENT, markersize=7, zorder=7)
    middle_y_m = sum(y_m for _, y_m in edge_m) / len(edge_m)
    for x_m, y_m in edge_m:
        is_upper_end = y_m >= middle_y_m
        is_long = abs(y_m - middle_y_m) > LONG_M
        # The texts stand outside of the edge: above its upper end and below its lower end. But a long edge may end where
        # the picture ends, so its texts stand inside: below its upper end and above its lower end.
        is_text_above = is_upper_end != is_long
        _write_position(axes, x_m, y_m, is_text_above, is_text_right=x_m > obstacle.x_m)


def _write_position(axes: Any, x_m: float, y_m: float, is_text_above: bool, is_text_right: bool) -> None:
    """Write the position of a point (mm) beside it: above or below it, and right or left of it."""
    # The offset of the text from the point, in points of type.
    offset = (4 if is_text_right else -4, 5 if is_text_above else -5)
    axes.annotate(
        f"{round(1000 * x_m)}, {round(1000 * y_m)}",
        (x_m, y_m),
        offset,
        textcoords="offset points",
        ha="left" if is_text_right else "right",
        va="bottom" if is_text_above else "top",
        fontsize=8,
        zorder=8,
        bbox={"facecolor": "#ffffffcc", "edgecolor": "none", "pad": 1},
    )


def _draw_car(axes: Any, start: Mapping[str, float], length_m: float, width_m: float) -> None:
    """Draw the outline of the car at its start, with its letter behind it."""
    front_m, left_m = length_m / 2, width_m / 2
    corners = [(front_m, left_m), (front_m, -left_m), (-front_m, -left_m), (-front_m, left_m)]
    to_start = Affine2D().rotate(start["heading_rad"]).translate(start["x_m"], start["y_m"])
    outline = Polygon(to_start.transform(corners), closed=True, facecolor="none", edgecolor=INK, linewidth=1.2, zorder=6)
    axes.add_patch(outline)
    (rear,) = to_start.transform([(-front_m, 0)])
    axes.annotate(CAR, rear, (-4, 0), textcoords="offset points", ha="right", va="center")
