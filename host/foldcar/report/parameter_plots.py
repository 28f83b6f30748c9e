"""The figures for papers of an experiment in which one parameter varies: success, outcomes and times over its values.

Input: designs with their counts. Output: figures of matplotlib, shares in per cent.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import matplotlib
import numpy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from foldcar.analysis.words import label_and_unit
from foldcar.figures.style import ACCENT, FAILURE, INK, OUTCOME_COLOURS, OUTCOME_LABELS, OUTCOME_MARKERS
from foldcar.report.page_designs import Designs
from foldcar.simulation.results import NUMBERS, OUTCOMES

WIDE_IN, HEIGHT_IN = 7.2, 3.7
GREEN, BLUE, NAVY, REGION = "#62b85f", "#3f7fd0", "#14265c", "#dff1ea"
# For as many thresholds; for more, evenly from a map of colours.
PUBLISHED = {1: (NAVY, GREEN), 2: (NAVY, BLUE, GREEN)}
# More values have no tick each.
MOST_TICKS = 12


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
    """The values of the one parameter: numbers to scale, texts at equal distances; ``designs`` by index, ascending."""

    def __init__(self, designs: Designs) -> None:
        ((self.name, values),) = designs.values.items()
        self.to_scale = all(not isinstance(value, str) for value in values)
        places = dict(zip(values, [float(one) for one in values] if self.to_scale else range(len(values)), strict=True))
        self.texts = [one if isinstance(one, str) else f"{one:g}" for one in values]
        self.ticks = list(places.values())
        self.place = {at: places[one[self.name]] for at, one in enumerate(designs.designs) if self.name in one}
        self.step = float(numpy.diff(self.ticks).min()) if len(self.ticks) > 1 else 1.0

    def finish(self, axes: Axes) -> None:
        """Label the axis."""
        axes.set_xlabel(axis_label(self.name))
        if not self.to_scale or len(self.ticks) <= MOST_TICKS:
            axes.set_xticks(self.ticks, self.texts)
        axes.set_xlim(self.ticks[0] - 0.65 * self.step, self.ticks[-1] + 0.65 * self.step)
        axes.grid(axis="x", visible=False)


def _figure(height_in: float = HEIGHT_IN) -> Figure:
    return Figure(figsize=(WIDE_IN, height_in), layout="constrained")


def draw_feasibility(designs: Designs, thresholds: Sequence[float]) -> Figure:
    """What simulation and trials together say, with its 95 % band; both beside it. Tinted where it is above the last."""
    axis, figure = Axis(designs), _figure(4.0)
    axes = figure.subplots()
    believed = sorted((axis.place[at], *one) for at, one in enumerate(designs.believed) if one is not None)
    x, rate, low, high = numpy.array(believed, dtype=float).reshape(-1, 4).T
    for place in x[rate > thresholds[-1]]:
        axes.axvspan(place - axis.step / 2, place + axis.step / 2, color=REGION, linewidth=0, zorder=0)
    together = designs.pooled is not None
    label = "simulation and trials together" if together else designs.info.simulation
    if axis.to_scale:
        axes.fill_between(x, 100 * low, 100 * high, color=ACCENT, alpha=0.25, linewidth=0)
        axes.plot(x, 100 * rate, "-", color=ACCENT, linewidth=1.6)
    else:
        axes.vlines(x, 100 * low, 100 * high, color=ACCENT, linewidth=3, alpha=0.35)
    axes.plot(x, 100 * rate, "o", color=ACCENT, markersize=4)
    axes.plot([], [], "o-", color=ACCENT, label=f"{label}, 95 % band")
    if together:
        _draw_counts(axes, axis, designs.counted, 0.0, "o", INK, "white", f"{designs.info.simulation} alone")
    _draw_trials(axes, axis, designs)
    _finish_success(axes, axis, thresholds, "Feasible region")
    handles = [*axes.get_legend_handles_labels()[0], Patch(color=REGION, label=f"above {100 * thresholds[-1]:g} %")]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def draw_success(designs: Designs, thresholds: Sequence[float]) -> Figure:
    """Bars for the runs of simulation in the colours of their classes; diamonds for trials."""
    axis, figure = Axis(designs), _figure()
    axes = figure.subplots()
    # A white outline keeps the dark error bars visible on navy.
    error_bar = {
        "elinewidth": 0.9,
        "capsize": 2.0,
        "ecolor": INK,
        "path_effects": [withStroke(linewidth=2.2, foreground="white")],
    }
    for at, ((passed, runs), ends) in enumerate(zip(designs.counted.tolist(), designs.simulated, strict=True)):
        if ends is not None:
            bars = error_percent(passed / runs, ends)
            colour = success_colour(passed / runs, thresholds)
            axes.bar(axis.place[at], 100 * passed / runs, 0.8 * axis.step, color=colour, yerr=bars, error_kw=error_bar)
    _draw_trials(axes, axis, designs, 0.2 * axis.step)
    title = f"Mean success over all environments, {designs.interval_name} 95 % intervals"
    _finish_success(axes, axis, thresholds, title)
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


def _draw_trials(axes: Axes, axis: Axis, designs: Designs, beside: float = 0.0) -> None:
    _draw_counts(axes, axis, designs.tried, beside, "D", FAILURE, "white", "trials", designs.driven)
    counts = designs.pretended
    ends, left = designs.intervals(counts), -beside or -0.12
    _draw_counts(axes, axis, counts, left, "D", FAILURE, FAILURE, "simulated trials", ends, "white")


def _draw_counts(
    axes: Axes,
    axis: Axis,
    counts: Any,
    beside: float,
    marker: str,
    colour: str,
    edge: str,
    label: str,
    ends: Any = None,
    face: str | None = None,
) -> None:
    shown = [at for at, (_, number) in enumerate(counts.tolist()) if number]
    for first, at in enumerate(shown):
        rate = counts[at, 0] / counts[at, 1]
        bars = None if ends is None else error_percent(rate, ends[at])
        look: dict[str, Any] = {
            "color": colour,
            "markeredgecolor": edge,
            "markerfacecolor": face or colour,
            "markersize": 5.5,
            "elinewidth": 1.4,
            "capsize": 3.0,
        }
        named = label if not first else None
        place = axis.place[at] + beside
        axes.errorbar([place], [100 * rate], yerr=bars, fmt=marker, clip_on=False, zorder=5, label=named, **look)


def _finish_success(axes: Axes, axis: Axis, thresholds: Sequence[float], title: str) -> None:
    for threshold in thresholds:
        axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
    axes.set_ylim(0, 103)
    axes.set_ylabel("passed (%)")
    axes.set_title(title)
    axis.finish(axes)


def draw_outcomes(designs: Designs) -> Figure:
    """Stacked bars of the share of each outcome, one bar per value."""
    axis, figure = Axis(designs), _figure()
    axes = figure.subplots()
    run = [at for at in axis.place if designs.ends[at].sum()]
    x, bottom = [axis.place[at] for at in run], numpy.zeros(len(run))
    for code, outcome in enumerate(OUTCOMES):
        shares = 100 * designs.ends[run, code] / designs.ends[run].sum(axis=1)
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


def draw_times(designs: Designs, sample: int) -> Figure:
    """Times to cross in one environment; other runs are red, at the limit, before which the axis is broken."""
    axis, figure, runs, limit_s = Axis(designs), _figure(), designs.runs, designs.info.timeout_s
    limit, times = figure.subplots(2, 1, sharex=True, height_ratios=(1, 6))
    elapsed_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    crossed: list[float] = []
    for code, outcome in enumerate(OUTCOMES):
        these = numpy.flatnonzero((runs.sample == sample) & (runs.outcome == code))
        if not len(these):
            continue
        x, passed = [axis.place[int(at)] for at in runs.design[these]], outcome == "passed"
        y = elapsed_s[these].tolist() if passed else [limit_s] * len(these)
        crossed += y if passed else []
        look: dict[str, Any] = {"color": ACCENT if passed else FAILURE, "markersize": 5.5, "markeredgewidth": 0}
        target = times if passed else limit
        target.plot(x, y, OUTCOME_MARKERS[outcome], label=OUTCOME_LABELS[outcome], clip_on=False, zorder=3, **look)
    times.set_ylim(0.0, max(crossed, default=1.0) * 1.15)
    if not crossed:
        times.set_yticks([])
        times.text(0.5, 0.5, "no run passed", transform=times.transAxes, ha="center", va="center")
    times.set_ylabel("time to cross (s)")
    limit.set_ylim(limit_s - 1.0, limit_s + 1.0)
    limit.set_yticks([limit_s], [f"limit {limit_s:g} s"])
    limit.set_title(f"Time to cross in one environment (sample {sample})")
    axis.finish(times)
    # The border between the panels is a break of the scale.
    limit.spines.bottom.set_visible(False)
    limit.tick_params(bottom=False, labelbottom=False)
    mark: dict[str, Any] = {"marker": [(-1, -0.6), (1, 0.6)], "markersize": 8, "color": "k", "clip_on": False}
    limit.plot([0], [0], transform=limit.transAxes, linestyle="none", **mark)
    times.plot([0], [1], transform=times.transAxes, linestyle="none", **mark)
    (first, names), (second, more) = times.get_legend_handles_labels(), limit.get_legend_handles_labels()
    figure.legend([*first, *second], [*names, *more], loc="outside lower center", ncols=6)
    return figure
