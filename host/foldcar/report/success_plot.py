"""Draws mean success by a design parameter in three colours, with 95 % intervals."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from foldcar.figures.style import FAILURE, INK
from foldcar.report.axis import ParameterAxis, interval_text, parameter_label, value_text
from foldcar.report.figure_options import THRESHOLDS
from foldcar.report.figure_size import legend_columns, set_title, sized_figure
from foldcar.report.series import Series, Tally
from foldcar.report.tips import set_tip
from foldcar.report.trial_series import TrialTally

GREEN, BLUE, NAVY = "#62b85f", "#3f7fd0", "#14265c"
# For as many thresholds; for more, evenly from a map of colours.
PUBLISHED = {1: (NAVY, GREEN), 2: (NAVY, BLUE, GREEN)}


def class_colours(thresholds: Sequence[float]) -> Sequence[Any]:
    """A colour for each class between the thresholds, from the lowest class to the highest."""
    count = len(thresholds)
    if count in PUBLISHED:
        return PUBLISHED[count]
    return [matplotlib.colormaps["viridis"](0.1 + 0.8 * place / count) for place in range(count + 1)]


def success_colour(success: float, thresholds: Sequence[float] = THRESHOLDS) -> Any:
    """Of the thresholds 0.5 and 0.75: green above 75 %, blue from 50 to 75 %, navy below 50 %."""
    reached = sum(success >= threshold for threshold in thresholds[:-1])
    return class_colours(thresholds)[reached + (success > thresholds[-1])]


def _legend(thresholds: Sequence[float]) -> list[Any]:
    limits = [f"{100 * threshold:g}" for threshold in thresholds]
    between = [f"{low} to {high} %" for low, high in pairwise(limits)]
    labels = [f"below {limits[0]} %", *between, f"above {limits[-1]} %"]
    pairs = zip(class_colours(thresholds), labels, strict=True)
    return [Patch(color=colour, label=label) for colour, label in reversed(list(pairs))]


def error_bar_percent(tally: Tally | TrialTally) -> tuple[float, float]:
    """Distances from the success down and up to the ends of the 95 % interval (percentage points)."""
    success, interval = tally.success, tally.interval
    if success is None or interval is None:
        return 0.0, 0.0
    low, high = interval
    # Rounding can put an end of the interval beyond the success; matplotlib refuses negative bars.
    return max(0.0, 100 * (success - low)), max(0.0, 100 * (high - success))


def draw_success(
    series: Series,
    built: Mapping[float, TrialTally],
    simulated: Mapping[float, TrialTally],
    thresholds: Sequence[float],
    narrow: bool = False,
) -> Figure:
    """Bars for the runs; diamonds for trials at values that the runs have too, hollow ones for simulated trials."""
    axis = ParameterAxis(list(series.tallies))
    figure = sized_figure(narrow)
    axes = figure.subplots()
    # A white outline keeps the dark error bars visible on navy.
    outline = [withStroke(linewidth=2.2, foreground="white")]
    width, cap = (0.6, 0.0) if narrow else (0.9, 2.0)
    error_bar = {"elinewidth": width, "capsize": cap, "ecolor": INK, "path_effects": outline}
    for value, tally in series.tallies.items():
        if tally.success is None:
            continue
        below, above = error_bar_percent(tally)
        bars = axes.bar(
            axis.place(value),
            100 * tally.success,
            width=axis.bar_width,
            color=success_colour(tally.success, thresholds),
            yerr=[[below], [above]],
            error_kw=error_bar,
        )
        set_tip(bars[0], success_tip(series.parameter, value, tally))
    draw_trials(axes, axis, series.parameter, 0.25, built, simulated)
    title = f"Mean success over all environments, {series.interval_name} 95 % intervals"
    finish_success(axes, axis, series.parameter, title, thresholds, narrow)
    handles = _legend(thresholds)
    handles += axes.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside lower center", ncols=legend_columns(narrow, 5))
    return figure


def draw_trial_success(
    parameter: str,
    built: Mapping[float, TrialTally],
    simulated: Mapping[float, TrialTally],
    thresholds: Sequence[float],
    narrow: bool = False,
) -> Figure:
    """Diamonds for the trials of a store without runs, hollow ones for simulated trials."""
    axis = ParameterAxis(sorted({*built, *simulated}))
    figure = sized_figure(narrow)
    axes = figure.subplots()
    draw_trials(axes, axis, parameter, 0.0, built, simulated)
    finish_success(axes, axis, parameter, "Success of trials, Wilson 95 % intervals", thresholds, narrow)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def success_tip(parameter: str, value: float | str, tally: Tally | TrialTally) -> str:
    """What a bar or a point of a success plot stands for."""
    count = tally.counted
    what = "runs" if isinstance(tally, Tally) else "trials"
    return (
        f"{parameter_label(parameter)} {value_text(value)}: {tally.passed} of {count} {what} passed, "
        f"95 % interval {interval_text(tally.interval)} %"
    )


def finish_success(
    axes: Axes, axis: ParameterAxis, parameter: str, title: str, thresholds: Sequence[float], narrow: bool
) -> None:
    """Axes of shares (%), lines at the thresholds, the title."""
    for threshold in thresholds:
        axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
    axes.set_ylim(0, 103)
    axes.set_ylabel("passed (%)")
    set_title(axes, title, narrow)
    axes.grid(axis="x", visible=False)
    axis.label(axes, parameter)


def draw_trials(
    axes: Axes,
    axis: ParameterAxis,
    parameter: str,
    beside: float,
    built: Mapping[float, TrialTally],
    simulated: Mapping[float, TrialTally],
) -> None:
    """Trials by the parameter's value, built cars ``beside`` × the bar's width to the right, simulated ones to the left.

    The runs' own interval is in the middle of the bar.
    """
    looks = {"built": (built, beside, FAILURE, "white"), "simulated": (simulated, -beside or -0.12, "white", FAILURE)}
    for car, (trials, side, face, edge) in looks.items():
        shown = [value for value, tally in trials.items() if tally.counted and value in axis.values]
        if not shown:
            continue
        for value in shown:
            # Only the tip: a larger invisible point under each diamond.
            (point,) = axes.plot(
                axis.place(value) + side * axis.bar_width, 100 * trials[value].success, "o", markersize=14, alpha=0.0
            )
            set_tip(point, success_tip(parameter, value, trials[value]))
        errors = [error_bar_percent(trials[value]) for value in shown]
        axes.errorbar(
            [axis.place(value) + side * axis.bar_width for value in shown],
            [100 * trials[value].success for value in shown],
            yerr=[list(ends) for ends in zip(*errors, strict=True)],
            fmt="D",
            markersize=5.5,
            color=FAILURE,
            markerfacecolor=face,
            markeredgecolor=edge,
            elinewidth=1.4,
            capsize=3.0,
            clip_on=False,
            zorder=5,
            label="trials" if car == "built" else "simulated trials",
        )
