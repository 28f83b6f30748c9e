"""Draws the crossing time by a design parameter in one environment; other runs are red, at the time limit."""

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from foldcar.figures.style import ACCENT, FAILURE, OUTCOME_LABELS, OUTCOME_MARKERS
from foldcar.report.axis import ParameterAxis
from foldcar.report.figure_size import legend_columns, set_title, sized_figure
from foldcar.report.series import TimedRun
from foldcar.simulation.results import OUTCOMES


def draw_times(
    runs: Sequence[TimedRun], parameter: str, time_limit_s: float, sample: int, narrow: bool = False
) -> Figure:
    """Crossing times (s) by the parameter's value; the time axis is broken below the limit, which is often minutes."""
    axis = ParameterAxis([run.value for run in runs])
    figure = sized_figure(narrow)
    limit, times = figure.subplots(2, 1, sharex=True, height_ratios=(1, 6))
    for outcome in OUTCOMES:
        points = [run for run in runs if run.outcome == outcome]
        if not points:
            continue
        x = [axis.place(run.value) for run in points]
        passed = outcome == "passed"
        target, y = (
            (times, [run.time_s for run in points]) if passed else (limit, [time_limit_s] * len(points))
        )
        target.plot(
            x,
            y,
            OUTCOME_MARKERS[outcome],
            color=ACCENT if passed else FAILURE,
            markersize=5.5,
            markeredgewidth=0,
            label=OUTCOME_LABELS[outcome],
            clip_on=False,
            zorder=3,
        )
    passed_times = [run.time_s for run in runs if run.outcome == "passed" and run.time_s is not None]
    times.set_ylim(0.0, max(passed_times, default=1.0) * 1.15)
    if not passed_times:
        times.set_yticks([])
        times.text(0.5, 0.5, "no run passed", transform=times.transAxes, ha="center", va="center")
    times.set_ylabel("time to cross (s)")
    limit.set_ylim(time_limit_s - 1.0, time_limit_s + 1.0)
    limit.set_yticks([time_limit_s], [f"limit {time_limit_s:g} s"])
    set_title(limit, f"Time to cross in one environment (sample {sample})", narrow)
    axis.label(times, parameter)
    _break_axis(limit, times)
    figure.legend(*_legend(times, limit), loc="outside lower center", ncols=legend_columns(narrow, 6))
    return figure


def _legend(*panels: Axes) -> tuple[list[Artist], list[str]]:
    pairs = [panel.get_legend_handles_labels() for panel in panels]
    return [h for handles, _ in pairs for h in handles], [name for _, names in pairs for name in names]


def _break_axis(upper: Axes, lower: Axes) -> None:
    """Hide the border between the panels and mark it as a break of the scale."""
    upper.spines.bottom.set_visible(False)
    upper.tick_params(bottom=False, labelbottom=False)
    mark: dict[str, Any] = {
        "marker": [(-1, -0.6), (1, 0.6)],
        "markersize": 8,
        "linestyle": "none",
        "color": "k",
        "clip_on": False,
    }
    upper.plot([0], [0], transform=upper.transAxes, **mark)
    lower.plot([0], [1], transform=lower.transAxes, **mark)
