"""The figures for papers of an experiment in which several parameters vary: effects, importance, a map of two.

All are of the one smooth model of simulation, over the same combinations of the other parameters: no raw average.
"""

from collections.abc import Sequence
from typing import Any

import numpy
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from foldcar.analysis.effects import Effects
from foldcar.analysis.words import label_and_unit
from foldcar.figures.style import ACCENT, INK
from foldcar.report.page_designs import Designs
from foldcar.report.page_effects import over
from foldcar.report.parameter_plots import WIDE_IN, axis_label

COLUMNS = 3
COLOURS, NOT_RUN = "cividis", "#e6e6e6"
MOST_TICKS = 9
# Cells that have room for a number each.
MOST_NUMBERS = 150


def draw_effects(designs: Designs, effects: Effects, places: Sequence[int], thresholds: Sequence[float]) -> Figure:
    """Success over each parameter with its band, and curves of single combinations of the others."""
    names = [list(designs.values)[place] for place in places]
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(WIDE_IN, 2.7 * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True)
    for at, (name, axes) in enumerate(zip(names, grid.flat, strict=False)):
        one = effects.effect(at)
        axes.plot(one.grid, 100 * one.curves.T, color=INK, linewidth=0.5, alpha=0.3)
        axes.fill_between(one.grid, 100 * one.low, 100 * one.high, color=ACCENT, alpha=0.25, linewidth=0)
        axes.plot(one.grid, 100 * one.mean, "o-", color=ACCENT, linewidth=1.6, markersize=3.5)
        for threshold in thresholds:
            axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
        axes.set_xlabel(axis_label(name))
        axes.set_title(f"{one.combinations} combinations", fontsize=8, fontweight="normal")
        axes.set_ylim(0, 103)
    for axes in list(grid.flat)[len(names) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel("passed (%)")
    figure.suptitle(f"Effects on success in {designs.info.simulation}", x=0.01, ha="left", fontweight="bold", fontsize=10)
    return figure


def effects_caption(effects: Effects, number: int) -> str:
    """What the figure of effects shows."""
    said = over(effects.effect(0), number)
    return f"Success over each parameter, with 95 % bands: {said}, for the first. Thin: single combinations."


def draw_importance(designs: Designs, rows: Sequence[dict[str, Any]]) -> Figure:
    """A bar for each parameter: its share of the variance of success over the designs."""
    figure = Figure(figsize=(WIDE_IN, 0.45 * len(rows) + 1.0), layout="constrained")
    axes = figure.subplots()
    names = [label_and_unit(list(designs.values)[row["parameter"]])[0] for row in rows]
    shares, low, high = (numpy.array([100 * row[key] for row in rows]) for key in ("share", "low", "high"))
    axes.barh(
        names, shares, color=ACCENT, xerr=[numpy.maximum(shares - low, 0), numpy.maximum(high - shares, 0)], capsize=3
    )
    axes.invert_yaxis()
    axes.set_xlim(0, 105)
    axes.set_xlabel("share of the variance of success (%), with 95 % intervals")
    axes.set_title("Importance of the parameters")
    axes.grid(axis="y", visible=False)
    return figure


def draw_map(
    designs: Designs, effects: Effects, places: Sequence[int], two: tuple[int, int], thresholds: Sequence[float]
) -> Figure:
    """A cell for each pair of values that was run, and lines where the model crosses the thresholds; ``two`` places."""
    x_at, y_at = (list(places).index(place) for place in two)
    run = numpy.unique(effects.parameters[:, [x_at, y_at]], axis=0)
    xs, ys = (numpy.unique(column) for column in run.T)
    rates, _, _ = effects.standardised((x_at, y_at), run)
    cells = numpy.full((len(ys), len(xs)), numpy.nan)
    cells[numpy.searchsorted(ys, run[:, 1]), numpy.searchsorted(xs, run[:, 0])] = 100 * rates
    figure = Figure(figsize=(WIDE_IN, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.set_facecolor(NOT_RUN)
    drawn = axes.pcolormesh(
        edges(xs), edges(ys), cells, cmap=COLOURS, vmin=0, vmax=100, edgecolors="white", linewidth=0.4
    )
    if cells.size <= MOST_NUMBERS:
        for (row, column), value in numpy.ndenumerate(cells):
            if numpy.isfinite(value):
                colour = "white" if value < 55 else INK
                axes.text(xs[column], ys[row], f"{value:.0f}", ha="center", va="center", fontsize=8, color=colour)
    inside = numpy.ma.masked_invalid(cells)
    levels = [100 * one for one in thresholds if inside.min() < 100 * one < inside.max()]
    if levels and min(cells.shape) > 1:
        axes.contour(xs, ys, inside, levels=levels, colors="white", linewidths=1.6)
    names = [list(designs.values)[place] for place in two]
    axes.set_xlabel(axis_label(names[0]))
    axes.set_ylabel(axis_label(names[1]))
    axes.set_xticks(xs[:: -(-len(xs) // MOST_TICKS)])
    axes.set_yticks(ys[:: -(-len(ys) // MOST_TICKS)])
    axes.grid(False)
    labels = [label_and_unit(name)[0] for name in names]
    axes.set_title(f"Success over {labels[0]} and {labels[1]}")
    figure.colorbar(drawn, ax=axes, label="passed (%)")
    if numpy.isnan(cells).any():
        figure.legend(handles=[Patch(facecolor=NOT_RUN, label="no run")], loc="outside lower center")
    return figure


def edges(values: Any) -> Any:
    """The borders (n + 1,) of the cells of n ascending values: half-way between neighbours."""
    if len(values) == 1:
        return numpy.array([values[0] - 0.5, values[0] + 0.5])
    middles = (values[1:] + values[:-1]) / 2
    return numpy.concatenate([[2 * values[0] - middles[0]], middles, [2 * values[-1] - middles[-1]]])
