"""Draws mean success by a design parameter in three colours, with Wilson 95 % intervals."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from foldcar.figures.style import FAILURE, INK
from foldcar.report.axis import ParameterAxis
from foldcar.report.series import Series, Tally
from foldcar.report.trial_series import TrialTally

GREEN, BLUE, NAVY = "#62b85f", "#3f7fd0", "#14265c"
LEGEND = ((GREEN, "above 75 %"), (BLUE, "50 to 75 %"), (NAVY, "below 50 %"))


def success_colour(success: float) -> str:
    """Green above 75 %, blue from 50 to 75 %, navy below 50 %."""
    if success > 0.75:
        return GREEN
    return BLUE if success >= 0.5 else NAVY


def error_bar_percent(tally: Tally | TrialTally) -> tuple[float, float]:
    """Distances from the success down and up to the ends of the 95 % interval (percentage points)."""
    success, interval = tally.success, tally.interval
    if success is None or interval is None:
        return 0.0, 0.0
    low, high = interval
    # Rounding can put an end of the interval beyond the success; matplotlib refuses negative bars.
    return max(0.0, 100 * (success - low)), max(0.0, 100 * (high - success))


def draw_success(series: Series, trials: Mapping[float, TrialTally]) -> Figure:
    """Bars for the runs; diamonds for the trials at values that the runs have too."""
    axis = ParameterAxis(list(series.tallies))
    figure = Figure(figsize=(7.2, 3.7), layout="constrained")
    axes = figure.subplots()
    # A white outline keeps the dark error bars visible on navy.
    outline = [withStroke(linewidth=2.2, foreground="white")]
    error_bar = {"elinewidth": 0.9, "capsize": 2.0, "ecolor": INK, "path_effects": outline}
    for value, tally in series.tallies.items():
        if tally.success is None:
            continue
        below, above = error_bar_percent(tally)
        axes.bar(
            axis.place(value),
            100 * tally.success,
            width=axis.bar_width,
            color=success_colour(tally.success),
            yerr=[[below], [above]],
            error_kw=error_bar,
        )
    _draw_trials(axes, axis, {value: tally for value, tally in trials.items() if tally.counted})
    for threshold in (50, 75):
        axes.axhline(threshold, color=INK, linewidth=0.7, linestyle=":")
    axes.set_ylim(0, 103)
    axes.set_ylabel("passed (%)")
    axes.set_title("Mean success over all environments, Wilson 95 % intervals")
    axes.grid(axis="x", visible=False)
    axis.label(axes, series.parameter)
    handles: list[Any] = [Patch(color=colour, label=label) for colour, label in LEGEND]
    handles += axes.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _draw_trials(axes: Axes, axis: ParameterAxis, trials: Mapping[float, TrialTally]) -> None:
    shown = [value for value in trials if value in axis.values]
    if not shown:
        return
    errors = [error_bar_percent(trials[value]) for value in shown]
    axes.errorbar(
        # Beside the middle of the bar, where the runs' interval is.
        [axis.place(value) + 0.25 * axis.bar_width for value in shown],
        [100 * trials[value].success for value in shown],
        yerr=[list(side) for side in zip(*errors, strict=True)],
        fmt="D",
        markersize=5.5,
        color=FAILURE,
        markeredgecolor="white",
        elinewidth=1.4,
        capsize=3.0,
        clip_on=False,
        zorder=5,
        label="trials",
    )
