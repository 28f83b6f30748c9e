"""Draws several scenes from above, side by side with one colour scale."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from foldcar.errors import FoldcarError
from foldcar.figures.ground import height_map
from foldcar.figures.height_colours import height_scale
from foldcar.figures.output import check_format, save_figure
from foldcar.figures.style import RC
from foldcar.figures.top_view import draw_top_view, view_of
from foldcar.simulation.heights import Heights

MOST_SCENES = 9
PANEL_WIDTH_IN = 3.4
# Cells along the longer side of a panel, which has half the usual width of a picture.
CELLS = 320


def draw_scenes(scenes: Sequence[Mapping[str, Any]], file: Path, heights: Heights, title: str = "") -> None:
    """Draw up to nine ``scenes`` (docs/carsim.md, with their ids) into ``file``. Raises FoldcarError."""
    check_format(file)
    shown = scenes[:MOST_SCENES]
    if not shown:
        raise FoldcarError(f"{file}: no scene to draw")
    extent = view_of(shown)
    length, width = extent.size_m
    # Long courses are arranged in one column.
    columns = 1 if length > 2.5 * width else math.ceil(math.sqrt(len(shown)))
    rows = math.ceil(len(shown) / columns)
    panel = PANEL_WIDTH_IN * (2.0 if columns == 1 else 1.0)
    size = (panel * columns + 1.0, (panel * min(width / length, 2.0) + 0.3) * rows + 0.7)
    maps = [height_map(heights, scene, extent, CELLS * (2 if columns == 1 else 1)) for scene in shown]
    scale = height_scale(maps)
    with matplotlib.rc_context(RC):
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for place, axes in enumerate(panels.flat):
            if place >= len(shown):
                axes.set_axis_off()
                continue
            draw_top_view(axes, shown[place], maps[place], scale)
            axes.label_outer()
            axes.set_title(f"scene {shown[place]['id']}", fontsize=9)
        if any(scene["terrain"] for scene in shown):
            figure.colorbar(scale, ax=panels, label="height (mm)", shrink=0.7, aspect=30)
        handles, labels = panels.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        if title:
            figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        save_figure(figure, file)
