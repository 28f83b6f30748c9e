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

WIDTH_IN = 10.0
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
    markers: Sequence[tuple[int, float, float, float, float]] = (),
    cards: Sequence[tuple[float, float, float, float]] = (),
) -> None:
    """Draw ``scene`` (docs/carsim.md), its lettered obstacles and the outline of a car of that size into ``file``.

    ``markers`` of a camera on the floor are number, x, y, turn and side (m, rad), ``cards`` of obstacles x, y, turn and
    side. Raises FoldcarError.
    """
    check_format(file)
    squares = [*(marker[1:] for marker in markers), *cards]
    extent = view_of([scene], [(0, x + by * side, y + by * side) for x, y, _, side in squares for by in (-0.7, 0.7)])
    ground = height_map(heights, scene, extent, CELLS)
    scale = height_scale([ground])
    long_m, wide_m = extent.size_m
    with drawing_style():
        figure = Figure(figsize=(WIDTH_IN, min(9.0, WIDTH_IN * wide_m / long_m + 0.8)), layout="constrained")
        axes = figure.subplots()
        draw_top_view(axes, scene, ground, scale)
        _draw_car(axes, scene["start"], length_m, width_m)
        for letter, obstacle in obstacles.items():
            place = (obstacle.x_m, obstacle.y_m)
            axes.plot(*place, "+", color="white", markersize=9, markeredgewidth=3, zorder=7)
            axes.plot(*place, "+", color=INK, markersize=7, zorder=7)
            axes.annotate(letter, place, (10, 10), textcoords="offset points", bbox=LETTER, ha="center",
                          va="center", fontsize=9, zorder=8)  # fmt: skip
            edge = obstacle.near_edge_m(scene["terrain"])
            axes.plot(*zip(*edge, strict=True), ".-", color=ACCENT, markersize=7, zorder=7)
            for end in edge:
                # Away from the other end; on long edges, which may end at the picture's, towards it.
                middle_m = sum(y_m for _, y_m in edge) / len(edge)
                above = (end[1] >= middle_m) != (abs(end[1] - middle_m) > LONG_M)
                right = end[0] > obstacle.x_m
                text, offset = f"{round(1000 * end[0])}, {round(1000 * end[1])}", (4 if right else -4, 5 if above else -5)
                axes.annotate(text, end, offset, textcoords="offset points", ha="left" if right else "right",
                              va="bottom" if above else "top", fontsize=8, zorder=8,
                              bbox={"facecolor": "#ffffffcc", "edgecolor": "none", "pad": 1})  # fmt: skip
        for label, (x_m, y_m, turn_rad, side_m) in zip(["a camera's cards", *[None] * len(cards)], cards, strict=False):
            _draw_outline(axes, (x_m, y_m), turn_rad, side_m, side_m, facecolor="#ffffffaa", label=label)
        for number, x_m, y_m, turn_rad, side_m in markers:
            at = (x_m, y_m)
            _draw_outline(axes, at, turn_rad, side_m, side_m, facecolor="white")
            axes.annotate(f"{number}", at, ha="center", va="center", fontsize=9, fontweight="bold", zorder=8)
            text = f"{1000 * x_m:.0f}, {1000 * y_m:.0f} mm"
            axes.annotate(text, (x_m, y_m - side_m / 2), (0, -5), textcoords="offset points", ha="center", va="top",
                          fontsize=8, zorder=8)  # fmt: skip
        axes.plot([0], [0], "x", color=ACCENT, markersize=8, zorder=7, label="mark on the floor, 0, 0")
        if obstacles:
            axes.plot([], [], ".-", color=ACCENT, label="edges to measure by tape: x, y (mm)")
        axes.set_title(title)
        if scene["terrain"]:
            figure.colorbar(scale, ax=axes, label="height (mm)", shrink=0.7, aspect=25)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        save_figure(figure, file)


def _draw_car(axes: Any, start: Mapping[str, float], length_m: float, width_m: float) -> None:
    at = (start["x_m"], start["y_m"])
    rear = _draw_outline(axes, at, start["heading_rad"], length_m, width_m, facecolor="none")
    axes.annotate(CAR, rear, (-4, 0), textcoords="offset points", ha="right", va="center")


def _draw_outline(
    axes: Any,
    at: Sequence[float],
    turn_rad: float,
    length_m: float,
    width_m: float,
    facecolor: str,
    label: str | None = None,
) -> Any:
    """Draw a turned rectangle, and return the middle of its rear side."""
    half, side = length_m / 2, width_m / 2
    corners = [(half, side), (half, -side), (-half, -side), (-half, side)]
    place = Affine2D().rotate(turn_rad).translate(*at)
    outline = Polygon(
        place.transform(corners), closed=True, facecolor=facecolor, edgecolor=INK, linewidth=1.2, zorder=6, label=label
    )
    axes.add_patch(outline)
    return place.transform([(-half, 0)])[0]
