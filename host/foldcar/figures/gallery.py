"""Draws an environment: three samples from above, below each the ground profiles along the wheel tracks.

Input: scenes and a function for their heights. Output: a picture.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from foldcar.figures.ground import Extent, height_map
from foldcar.figures.height_colours import height_scale
from foldcar.figures.output import check_format, save_figure
from foldcar.figures.profile import straight_line, strip_heights_m
from foldcar.figures.style import ACCENT, FAILURE, RC
from foldcar.figures.top_view import VIEW_MARGIN_M, draw_top_view, view_of
from foldcar.simulation.heights import Heights

SAMPLES = 3
CELLS = 600
PROFILE_IN = 1.0
# Track and tyre width of the width study's medium car: body 95 mm wide, tyres 12 mm.
TRACK_M = 0.111
TYRE_M = 0.012
DPI = 95
COLOURS = 256


def draw_gallery(scenes: Sequence[Mapping[str, Any]], file: Path, heights: Heights, title: str) -> None:
    """Draw the first distinct ``scenes`` (docs/carsim.md with ids) into ``file``. Raises FoldcarError."""
    check_format(file)
    scenes = _different(scenes)
    extent = view_of(scenes)
    maps = [height_map(heights, scene, extent, CELLS) for scene in scenes]
    scale = height_scale(maps)
    length, width = extent.size_m
    stacked = length > 2.5 * width
    with matplotlib.rc_context(RC):
        figure, views, profiles = (_stacked if stacked else _side_by_side)(len(scenes), width / length)
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        for scene, ground, view, profile in zip(scenes, maps, views, profiles, strict=True):
            draw_top_view(view, scene, ground, scale)
            view.set_title(f"scene {scene['id']}", fontsize=9)
            _draw_profile(profile, scene, heights)
        limits = [profile.get_ylim() for profile in profiles]
        for profile in profiles:
            profile.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        if stacked:
            for axes in (*views, *profiles[:-1]):
                axes.set_xlabel("")
            figure.colorbar(scale, ax=[*views, *profiles], label="height (mm)", shrink=0.5, aspect=25)
        else:
            for axes in (*views[1:], *profiles[1:]):
                axes.set_ylabel("")
            figure.colorbar(scale, ax=views, label="height (mm)", shrink=0.9, aspect=25)
        places, names = views[0].get_legend_handles_labels()
        tracks, track_names = profiles[0].get_legend_handles_labels()
        figure.legend(places + tracks, names + track_names, loc="outside lower center", ncols=4)
        save_figure(figure, file, DPI, COLOURS)


def _different(scenes: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The scenes without those that equal an earlier one except for the id."""
    kept: list[Mapping[str, Any]] = []
    for scene in scenes:
        if not any({**scene, "id": ""} == {**other, "id": ""} for other in kept):
            kept.append(scene)
    return kept


def _side_by_side(count: int, aspect: float) -> tuple[Figure, list[Axes], list[Axes]]:
    view_width_in = 2.9 if count > 1 else 4.2
    view_in = view_width_in * aspect + 0.4
    size = (view_width_in * count + 1.3, view_in + PROFILE_IN + 1.1)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(2, count, squeeze=False, height_ratios=(view_in, PROFILE_IN))
    return figure, list(axes[0]), list(axes[1])


def _stacked(count: int, aspect: float) -> tuple[Figure, list[Axes], list[Axes]]:
    view_width_in = 8.5
    view_in = view_width_in * aspect + 0.3
    size = (view_width_in + 1.5, (view_in + PROFILE_IN) * count + 1.0)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(2 * count, 1, height_ratios=(view_in, PROFILE_IN) * count)
    return figure, list(axes[0::2]), list(axes[1::2])


def _draw_profile(axes: Axes, scene: Mapping[str, Any], heights: Heights) -> None:
    """The ground under both wheel tracks from start straight to goal; heights (mm) are exaggerated."""
    aim = {**scene["start"], "heading_rad": _aim_rad(scene)}
    way_m = _way_m(scene, aim["heading_rad"])
    line = straight_line(aim, -VIEW_MARGIN_M, way_m + VIEW_MARGIN_M)
    for name, side, colour, look in (("left", 0.5, ACCENT, "-"), ("right", -0.5, FAILURE, "--")):
        strip_mm = strip_heights_m(heights, scene, line, side * TRACK_M, TYRE_M) * 1e3
        axes.plot(
            line.distance_m,
            strip_mm,
            look,
            color=colour,
            linewidth=1.0,
            label=f"ground under the {name} wheels",
        )
    axes.margins(x=0)
    axes.set_xlabel("distance from the start (m)")
    axes.set_ylabel("height (mm)")


def _aim_rad(scene: Mapping[str, Any]) -> float:
    """The heading from start to goal (its line's nearest point), or straight ahead without a goal."""
    start, goal = scene["start"], scene["goal"]
    if goal is None:
        return float(start["heading_rad"])
    if goal["kind"] == "line":
        return float(goal["heading_rad"])
    return math.atan2(goal["y_m"] - start["y_m"], goal["x_m"] - start["x_m"])


def _way_m(scene: Mapping[str, Any], heading_rad: float) -> float:
    """The distance from the start to the goal in that direction (m); without a goal, to the edge of the course."""
    start, goal = scene["start"], scene["goal"]
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    if goal is not None:
        return float((goal["x_m"] - start["x_m"]) * cos + (goal["y_m"] - start["y_m"]) * sin)
    course = scene["course"]
    course_extent = Extent(course["x_min_m"], course["x_max_m"], course["y_min_m"], course["y_max_m"])
    ways = [
        ((high if slope > 0 else low) - place) / slope
        for place, slope, low, high in (
            (start["x_m"], cos, course_extent.x_min_m, course_extent.x_max_m),
            (start["y_m"], sin, course_extent.y_min_m, course_extent.y_max_m),
        )
        if abs(slope) > 1e-9
    ]
    return float(min(ways))
