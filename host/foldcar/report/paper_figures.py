"""The figures for papers that stand beside the page: which there are, and how they are drawn. Shares are in per cent.

Input: what the page's data is made of. Output: drawings in the order in which the page lists them. Where several
parameters vary, all are of the one smooth model of simulation, over the same combinations of the others: no raw average.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import matplotlib
import numpy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from foldcar.figures.style import ACCENT, FAILURE, INK, OUTCOME_COLOURS, OUTCOME_LABELS
from foldcar.outputs import file_name_part
from foldcar.report.page_designs import DesignColumns
from foldcar.report.page_effects import importance_rows, over
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.effects import Effects
from foldcar.statistics.words import label_and_unit

WIDE_IN, HEIGHT_IN = 7.2, 3.7
GREEN, BLUE, NAVY, REGION, NOT_RUN = "#62b85f", "#3f7fd0", "#14265c", "#dff1ea", "#e6e6e6"
# For as many thresholds; for more, evenly from a map of colours.
PUBLISHED = {1: (NAVY, GREEN), 2: (NAVY, BLUE, GREEN)}
# More values have no tick each.
MAX_TICKS = 12
# Figures of effects in a row, and cells of a map that have room for a number each.
COLUMNS, MAX_NUMBERS = 3, 150


@dataclass(frozen=True)
class Drawing:
    """A figure: the name of its files without suffix, its caption, and what makes it."""

    name: str
    caption: str
    draw: Callable[[], Figure]


def drawings(
    designs: DesignColumns, effects: Effects | None, places: Sequence[int], thresholds: Sequence[float]
) -> Iterator[Drawing]:
    """The drawings of an experiment, none of a single design; ``effects`` are of the parameters at ``places``."""
    start = "experiment_" + file_name_part(designs.evidence.info.id)
    judged, run = designs.evidence.info.success_defined, bool(designs.evidence.outcome_counts.any())
    if len(designs.evidence.values) == 1 and (run or designs.evidence.trial_counts.any()):
        (name,) = designs.evidence.values
        label = label_and_unit(name)[0]
        if judged:
            said = f"Success by {label}: what simulation and trials say, with 95 % bands"
            yield Drawing(f"{start}_feasibility_by_{name}", said, partial(draw_feasibility, designs, thresholds))
        if judged and run:
            said = f"Mean success by {label} over all environments, with {designs.interval_name} 95 % intervals"
            yield Drawing(f"{start}_success_by_{name}", said, partial(draw_success, designs, thresholds))
        if run:
            yield Drawing(f"{start}_outcomes_by_{name}", f"Outcomes by {label}", partial(draw_outcomes, designs))
    if len(places) > 1 and effects is not None:
        said = "Success over each parameter, with 95 % bands of the differences between its values"
        caption = f"{said}: {over(effects.effect(0), len(places))}, for the first. Thin: single combinations."
        yield Drawing(f"{start}_effects", caption, partial(draw_effects, designs, effects, places, thresholds))
        two = [row["parameter"] for row in importance_rows(effects, places)][:2]
        first, second = (list(designs.evidence.values)[place] for place in two)
        said = f"Success over {label_and_unit(first)[0]} and {label_and_unit(second)[0]} by the smooth model"
        yield Drawing(
            f"{start}_map_by_{first}_and_{second}",
            f"{said}, a mean over the same combinations of the others",
            partial(draw_map, designs, effects, places, two, thresholds),
        )


def axis_label(parameter: str) -> str:
    """``wheel radius (mm)`` of wheel_radius_mm."""
    label, unit = label_and_unit(parameter)
    return f"{label} ({unit})" if unit else label


def class_colours(thresholds: Sequence[float]) -> Sequence[Any]:
    """A colour for each class between the thresholds, from the lowest class to the highest."""
    number = len(thresholds)
    if number in PUBLISHED:
        return PUBLISHED[number]
    return [matplotlib.colormaps["viridis"](0.1 + 0.8 * place / number) for place in range(number + 1)]


def success_colour(success: float, thresholds: Sequence[float]) -> Any:
    """Of the thresholds 0.5 and 0.75: green above 75 %, blue from 50 to 75 %, navy below 50 %."""
    reached = sum(success >= threshold for threshold in thresholds[:-1])
    return class_colours(thresholds)[reached + (success > thresholds[-1])]


class Axis:
    """The values of the one parameter, ascending ``ticks`` with ``step`` between them; ``place`` by a design's index."""

    def __init__(self, designs: DesignColumns) -> None:
        ((self.name, self.ticks),) = designs.evidence.values.items()
        self.place = {at: float(design.design[self.name]) for at, design in enumerate(designs.evidence.family)}
        self.step = float(numpy.diff(self.ticks).min()) if len(self.ticks) > 1 else 1.0

    def finish(self, axes: Axes) -> None:
        """Label the axis."""
        axes.set_xlabel(axis_label(self.name))
        if len(self.ticks) <= MAX_TICKS:
            axes.set_xticks(self.ticks, [f"{tick:g}" for tick in self.ticks])
        axes.set_xlim(self.ticks[0] - 0.65 * self.step, self.ticks[-1] + 0.65 * self.step)
        axes.grid(axis="x", visible=False)


def draw_feasibility(designs: DesignColumns, thresholds: Sequence[float]) -> Figure:
    """Success of this simulator and of built cars, each with its 95 % band; tinted where a built car's rate reaches."""
    axis, figure = Axis(designs), Figure(figsize=(WIDE_IN, 4.0), layout="constrained")
    axes = figure.subplots()
    simulation, built = (
        numpy.array(sorted((axis.place[at], *band) for at, band in enumerate(bands) if band), dtype=float)
        .reshape(-1, 4)
        .T
        for bands in (designs.simulation, designs.built)
    )
    for place in built[0][built[1] >= thresholds[-1]]:
        axes.axvspan(place - axis.step / 2, place + axis.step / 2, color=REGION, linewidth=0, zorder=0)
    axes.fill_between(built[0], *(100 * built[2:]), color=ACCENT, alpha=0.22, linewidth=0, label="built cars, 95 % band")
    axes.plot(built[0], 100 * built[1], "o", color=ACCENT, markersize=4.5, label="built cars, median")
    axes.fill_between(simulation[0], *(100 * simulation[2:]), color=INK, alpha=0.25, linewidth=0)
    label = f"{designs.evidence.info.simulation}, 95 % band"
    axes.plot(simulation[0], 100 * simulation[1], "-", color=INK, linewidth=1.2, label=label)
    _draw_trials(axes, axis, designs, 0.0, -0.12)
    _finish_success(axes, axis, thresholds, "Feasible region")
    tint = Patch(color=REGION, label=f"median of built cars reaches {100 * thresholds[-1]:g} %")
    figure.legend(handles=[*axes.get_legend_handles_labels()[0], tint], loc="outside lower center", ncols=3)
    return figure


def draw_success(designs: DesignColumns, thresholds: Sequence[float]) -> Figure:
    """Bars for the runs of simulation in the colours of their classes; diamonds for trials."""
    axis, figure = Axis(designs), Figure(figsize=(WIDE_IN, HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    # A white outline keeps the dark error bars visible on navy.
    outline = [withStroke(linewidth=2.2, foreground="white")]
    error_bar = {"elinewidth": 0.9, "capsize": 2.0, "ecolor": INK, "path_effects": outline}
    for at, ((passed, runs), ends) in enumerate(
        zip(designs.evidence.run_counts.tolist(), designs.run_intervals, strict=True)
    ):
        if ends is not None:
            rate = passed / runs
            look: dict[str, Any] = {"color": success_colour(rate, thresholds), "error_kw": error_bar}
            axes.bar(axis.place[at], 100 * rate, 0.8 * axis.step, yerr=error_percent(rate, ends), **look)
    _draw_trials(axes, axis, designs, 0.2 * axis.step, -0.2 * axis.step)
    _finish_success(axes, axis, thresholds, f"Mean success over all environments, {designs.interval_name} 95 % intervals")
    limits = [f"{100 * threshold:g}" for threshold in thresholds]
    classes = [f"below {limits[0]} %", *(f"{low} to {high} %" for low, high in pairwise(limits)), f"above {limits[-1]} %"]
    pairs = list(zip(class_colours(thresholds), classes, strict=True))
    handles = [Patch(color=colour, label=text) for colour, text in reversed(pairs)]
    figure.legend(handles=[*handles, *axes.get_legend_handles_labels()[0]], loc="outside lower center", ncols=5)
    return figure


def error_percent(rate: float, ends: tuple[float, float]) -> list[list[float]]:
    """Distances from the rate down and up to the ends of its interval (percentage points), as matplotlib takes them."""
    # Rounding can put an end beyond the rate; matplotlib refuses negative bars.
    return [[max(0.0, 100 * (rate - ends[0]))], [max(0.0, 100 * (ends[1] - rate))]]


def _draw_trials(axes: Axes, axis: Axis, designs: DesignColumns, built: float, simulated: float) -> None:
    """Filled diamonds for trials of built cars, open ones for those of simulated cars, so far beside the designs."""
    _draw_counts(
        axes, axis, designs.evidence.trial_counts, designs.trial_intervals, "trials", built, fmt="D", color=FAILURE
    )
    ends = designs.intervals(designs.simulated_trial_counts)
    look = {"fmt": "D", "color": FAILURE, "markerfacecolor": "white", "markeredgecolor": FAILURE}
    _draw_counts(axes, axis, designs.simulated_trial_counts, ends, "simulated trials", simulated, **look)


def _draw_counts(axes: Axes, axis: Axis, counts: Any, ends: Any, label: str, beside: float = 0.0, **look: Any) -> None:
    shown = numpy.flatnonzero(counts[:, 1]).tolist()
    if not shown:
        return
    rates = [counts[at, 0] / counts[at, 1] for at in shown]
    bars = ends and numpy.hstack([error_percent(rate, ends[at]) for rate, at in zip(rates, shown, strict=True)])
    look = {"markeredgecolor": "white", "markersize": 5.5, "elinewidth": 1.4, "capsize": 3.0, "zorder": 5, **look}
    x, y = [axis.place[at] + beside for at in shown], [100 * rate for rate in rates]
    axes.errorbar(x, y, yerr=bars, clip_on=False, label=label, **look)


def _finish_success(axes: Axes, axis: Axis, thresholds: Sequence[float], title: str) -> None:
    _mark_thresholds(axes, thresholds)
    axes.set_ylabel("passed (%)")
    axes.set_title(title)
    axis.finish(axes)


def _mark_thresholds(axes: Axes, thresholds: Sequence[float]) -> None:
    for threshold in thresholds:
        axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
    axes.set_ylim(0, 103)


def draw_outcomes(designs: DesignColumns) -> Figure:
    """Stacked bars of the share of each outcome, one bar per value."""
    axis, figure = Axis(designs), Figure(figsize=(WIDE_IN, HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    run = [at for at in axis.place if designs.evidence.outcome_counts[at].sum()]
    x, bottom = [axis.place[at] for at in run], numpy.zeros(len(run))
    for code, outcome in enumerate(OUTCOMES):
        shares = 100 * designs.evidence.outcome_counts[run, code] / designs.evidence.outcome_counts[run].sum(axis=1)
        if shares.any():
            look: dict[str, Any] = {"color": OUTCOME_COLOURS[outcome], "edgecolor": "white", "linewidth": 0.3}
            axes.bar(x, shares, 0.8 * axis.step, bottom=bottom, label=OUTCOME_LABELS[outcome], **look)
            bottom += shares
    axes.set_ylim(0, 100)
    axes.set_ylabel("share of runs (%)")
    axes.set_title("How the runs ended")
    axis.finish(axes)
    figure.legend(loc="outside lower center", ncols=6)
    return figure


def draw_effects(designs: DesignColumns, effects: Effects, places: Sequence[int], thresholds: Sequence[float]) -> Figure:
    """Success over each parameter with its band, and curves of single combinations of the others."""
    names = [list(designs.evidence.values)[place] for place in places]
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(WIDE_IN, 2.7 * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True)
    for at, (name, axes) in enumerate(zip(names, grid.flat, strict=False)):
        one = effects.effect(at)
        axes.plot(one.grid, 100 * one.curves.T, color=INK, linewidth=0.5, alpha=0.3)
        axes.fill_between(one.grid, 100 * one.low, 100 * one.high, color=ACCENT, alpha=0.25, linewidth=0)
        axes.plot(one.grid, 100 * one.mean, "o-", color=ACCENT, linewidth=1.6, markersize=3.5)
        _mark_thresholds(axes, thresholds)
        axes.set_xlabel(axis_label(name))
        axes.set_title(f"{one.combinations} combinations", fontsize=8, fontweight="normal")
    for axes in list(grid.flat)[len(names) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel("passed (%)")
    figure.suptitle(
        f"Effects on success in {designs.evidence.info.simulation}", x=0.01, ha="left", fontweight="bold", fontsize=10
    )
    return figure


def draw_map(
    designs: DesignColumns, effects: Effects, places: Sequence[int], two: Sequence[int], thresholds: Sequence[float]
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
    look: dict[str, Any] = {"cmap": "cividis", "vmin": 0, "vmax": 100, "edgecolors": "white", "linewidth": 0.4}
    # Cells are of values, which stand in their middles.
    drawn = axes.pcolormesh(xs, ys, cells, shading="nearest", **look)
    if cells.size <= MAX_NUMBERS:
        for (row, column), value in numpy.ndenumerate(cells):
            if numpy.isfinite(value):
                colour = "white" if value < 55 else INK
                axes.text(xs[column], ys[row], f"{value:.0f}", ha="center", va="center", fontsize=8, color=colour)
    inside = numpy.ma.masked_invalid(cells)
    levels = [100 * threshold for threshold in thresholds if inside.min() < 100 * threshold < inside.max()]
    if levels and min(cells.shape) > 1:
        axes.contour(xs, ys, inside, levels=levels, colors="white", linewidths=1.6)
    names = [list(designs.evidence.values)[place] for place in two]
    axes.set_xlabel(axis_label(names[0]))
    axes.set_ylabel(axis_label(names[1]))
    axes.set_xticks(xs[:: -(-len(xs) // MAX_TICKS)])
    axes.set_yticks(ys[:: -(-len(ys) // MAX_TICKS)])
    axes.grid(False)
    axes.set_title("Success over {} and {}".format(*(label_and_unit(name)[0] for name in names)))
    figure.colorbar(drawn, ax=axes, label="passed (%)")
    if numpy.isnan(cells).any():
        figure.legend(handles=[Patch(facecolor=NOT_RUN, label="no run")], loc="outside lower center")
    return figure
