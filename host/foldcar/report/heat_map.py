"""Draws success over two parameters: a cell for each design, contours of a smooth model at the thresholds."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import matplotlib
import numpy
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from foldcar.figures.style import INK
from foldcar.report.axis import interval_text, parameter_label, value_text
from foldcar.report.design_table import Count, assigned, every
from foldcar.report.figure_size import NARROW_IN, NARROW_TITLE, WIDE_IN, legend_columns
from foldcar.report.map_plan import MapPlan, Panel
from foldcar.report.tips import set_tip

COLOURS = "cividis"
# Of the highest threshold first.
LINES: Any = ("-", "--", "-.", ":")
# A white line is seen on dark cells, its black border on bright ones.
OUTLINE: Any = [withStroke(linewidth=3.2, foreground="black")]
NOT_RUN = "#e6e6e6"
HATCH = "#3a3a3a"
PANEL_HEIGHT_IN = {1: 4.3, 2: 3.4}
# Letters of a line above panels side by side.
WIDE_TITLE = 68
MOST_TICKS = 9


def draw_map(plan: MapPlan, thresholds: Sequence[float], narrow: bool = False) -> Figure:
    """A panel for each combination of the other parameters' values; shares in per cent, thresholds 0 to 1."""
    count = len(plan.panels)
    columns = 1 if narrow or count == 1 else 2
    rows = -(-count // columns)
    width = NARROW_IN if narrow else WIDE_IN
    each = PANEL_HEIGHT_IN[columns] if not narrow else 3.0
    figure = Figure(figsize=(width, rows * each + 0.5), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    norm = Normalize(0, 100)
    for panel, axes in zip(plan.panels, grid.flat, strict=False):
        _draw_panel(axes, panel, plan.y, thresholds, norm, (width - (0.8 if narrow else 1.6)) / columns, each - 0.9)
        axes.set_title(fill(panel.fixed_text or _title(plan), NARROW_TITLE if narrow else WIDE_TITLE // columns))
    for axes in list(grid.flat)[count:]:
        axes.set_visible(False)
    # The lowest of each column: the last row may be incomplete.
    for axes in list(grid.flat)[:count][-columns:]:
        axes.set_xlabel(parameter_label(plan.x))
        axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel(parameter_label(plan.y))
    if count > 1:
        figure.suptitle(_title(plan), x=0.01, ha="left", fontweight="bold", fontsize=10)
    scale = ScalarMappable(norm, COLOURS)
    bar: dict[str, Any] = {"location": "bottom", "shrink": 0.9, "aspect": 30} if narrow else {"shrink": 0.9, "aspect": 30}
    figure.colorbar(scale, ax=grid, label="passed (%)", **bar)
    figure.legend(handles=_legend(plan, thresholds), loc="outside lower center", ncols=legend_columns(narrow, 4))
    return figure


def _title(plan: MapPlan) -> str:
    names = [parameter_label(name).partition(" (")[0] for name in (plan.x, plan.y)]
    return f"Success over {names[0]} and {names[1]}"


def edges(values: Sequence[float]) -> NDArray[Any]:
    """The borders (n + 1,) of the cells of n ascending values: half-way between neighbours."""
    if len(values) == 1:
        return numpy.array([values[0] - 0.5, values[0] + 0.5])
    middles = (numpy.array(values[1:]) + numpy.array(values[:-1])) / 2
    return numpy.concatenate([[2 * values[0] - middles[0]], middles, [2 * values[-1] - middles[-1]]])


def is_open(count: Count, thresholds: Sequence[float]) -> bool:
    """Whether the design's own interval leaves open on which side of the highest threshold it is."""
    low, high = count.interval
    return low < max(thresholds) < high


def _draw_panel(
    axes: Axes,
    panel: Panel,
    y_name: str,
    thresholds: Sequence[float],
    norm: Normalize,
    width_in: float,
    height_in: float,
) -> None:
    xs, ys = panel.table.values(panel.x), panel.table.values(y_name)
    across, up = edges(xs), edges(ys)
    size = (
        width_in * float(numpy.diff(across).min()) / float(across[-1] - across[0]),
        height_in * float(numpy.diff(up).min()) / float(up[-1] - up[0]),
    )
    colours = matplotlib.colormaps[COLOURS]
    at_x = panel.table.names.index(panel.x)
    axes.set_facecolor(NOT_RUN)
    for values, count in panel.table.cells.items():
        x, y = values[at_x], values[1 - at_x]
        left, low = xs.index(x), ys.index(y)
        colour = colours(norm(100 * count.success))
        # Of single runs every side is open.
        open_side = not panel.table.single and is_open(count, thresholds)
        cell = Rectangle(
            (float(across[left]), float(up[low])),
            float(across[left + 1] - across[left]),
            float(up[low + 1] - up[low]),
            facecolor=colour,
            edgecolor=HATCH if open_side else "white",
            linewidth=0.0 if open_side else 0.4,
            hatch="///" if open_side else None,
        )
        set_tip(
            cell,
            f"{assigned(panel.x, x)}, {assigned(y_name, y)}: "
            f"{count.passed} of {count.runs} runs passed, 95 % interval {interval_text(count.interval)} %",
        )
        axes.add_patch(cell)
        if size[0] >= 0.26 and size[1] >= 0.15:
            dark = numpy.dot(colour[:3], (0.299, 0.587, 0.114)) < 0.5
            text = axes.text(x, y, f"{100 * count.success:.0f}", ha="center", va="center", fontsize=8)
            # Bordered in the cell's colour, where lines pass.
            border = [withStroke(linewidth=2.5, foreground=colour)]
            text.set(color="white" if dark else INK, zorder=4, path_effects=border)
    _draw_contours(axes, panel, y_name, thresholds)
    axes.set_xlim(across[0], across[-1])
    axes.set_ylim(up[0], up[-1])
    axes.grid(False)
    most = max(2, min(MOST_TICKS, int(width_in / 0.42)))
    for set_ticks, shown in ((axes.set_xticks, every(xs, most)), (axes.set_yticks, every(ys, MOST_TICKS))):
        set_ticks(shown, [value_text(value) for value in shown])


def _draw_contours(axes: Axes, panel: Panel, y_name: str, thresholds: Sequence[float]) -> None:
    """Lines where the model crosses the thresholds."""
    if panel.surface is None:
        return
    x, y, rate, _, _ = panel.surface
    rate = numpy.ma.masked_array(rate, ~_run(panel, y_name, *numpy.meshgrid(x, y)))
    for threshold, line in zip(sorted(thresholds, reverse=True), LINES, strict=False):
        if rate.min() < threshold < rate.max():
            style: dict[str, Any] = {"colors": "white", "linewidths": 1.6, "linestyles": line, "zorder": 3}
            drawn = axes.contour(x, y, rate, levels=[threshold], **style)
            drawn.set_path_effects(OUTLINE)


def _run(panel: Panel, y_name: str, across: NDArray[Any], up: NDArray[Any]) -> NDArray[Any]:
    """Whether the design nearest to each point was simulated: beyond, the model has nothing to go by."""
    xs, ys = panel.table.values(panel.x), panel.table.values(y_name)
    at_x = panel.table.names.index(panel.x)
    simulated = numpy.zeros((len(ys), len(xs)), dtype=bool)
    for values in panel.table.cells:
        simulated[ys.index(values[1 - at_x]), xs.index(values[at_x])] = True
    columns = numpy.clip(numpy.searchsorted(edges(xs), across) - 1, 0, len(xs) - 1)
    rows = numpy.clip(numpy.searchsorted(edges(ys), up) - 1, 0, len(ys) - 1)
    found: NDArray[Any] = simulated[rows, columns]
    return found


def _legend(plan: MapPlan, thresholds: Sequence[float]) -> list[Any]:
    handles: list[Any] = []
    if any(panel.model is not None for panel in plan.panels):
        look: dict[str, Any] = {"color": "white", "linewidth": 1.6, "path_effects": OUTLINE}
        for threshold, line in zip(sorted(thresholds, reverse=True), LINES, strict=False):
            handles.append(Line2D([], [], linestyle=line, label=f"{100 * threshold:g} % of the smooth model", **look))
    counts = [count for one in plan.panels if not one.table.single for count in one.table.cells.values()]
    if any(is_open(count, thresholds) for count in counts):
        label = f"95 % interval holds {100 * max(thresholds):g} %"
        handles.append(Patch(facecolor="#c5b56b", hatch="///", edgecolor=HATCH, linewidth=0.0, label=label))
    places = [len(one.table.values(plan.x)) * len(one.table.values(plan.y)) for one in plan.panels]
    if any(len(one.table.cells) < count for one, count in zip(plan.panels, places, strict=True)):
        handles.append(Patch(facecolor=NOT_RUN, edgecolor="none", label="no run"))
    return handles

