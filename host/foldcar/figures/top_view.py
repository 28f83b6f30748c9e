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
CONTOUR_STEP_M = 0.01
PATCH_COLOUR = "#5b4a9c"
OUTLINE = {"fill": False, "edgecolor": "#00000059", "linewidth": 0.5, "zorder": 2}


def view_of(scenes: Sequence[Mapping[str, Any]], path: Any = ()) -> Extent:
    """Return the extent that shows starts, goals, terrain and the path of several scenes, and courses without a goal."""
    x: list[float] = []
    y: list[float] = []
    for scene in scenes:
        places = [(scene["start"]["x_m"], scene["start"]["y_m"])]
        if scene["goal"] is not None:
            places.append((scene["goal"]["x_m"], scene["goal"]["y_m"]))
        else:
            course = scene["course"]
            places += [(course["x_min_m"], course["y_min_m"]), (course["x_max_m"], course["y_max_m"])]
        x += [place_x for place_x, _ in places]
        y += [place_y for _, place_y in places]
        for piece in scene["terrain"]:
            # The view does not extend to the ends of a long wall across the course.
            shown_m = min(_visible_radius_m(piece), 0.4)
            x += [piece["x_m"] - shown_m, piece["x_m"] + shown_m]
            y += [piece["y_m"] - shown_m, piece["y_m"] + shown_m]
    if len(path):
        rows = numpy.asarray(path, dtype=float)
        x += list(rows[:, 1])
        y += list(rows[:, 2])
    # The view is cut at the limits of the largest course.
    sides = {key: [scene["course"][key] for scene in scenes] for key in scenes[0]["course"]}
    return Extent(
        max(min(x) - VIEW_MARGIN_M, min(sides["x_min_m"])),
        min(max(x) + VIEW_MARGIN_M, max(sides["x_max_m"])),
        max(min(y) - VIEW_MARGIN_M, min(sides["y_min_m"])),
        min(max(y) + VIEW_MARGIN_M, max(sides["y_max_m"])),
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
    length, width = piece["length_m"], piece["width_m"]
    place = Affine2D().rotate(piece["heading_rad"]).translate(piece["x_m"], piece["y_m"])
    return Rectangle((-length / 2, -width / 2), length, width, transform=place + axes.transData, **look)


def _draw_course(axes: Axes, course: Mapping[str, float]) -> None:
    corner = (course["x_min_m"], course["y_min_m"])
    size = (course["x_max_m"] - corner[0], course["y_max_m"] - corner[1])
    axes.add_patch(Rectangle(corner, *size, fill=False, edgecolor="#777777", linewidth=1.0, zorder=3))


def _visible_radius_m(piece: Mapping[str, Any]) -> float:
    """Return the distance (m) from the middle of a piece to which the picture should show it."""
    along, across = reach_m(piece)
    shape = kind_of(piece).shape
    if shape == "rectangle":
        return math.hypot(along, across)
    # A hill's visible rise begins at half of its reach.
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
    """Return the ends, (2: end, 2: x and y), of the line through the point across the heading, clipped to the course."""
    direction = numpy.array([-numpy.sin(heading_rad), numpy.cos(heading_rad)])
    # For each axis, the interval of distances along the line within the course's limits.
    intervals = []
    for position, slope, axis in ((x, direction[0], "x"), (y, direction[1], "y")):
        if abs(slope) > 1e-12:
            limits = (course[f"{axis}_min_m"], course[f"{axis}_max_m"])
            intervals.append(sorted((limit - position) / slope for limit in limits))
    low, high = max(start for start, _ in intervals), min(end for _, end in intervals)
    return numpy.array([[x, y]]) + numpy.array([[low], [high]]) * direction


def _draw_arrow(axes: Axes, x: float, y: float, heading_rad: float, length_m: float, colour: str) -> None:
    tip = (x + length_m * numpy.cos(heading_rad), y + length_m * numpy.sin(heading_rad))
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tip, xytext=(x, y), arrowprops=arrow, zorder=6)
