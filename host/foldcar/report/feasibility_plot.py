"""Draws where cars are feasible: the simulation's success with its interval band, trials, and what is advised."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from foldcar.figures.style import ACCENT, INK
from foldcar.report.advice_slots import Recommendation
from foldcar.report.axis import ParameterAxis
from foldcar.report.figure_size import legend_columns, sized_figure
from foldcar.report.series import Series
from foldcar.report.success_plot import draw_trials, finish_success, success_tip
from foldcar.report.tips import set_tip
from foldcar.report.trial_series import TrialTally

REGION = "#dff1ea"
ADVISED = "#e69f00"


def draw_feasibility(
    series: Series,
    built: Mapping[float, TrialTally],
    simulated: Mapping[float, TrialTally],
    thresholds: Sequence[float],
    recommended: Sequence[Recommendation] = (),
    simulation: str = "simulation",
    narrow: bool = False,
) -> Figure:
    """The curve through the designs' shares with the band of their 95 % intervals; trials as diamonds.

    Where the share is above the highest of the thresholds, 0 to 1, the ground is tinted; recommended designs are
    marked under the axis' top. ``simulation`` is what the simulation is called.
    """
    axis = ParameterAxis(list(series.tallies))
    figure = sized_figure(narrow, 4.0)
    axes = figure.subplots()
    judged = [(value, tally) for value, tally in series.tallies.items() if tally.success is not None]
    places = [axis.place(value) for value, _ in judged]
    shares = [100 * (tally.success or 0.0) for _, tally in judged]
    bands = [tally.interval or (0.0, 1.0) for _, tally in judged]
    half = axis.bar_width / 0.8 / 2
    for place, share in zip(places, shares, strict=True):
        if share > 100 * max(thresholds):
            axes.axvspan(place - half, place + half, color=REGION, linewidth=0, zorder=0)
    low, high = [100 * band[0] for band in bands], [100 * band[1] for band in bands]
    if axis.to_scale:
        axes.fill_between(places, low, high, color=ACCENT, alpha=0.25, linewidth=0)
        axes.plot(places, shares, "-", color=ACCENT, linewidth=1.6)
    else:
        axes.vlines(places, low, high, color=ACCENT, linewidth=3, alpha=0.35)
    for place, share, (value, tally) in zip(places, shares, judged, strict=True):
        (point,) = axes.plot([place], [share], "o", color=ACCENT, markersize=3.2 if narrow else 4)
        set_tip(point, success_tip(series.parameter, value, tally))
    axes.plot([], [], "o-", color=ACCENT, label=f"{simulation}, 95 % band")
    draw_trials(axes, axis, series.parameter, 0.0, built, simulated)
    advised = [one for one in recommended if one.parameter == series.parameter and one.value in axis.values]
    for one in advised:
        place = axis.place(one.value)
        axes.axvline(place, color=ADVISED, linewidth=1.4, linestyle="--", zorder=1)
        (mark,) = axes.plot([place], [106], "v", color=ADVISED, markeredgecolor=INK, markersize=9, clip_on=False)
        set_tip(mark, f"build {one.label}: {one.why}")
    title = f"Feasible region: {simulation}, trials, what to build"
    finish_success(axes, axis, series.parameter, title, thresholds, narrow)
    axes.set_ylim(0, 112 if advised else 103)
    axes.set_yticks(range(0, 101, 25))
    handles = [*axes.get_legend_handles_labels()[0], Patch(color=REGION, label=f"above {100 * max(thresholds):g} %")]
    if advised:
        (shown,) = axes.plot([], [], "v", color=ADVISED, markeredgecolor=INK, label="advised to build")
        handles.append(shown)
    figure.legend(handles=handles, loc="outside lower center", ncols=legend_columns(narrow, 4))
    return figure
