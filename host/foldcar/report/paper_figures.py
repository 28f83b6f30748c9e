"""Draw the figures for papers, which are saved with the page. Fractions are in per cent.

Input: an experiment's designs and smooth model. Output: drawings in the order in which the page lists them. If several
parameters vary, all drawings are of the smooth model of simulation, over the same combinations of the other parameters.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import matplotlib
import numpy
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from foldcar.figures.style import ACCENT, FAILURE, INK, OUTCOME_COLOURS, OUTCOME_LABELS
from foldcar.outputs import file_name_part
from foldcar.report.page_designs import Band, DesignColumns
from foldcar.report.page_effects import combinations_text, importance_rows
from foldcar.report.page_realities import drawn_realities
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.effects import Effects
from foldcar.statistics.words import label_and_unit

WIDE_IN, HEIGHT_IN = 7.2, 3.7
# Heights of a panel of the effects, and of their title.
PANEL_IN, TITLE_IN = 2.7, 0.4
GREEN, BLUE, NAVY, REGION, NOT_RUN = "#62b85f", "#3f7fd0", "#14265c", "#dff1ea", "#e6e6e6"
# Colours of the publication's figure by number of thresholds; more thresholds take colours of a map.
PUBLISHED = {1: (NAVY, GREEN), 2: (NAVY, BLUE, GREEN)}
# With more values, not each has a tick.
MAX_TICKS = 12
# Figures of effects in a row; a map with more cells has no numbers in them.
COLUMNS, MAX_NUMBERS = 3, 150


@dataclass(frozen=True)
class PaperFigure:
    """A figure: what it shows, the name of its files without suffix, its caption, and the function that draws it.

    ``kind`` is *feasibility*, *success*, *outcomes*, *effects* or *map*. ``draw`` takes the keyword ``figure``, an empty
    figure to draw into; without one it makes a figure.
    """

    kind: str
    name: str
    caption: str
    draw: Callable[..., Figure]


def drawings(
    designs: DesignColumns, effects: Effects | None, indices: Sequence[int], thresholds: Sequence[float]
) -> Iterator[PaperFigure]:
    """Yield the drawings of an experiment, each with the name of its file and a caption.

    ``effects`` are the effects of the parameters with these ``indices``, or None.
    """
    start = "experiment_" + file_name_part(designs.evidence.info.id)
    success_defined, has_runs = designs.evidence.info.success_defined, bool(designs.evidence.outcome_counts.any())
    if len(designs.evidence.values) == 1 and (has_runs or designs.evidence.trial_counts.any()):
        (name,) = designs.evidence.values
        label = label_and_unit(name)[0]
        if success_defined:
            caption = f"Success by {label}: what simulation and trials say, with 95 % bands"
            draw = partial(draw_feasibility, designs, thresholds)
            yield PaperFigure("feasibility", f"{start}_feasibility_by_{name}", caption, draw)
        if success_defined and has_runs:
            caption = f"Mean success by {label} over all environments, with {designs.interval_name} 95 % intervals"
            yield PaperFigure(
                "success", f"{start}_success_by_{name}", caption, partial(draw_success, designs, thresholds)
            )
        if has_runs:
            caption = f"Outcomes by {label}"
            yield PaperFigure("outcomes", f"{start}_outcomes_by_{name}", caption, partial(draw_outcomes, designs))
    if len(indices) > 1 and effects is not None:
        caption_start = "Success over each parameter, with 95 % bands of the differences between its values"
        combinations = combinations_text(effects.effect(0), len(indices))
        caption = f"{caption_start}: {combinations}, for the first. Thin: single combinations."
        draw = partial(draw_effects, designs, effects, indices, thresholds)
        yield PaperFigure("effects", f"{start}_effects", caption, draw)
        # The map shows the two most important parameters. If all designs have the same rate, no parameter is more
        # important than another, and it shows the first two.
        by_importance = [row["parameter"] for row in importance_rows(effects, indices)]
        mapped = (by_importance or list(indices))[:2]
        first, second = (list(designs.evidence.values)[index] for index in mapped)
        first_label, second_label = label_and_unit(first)[0], label_and_unit(second)[0]
        caption_start = f"Success over {first_label} and {second_label} by the smooth model"
        yield PaperFigure(
            "map",
            f"{start}_map_by_{first}_and_{second}",
            f"{caption_start}, a mean over the same combinations of the others",
            partial(draw_map, designs, effects, indices, mapped, thresholds),
        )


def axis_label(parameter: str) -> str:
    """Return ``wheel radius (mm)`` of wheel_radius_mm."""
    label, unit = label_and_unit(parameter)
    return f"{label} ({unit})" if unit else label


def class_colours(thresholds: Sequence[float]) -> Sequence[Any]:
    """Return a colour for each class between the thresholds, from the lowest class to the highest."""
    number = len(thresholds)
    if number in PUBLISHED:
        return PUBLISHED[number]
    return [matplotlib.colormaps["viridis"](0.1 + 0.8 * place / number) for place in range(number + 1)]


def success_colour(success: float, thresholds: Sequence[float]) -> Any:
    """Return the colour of a rate; for thresholds 0.5 and 0.75 navy below 50 %, blue to 75 %, green above."""
    # Only a rate above the last threshold is in the highest class, as in the publication.
    *lower_thresholds, last_threshold = thresholds
    class_index = sum(success >= threshold for threshold in lower_thresholds) + (success > last_threshold)
    return class_colours(thresholds)[class_index]


class Axis:
    """The axis of the only parameter: ascending ``ticks`` with minimum distance ``step``; ``place`` by design index."""

    def __init__(self, designs: DesignColumns) -> None:
        ((self.name, self.ticks),) = designs.evidence.values.items()
        self.place = {at: float(design.design[self.name]) for at, design in enumerate(designs.evidence.family)}
        self.step = float(numpy.diff(self.ticks).min()) if len(self.ticks) > 1 else 1.0

    def finish(self, axes: Axes) -> None:
        """Set the axis' label, ticks and limits."""
        axes.set_xlabel(axis_label(self.name))
        if len(self.ticks) <= MAX_TICKS:
            axes.set_xticks(self.ticks, [f"{tick:g}" for tick in self.ticks])
        axes.set_xlim(self.ticks[0] - 0.65 * self.step, self.ticks[-1] + 0.65 * self.step)
        axes.grid(axis="x", visible=False)


def draw_feasibility(designs: DesignColumns, thresholds: Sequence[float], figure: Figure | None = None) -> Figure:
    """Draw the success rates of designs in simulation and of built cars, each with its 95 % band.

    The simulator does not know everything exactly, such as friction. A *reality* is one possible set of values of what
    it does not know, and each thin curve is the success rate in one reality. Designs whose built cars reach the highest
    of the ``thresholds`` on average have a tinted background.
    """
    # Where each design stands on the horizontal axis.
    axis = Axis(designs)
    figure = figure or Figure(figsize=(WIDE_IN, 4.0), layout="constrained")
    axes = figure.subplots()
    x, mean, low, high = _placed_bands(axis, designs.built)
    for place in x[mean >= thresholds[-1]]:
        axes.axvspan(place - axis.step / 2, place + axis.step / 2, color=REGION, linewidth=0, zorder=0)
    _draw_realities(axes, axis, designs)
    # Without runs in other realities nothing is known of built cars.
    has_built = len(x) > 0
    if has_built:
        axes.fill_between(x, 100 * low, 100 * high, color=ACCENT, alpha=0.22, linewidth=0, label="built cars, 95 % band")
        axes.plot(x, 100 * mean, "o", color=ACCENT, markersize=4.5, label="built cars, mean")
    x, rate, low, high = _placed_bands(axis, designs.simulation)
    axes.fill_between(x, 100 * low, 100 * high, color=INK, alpha=0.25, linewidth=0)
    label = f"{designs.evidence.info.simulation}, 95 % band"
    axes.plot(x, 100 * rate, "-", color=INK, linewidth=1.2, label=label)
    _draw_trials(axes, axis, designs)
    _finish_success(axes, axis, thresholds, "Feasible region")
    handles, _ = axes.get_legend_handles_labels()
    if has_built:
        handles.append(Patch(color=REGION, label=f"mean of built cars reaches {100 * thresholds[-1]:g} %"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _placed_bands(axis: Axis, bands: Sequence[Band]) -> NDArray[Any]:
    """Return place on the axis, rate, low and high, (4, designs with a band), in ascending order of the place."""
    rows = []
    for index, band in enumerate(bands):
        if band is not None:
            rows.append((axis.place[index], *band))
    return numpy.asarray(numpy.array(sorted(rows), dtype=float).reshape(-1, 4).T)


def _draw_realities(axes: Axes, axis: Axis, designs: DesignColumns) -> None:
    """Draw a thin curve for each of some *realities*, possible values of the simulator's uncertain parameters.

    The curve is the success rate of every design in the reality. Nothing is drawn if no such rates have been learned.
    """
    realities = drawn_realities(designs.evidence)
    if realities is None:
        return
    _, rates_of_realities = realities
    in_belief = numpy.flatnonzero(numpy.isfinite(rates_of_realities).all(axis=0)).tolist()
    ascending = sorted(in_belief, key=lambda index: axis.place[index])
    x = [axis.place[index] for index in ascending]
    curves = [numpy.column_stack([x, 100 * rates[ascending]]) for rates in rates_of_realities]
    # All curves are one object, so that the legend has one entry for them.
    lines = LineCollection(
        curves, colors=ACCENT, linewidths=0.4, alpha=0.25, zorder=0.5, label="ways in which reality may differ"
    )
    axes.add_collection(lines)


def draw_success(designs: DesignColumns, thresholds: Sequence[float], figure: Figure | None = None) -> Figure:
    """Draw the success rates of designs: a bar for the runs of each design, and a diamond for its trials.

    A bar has the colour of its class; the ``thresholds`` divide the classes.
    """
    # Where each design stands on the horizontal axis.
    axis = Axis(designs)
    figure = figure or Figure(figsize=(WIDE_IN, HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    # A white outline keeps the dark error bars visible on navy.
    outline = [withStroke(linewidth=2.2, foreground="white")]
    error_bar = {"elinewidth": 0.9, "capsize": 2.0, "ecolor": INK, "path_effects": outline}
    for index, interval in enumerate(designs.run_intervals):
        if interval is not None:
            passed, runs = designs.evidence.run_counts[index].tolist()
            rate = passed / runs
            look: dict[str, Any] = {"color": success_colour(rate, thresholds), "error_kw": error_bar}
            axes.bar(axis.place[index], 100 * rate, 0.8 * axis.step, yerr=error_percent(rate, interval), **look)
    _draw_trials(axes, axis, designs, offset=0.2 * axis.step)
    _finish_success(axes, axis, thresholds, f"Mean success over all environments, {designs.interval_name} 95 % intervals")
    drawn_handles, _ = axes.get_legend_handles_labels()
    figure.legend(handles=[*_class_handles(thresholds), *drawn_handles], loc="outside lower center", ncols=5)
    return figure


def _class_handles(thresholds: Sequence[float]) -> list[Patch]:
    """Return a coloured patch with a text, such as "50 to 75 %", for each class of success from the highest down."""
    limits = [f"{100 * threshold:g}" for threshold in thresholds]
    class_texts = [f"below {limits[0]} %"]
    class_texts += [f"{low} to {high} %" for low, high in pairwise(limits)]
    class_texts.append(f"above {limits[-1]} %")
    handles = []
    for colour, text in zip(class_colours(thresholds), class_texts, strict=True):
        handles.append(Patch(color=colour, label=text))
    handles.reverse()
    return handles


def error_percent(rate: float, ends: tuple[float, float]) -> list[list[float]]:
    """Return the distances from the rate down and up to the ends of its interval (percentage points), for matplotlib."""
    low, high = ends
    # Rounding can put an end beyond the rate; matplotlib refuses negative bars.
    below, above = max(0.0, 100 * (rate - low)), max(0.0, 100 * (high - rate))
    return [[below], [above]]


def _draw_trials(axes: Axes, axis: Axis, designs: DesignColumns, offset: float = 0.0) -> None:
    """Draw a diamond with an error bar for each design with trials, at the design's place plus ``offset``."""
    x, y, error_bars = [], [], []
    for index, interval in enumerate(designs.trial_intervals):
        # Without trials, or if success is undefined, there is no interval.
        if interval is None:
            continue
        passed, trials = designs.evidence.trial_counts[index]
        rate = passed / trials
        x.append(axis.place[index] + offset)
        y.append(100 * rate)
        error_bars.append(error_percent(rate, interval))
    if not x:
        return
    look: dict[str, Any] = {"markeredgecolor": "white", "markersize": 5.5, "elinewidth": 1.4, "capsize": 3.0, "zorder": 5}
    # (2, designs): lengths below and above the rate.
    lengths = numpy.hstack(error_bars)
    axes.errorbar(x, y, yerr=lengths, clip_on=False, label="trials", fmt="D", color=FAILURE, **look)


def _finish_success(axes: Axes, axis: Axis, thresholds: Sequence[float], title: str) -> None:
    """Add thresholds, labels and title to a figure of success over the only parameter."""
    _mark_thresholds(axes, thresholds)
    axes.set_ylabel("passed (%)")
    axes.set_title(title)
    axis.finish(axes)


def _mark_thresholds(axes: Axes, thresholds: Sequence[float]) -> None:
    """Draw a dotted line at each threshold, and set the limits of the axis of success (%)."""
    for threshold in thresholds:
        axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
    axes.set_ylim(0, 103)


def draw_outcomes(designs: DesignColumns, figure: Figure | None = None) -> Figure:
    """Draw how runs ended, as the percentage of each outcome in stacked bars.

    There is a bar for each value of the only parameter in which the designs differ.
    """
    axis, figure = Axis(designs), figure or Figure(figsize=(WIDE_IN, HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    outcome_counts = designs.evidence.outcome_counts
    with_runs = [index for index in axis.place if outcome_counts[index].sum()]
    x = [axis.place[index] for index in with_runs]
    run_counts = outcome_counts[with_runs].sum(axis=1)
    bottom = numpy.zeros(len(with_runs))
    for code, outcome in enumerate(OUTCOMES):
        percents = 100 * outcome_counts[with_runs, code] / run_counts
        if percents.any():
            look: dict[str, Any] = {"color": OUTCOME_COLOURS[outcome], "edgecolor": "white", "linewidth": 0.3}
            axes.bar(x, percents, 0.8 * axis.step, bottom=bottom, label=OUTCOME_LABELS[outcome], **look)
            bottom += percents
    axes.set_ylim(0, 100)
    axes.set_ylabel("share of runs (%)")
    axes.set_title("How the runs ended")
    axis.finish(axes)
    figure.legend(loc="outside lower center", ncols=6)
    return figure


def draw_effects(
    designs: DesignColumns,
    effects: Effects,
    indices: Sequence[int],
    thresholds: Sequence[float],
    figure: Figure | None = None,
) -> Figure:
    """Draw how success changes with each parameter, in a panel of its own.

    A panel has the mean over the combinations of the other parameters, with a band, and a thin curve for each of some
    combinations. ``effects`` is a model of those of the designs' parameters that have these ``indices``.
    """
    all_names = list(designs.evidence.values)
    names = [all_names[parameter] for parameter in indices]
    rows = math.ceil(len(names) / COLUMNS)
    figure = figure or Figure(figsize=(WIDE_IN, PANEL_IN * rows + TITLE_IN), layout="constrained")
    grid = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True)
    for index_in_model, (name, axes) in enumerate(zip(names, grid.flat, strict=False)):
        effect = effects.effect(index_in_model)
        axes.plot(effect.grid, 100 * effect.curves.T, color=INK, linewidth=0.5, alpha=0.3)
        axes.fill_between(effect.grid, 100 * effect.low, 100 * effect.high, color=ACCENT, alpha=0.25, linewidth=0)
        axes.plot(effect.grid, 100 * effect.mean, "o-", color=ACCENT, linewidth=1.6, markersize=3.5)
        _mark_thresholds(axes, thresholds)
        axes.set_xlabel(axis_label(name))
        axes.set_title(f"{effect.combinations} combinations", fontsize=8, fontweight="normal")
    # The last row may have more panels than are needed.
    for axes in list(grid.flat)[len(names) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel("passed (%)")
    figure.suptitle(
        f"Effects on success in {designs.evidence.info.simulation}", x=0.01, ha="left", fontweight="bold", fontsize=10
    )
    return figure


def draw_map(
    designs: DesignColumns,
    effects: Effects,
    indices: Sequence[int],
    two: Sequence[int],
    thresholds: Sequence[float],
    figure: Figure | None = None,
) -> Figure:
    """Draw success over the parameters with the indices ``two``, with lines where the model crosses the thresholds."""
    x_index, y_index = (list(indices).index(index) for index in two)
    # (pairs, 2): the pairs of values that were simulated. Cells of other pairs stay NaN.
    pairs = numpy.unique(effects.parameters[:, [x_index, y_index]], axis=0)
    xs, ys = numpy.unique(pairs[:, 0]), numpy.unique(pairs[:, 1])
    rates, _, _ = effects.standardised((x_index, y_index), pairs)
    cells = numpy.full((len(ys), len(xs)), numpy.nan)
    columns, rows = numpy.searchsorted(xs, pairs[:, 0]), numpy.searchsorted(ys, pairs[:, 1])
    cells[rows, columns] = 100 * rates
    figure = figure or Figure(figsize=(WIDE_IN, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.set_facecolor(NOT_RUN)
    look: dict[str, Any] = {"cmap": "cividis", "vmin": 0, "vmax": 100, "edgecolors": "white", "linewidth": 0.4}
    # Each cell has its pair of values in the middle.
    drawn = axes.pcolormesh(xs, ys, cells, shading="nearest", **look)
    if cells.size <= MAX_NUMBERS:
        for (row, column), value in numpy.ndenumerate(cells):
            if numpy.isfinite(value):
                # cividis is dark at low values.
                colour = "white" if value < 55 else INK
                axes.text(xs[column], ys[row], f"{value:.0f}", ha="center", va="center", fontsize=8, color=colour)
    rates_percent = numpy.ma.masked_invalid(cells)
    levels = [100 * threshold for threshold in thresholds if rates_percent.min() < 100 * threshold < rates_percent.max()]
    if levels and min(cells.shape) > 1:
        axes.contour(xs, ys, rates_percent, levels=levels, colors="white", linewidths=1.6)
    names = [list(designs.evidence.values)[index] for index in two]
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
