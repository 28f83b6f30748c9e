"""Draws scenes from above with one colour scale, below each the ground along its wheel tracks."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from foldcar.figures.ground import Extent, height_map, height_scale
from foldcar.figures.output import check_format, save_figure
from foldcar.figures.profile import straight_line, strip_heights_m
from foldcar.figures.style import ACCENT, FAILURE, drawing_style
from foldcar.figures.top_view import VIEW_MARGIN_M, draw_top_view, view_of
from foldcar.simulation.heights import Heights

MAX_SCENES = 9
# Cells along the longer side of a panel.
FINE_CELLS = 600
# Panels in a row, the height of a profile, pixels per inch and colours of a PNG.
SAMPLES, PROFILE_IN = 3, 1.0
DPI, COLOURS = 95, 256
# Track and tyre width of the width study's medium car: body 95 mm wide, tyres 12 mm.
TRACK_M, TYRE_M = 0.111, 0.012


def is_long(extent: Extent) -> bool:
    """Whether pictures of that extent are stacked below each other."""
    length, width = extent.size_m
    return length > 2.5 * width


def draw_environment(scenes: Sequence[Mapping[str, Any]], file: Path, heights: Heights, title: str) -> None:
    """Draw the distinct ones of ``scenes`` (docs/carsim.md with ids), up to nine, below each its ground profiles.

    Raises FoldcarError.
    """
    check_format(file)
    distinct: list[Mapping[str, Any]] = []
    for scene in scenes[:MAX_SCENES]:
        if not any({**scene, "id": ""} == {**other, "id": ""} for other in distinct):
            distinct.append(scene)
    count, extent = len(distinct), view_of(distinct)
    maps = [height_map(heights, scene, extent, FINE_CELLS) for scene in distinct]
    scale = height_scale(maps)
    length, width = extent.size_m
    stacked = is_long(extent)
    view_width_in = 8.5 if stacked else 2.9 if count > 1 else 4.2
    view_in = view_width_in * width / length + (0.3 if stacked else 0.4)
    with drawing_style():
        columns = 1 if stacked else min(count, SAMPLES)
        rows = math.ceil(count / columns)
        beside_in, above_in = (1.5, 1.0) if stacked else (1.3, 1.1)
        size = (view_width_in * columns + beside_in, (view_in + PROFILE_IN) * rows + above_in)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(2 * rows, columns, squeeze=False, height_ratios=(view_in, PROFILE_IN) * rows)
        views, profiles = list(panels[::2].flat), list(panels[1::2].flat)
        for empty in (*views[count:], *profiles[count:]):
            empty.set_axis_off()
        views, profiles = views[:count], profiles[:count]
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        for scene, ground, view, profile in zip(distinct, maps, views, profiles, strict=True):
            draw_top_view(view, scene, ground, scale)
            view.set_title(f"scene {scene['id']}", fontsize=9)
            _draw_profile(profile, scene, heights)
        limits = [profile.get_ylim() for profile in profiles]
        for profile in profiles:
            profile.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
        for axes in (*views, *profiles[:-1]) if stacked else ():
            axes.set_xlabel("")
        for place in () if stacked else range(count):
            if place % columns:
                views[place].set_ylabel("")
                profiles[place].set_ylabel("")
        beside, shrink = ([*views, *profiles], 0.5) if rows > 1 else (views, 0.9)
        figure.colorbar(scale, ax=beside, label="height (mm)", shrink=shrink, aspect=25)
        places, names = views[0].get_legend_handles_labels()
        tracks, track_names = profiles[0].get_legend_handles_labels()
        figure.legend(places + tracks, names + track_names, loc="outside lower center", ncols=4)
        save_figure(figure, [file], DPI, COLOURS)


def _draw_profile(axes: Axes, scene: Mapping[str, Any], heights: Heights) -> None:
    """Draw the ground under both wheel tracks from start straight to goal; heights (mm) are exaggerated."""
    heading_rad, way_m = _straight_way(scene)
    line = straight_line({**scene["start"], "heading_rad": heading_rad}, -VIEW_MARGIN_M, way_m + VIEW_MARGIN_M)
    for name, side, colour, line_style in (("left", 0.5, ACCENT, "-"), ("right", -0.5, FAILURE, "--")):
        strip_mm = strip_heights_m(heights, scene, line, side * TRACK_M, TYRE_M) * 1e3
        label = f"ground under the {name} wheels"
        axes.plot(line.distance_m, strip_mm, line_style, color=colour, linewidth=1.0, label=label)
    axes.margins(x=0)
    axes.set_xlabel("distance from the start (m)")
    axes.set_ylabel("height (mm)")


def _straight_way(scene: Mapping[str, Any]) -> tuple[float, float]:
    """Return heading (rad) and length (m) of the straight way from the start to the goal.

    Without a goal, the way goes straight on from the start to the edge of the course.
    """
    start, goal, course = scene["start"], scene["goal"], scene["course"]
    if goal is not None:
        x_m, y_m = goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]
        # If the goal is a line, the way meets it at a right angle: it has the heading in which the line is crossed.
        heading_rad = goal["heading_rad"] if goal["kind"] == "line" else math.atan2(y_m, x_m)
        length_m = x_m * math.cos(heading_rad) + y_m * math.sin(heading_rad)
        return heading_rad, length_m
    heading_rad = start["heading_rad"]
    distances_m = []
    for axis, slope in (("x", math.cos(heading_rad)), ("y", math.sin(heading_rad))):
        # A way parallel to an edge does not reach it.
        if abs(slope) > 1e-9:
            edge_m = course[f"{axis}_max_m"] if slope > 0 else course[f"{axis}_min_m"]
            distances_m.append((edge_m - start[f"{axis}_m"]) / slope)
    return heading_rad, min(distances_m)
