"""Draws a scene from above: ground heights, patches, course, start, goal, optionally a car's path."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Circle, Rectangle
from matplotlib.transforms import Affine2D

from foldcar.figures.ground import Extent, HeightMap, shaded
from foldcar.figures.style import ACCENT, FAILURE, INK
from foldcar.scenes.terrain_kinds import kind_of, reach_m

ARROW_LENGTH_M = 0.2
VIEW_MARGIN_M = 0.2
# How far from its middle a piece of terrain is shown at most.
MAX_SHOWN_M = 0.4
CONTOUR_STEP_M = 0.01
PATCH_COLOUR = "#5b4a9c"
OUTLINE = {"fill": False, "edgecolor": "#00000059", "linewidth": 0.5, "zorder": 2}


def view_of(scenes: Sequence[Mapping[str, Any]], path: Any = ()) -> Extent:
    """Return the part of the ground that a picture of these scenes shows.

    It contains their starts, goals and terrain, and the ``path`` of a car. If a scene has no goal, it contains the whole
    course.
    """
    # All points that the view must show.
    points_m: list[tuple[float, float]] = []
    for scene in scenes:
        start, goal, course = scene["start"], scene["goal"], scene["course"]
        points_m.append((start["x_m"], start["y_m"]))
        if goal is not None:
            points_m.append((goal["x_m"], goal["y_m"]))
        else:
            points_m += [(course["x_min_m"], course["y_min_m"]), (course["x_max_m"], course["y_max_m"])]
        for piece in scene["terrain"]:
            # The view does not extend to the ends of a long wall across the course.
            shown_m = min(_visible_radius_m(piece), MAX_SHOWN_M)
            points_m.append((piece["x_m"] - shown_m, piece["y_m"] - shown_m))
            points_m.append((piece["x_m"] + shown_m, piece["y_m"] + shown_m))
    # A row of the path is time, x, y and more.
    points_m += [(float(row[1]), float(row[2])) for row in path]
    low_x_m, low_y_m = numpy.min(points_m, axis=0).tolist()
    high_x_m, high_y_m = numpy.max(points_m, axis=0).tolist()
    # The view is cut at the limits of the largest course.
    return Extent(
        x_min_m=max(low_x_m - VIEW_MARGIN_M, min(scene["course"]["x_min_m"] for scene in scenes)),
        x_max_m=min(high_x_m + VIEW_MARGIN_M, max(scene["course"]["x_max_m"] for scene in scenes)),
        y_min_m=max(low_y_m - VIEW_MARGIN_M, min(scene["course"]["y_min_m"] for scene in scenes)),
        y_max_m=min(high_y_m + VIEW_MARGIN_M, max(scene["course"]["y_max_m"] for scene in scenes)),
    )


def draw_top_view(axes: Axes, scene: Mapping[str, Any], ground: HeightMap, scale: ScalarMappable, path: Any = ()) -> None:
    """Draw ``scene`` (docs/carsim.md) over the extent of ``ground``; ``path`` rows begin with time, x, y."""
    axes.set_aspect("equal")
    axes.grid(False)
    extent = ground.extent
    corners = (extent.x_min_m, extent.x_max_m, extent.y_min_m, extent.y_max_m)
    axes.imshow(shaded(ground, scale), origin="lower", extent=corners, interpolation="antialiased", zorder=0)
    for piece in scene["terrain"]:
        _draw_outline(axes, piece)
    if scene["terrain"] and all(_contoured(piece) for piece in scene["terrain"]):
        _draw_contours(axes, ground)
    _draw_course(axes, scene["course"])
    if scene["goal"] is not None:
        _draw_goal(axes, scene)
    if len(path):
        rows = numpy.asarray(path, dtype=float)
        axes.plot(rows[:, 1], rows[:, 2], color=ACCENT, linewidth=1.6, zorder=5, solid_capstyle="round", label="path")
    start = scene["start"]
    _draw_arrow(axes, start["x_m"], start["y_m"], start["heading_rad"], ARROW_LENGTH_M, INK)
    axes.plot([start["x_m"]], [start["y_m"]], "o", color=INK, markersize=4, zorder=6, label="start")
    axes.set_xlim(extent.x_min_m, extent.x_max_m)
    axes.set_ylim(extent.y_min_m, extent.y_max_m)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _draw_outline(axes: Axes, piece: Mapping[str, Any]) -> None:
    """Draw the edges of a block, the rim of a hole or the hatched area of a patch; smooth ground has no outline."""
    place = (piece["x_m"], piece["y_m"])
    kind = kind_of(piece)
    if kind.form == "patch":
        hatching = {"fill": False, "edgecolor": PATCH_COLOUR, "linewidth": 0.8, "hatch": "////", "zorder": 1.5}
        axes.add_patch(_rectangle(axes, piece, {**hatching, "alpha": 0.5}))
        axes.annotate(
            f"friction {piece['friction']:g}",
            place,
            ha="center",
            va="center",
            fontsize=7,
            color=PATCH_COLOUR,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "#ffffffcc", "edgecolor": "none"},
            clip_on=True,
            zorder=3,
        )
    elif kind.form == "block":
        axes.add_patch(_rectangle(axes, piece, OUTLINE))
    elif kind.shape == "disc":
        axes.add_patch(Circle(place, piece["radius_m"], **OUTLINE))


def _contoured(piece: Mapping[str, Any]) -> bool:
    """Whether contours show a piece; contours of edges and of rough ground would hide it."""
    return kind_of(piece).form != "block" and not kind_of(piece).is_floor


def _draw_contours(axes: Axes, ground: HeightMap) -> None:
    """Draw height contours of the ground, except at height 0."""
    low, high = float(numpy.min(ground.z_m)), float(numpy.max(ground.z_m))
    steps = numpy.arange(numpy.ceil(low / CONTOUR_STEP_M), high / CONTOUR_STEP_M + 1)
    levels = steps[steps != 0] * CONTOUR_STEP_M
    rows, columns = ground.z_m.shape
    x = ground.extent.x_min_m + ground.cell_m * (numpy.arange(columns) + 0.5)
    y = ground.extent.y_min_m + ground.cell_m * (numpy.arange(rows) + 0.5)
    axes.contour(x, y, ground.z_m, levels, colors="#00000059", linewidths=0.5, linestyles="solid", zorder=2)


def _rectangle(axes: Axes, piece: Mapping[str, Any], look: Mapping[str, Any]) -> Rectangle:
    """Return the outline of a rectangular piece, turned by its heading; ``look`` are arguments of matplotlib."""
    length_m, width_m = piece["length_m"], piece["width_m"]
    to_place = Affine2D().rotate(piece["heading_rad"]).translate(piece["x_m"], piece["y_m"])
    corner = (-length_m / 2, -width_m / 2)
    return Rectangle(corner, length_m, width_m, transform=to_place + axes.transData, **look)


def _draw_course(axes: Axes, course: Mapping[str, float]) -> None:
    """Draw the limits of the course."""
    corner = (course["x_min_m"], course["y_min_m"])
    length_m, width_m = course["x_max_m"] - course["x_min_m"], course["y_max_m"] - course["y_min_m"]
    axes.add_patch(Rectangle(corner, length_m, width_m, fill=False, edgecolor="#777777", linewidth=1.0, zorder=3))


def _visible_radius_m(piece: Mapping[str, Any]) -> float:
    """Return how far from its middle a piece of terrain must be visible in the picture (m)."""
    along, across = reach_m(piece)
    shape = kind_of(piece).shape
    if shape == "rectangle":
        return math.hypot(along, across)
    # A bell-shaped hill is nearly flat in the outer half of its extent.
    return max(along, across) / 2 if shape == "bell" else along


def _draw_goal(axes: Axes, scene: Mapping[str, Any]) -> None:
    """Draw the goal: a disc, or a line with the direction in which it is crossed."""
    goal = scene["goal"]
    x, y = goal["x_m"], goal["y_m"]
    if goal["kind"] == "disc":
        disc = Circle((x, y), goal["radius_m"], fill=False, edgecolor=FAILURE, linestyle="--", zorder=4, label="goal")
        axes.add_patch(disc)
        axes.plot([x], [y], "+", color=FAILURE, zorder=4)
        return
    ends = _line_in_course(x, y, goal["heading_rad"], scene["course"])
    axes.plot(ends[:, 0], ends[:, 1], "--", color=FAILURE, linewidth=1.4, zorder=4, label="goal line")
    _draw_arrow(axes, x, y, goal["heading_rad"], ARROW_LENGTH_M / 2, FAILURE)


def _line_in_course(x: float, y: float, heading_rad: float, course: Mapping[str, float]) -> Any:
    """Return the ends of a goal's line within the course, as an array of two points (x, y).

    The line goes through the point (x, y), at a right angle to the heading.
    """
    direction = numpy.array([-numpy.sin(heading_rad), numpy.cos(heading_rad)])
    # Where the line enters and leaves the course's limits on each axis, as distances along the line.
    entries_m, exits_m = [], []
    for axis, position, slope in (("x", x, direction[0]), ("y", y, direction[1])):
        # A line that is parallel to an edge does not cross it.
        if abs(slope) > 1e-12:
            to_min_m = (course[f"{axis}_min_m"] - position) / slope
            to_max_m = (course[f"{axis}_max_m"] - position) / slope
            entries_m.append(min(to_min_m, to_max_m))
            exits_m.append(max(to_min_m, to_max_m))
    distances_m = numpy.array([[max(entries_m)], [min(exits_m)]])
    return numpy.array([[x, y]]) + distances_m * direction


def _draw_arrow(axes: Axes, x: float, y: float, heading_rad: float, length_m: float, colour: str) -> None:
    """Draw an arrow from a point (m) in the direction of a heading."""
    tip = (x + length_m * numpy.cos(heading_rad), y + length_m * numpy.sin(heading_rad))
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tip, xytext=(x, y), arrowprops=arrow, zorder=6)
