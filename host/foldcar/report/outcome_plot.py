"""Draws the shares of the runs' outcomes by a design parameter, stacked."""

from matplotlib.figure import Figure

from foldcar.figures.style import OUTCOME_COLOURS, OUTCOME_LABELS
from foldcar.report.axis import ParameterAxis, parameter_label, value_text
from foldcar.report.figure_size import legend_columns, set_title, sized_figure
from foldcar.report.series import Series
from foldcar.report.tips import set_tip
from foldcar.simulation.results import OUTCOMES


def draw_outcomes(series: Series, narrow: bool = False) -> Figure:
    """Stacked bars of the share of each outcome (%), one bar per value of the parameter."""
    axis = ParameterAxis(list(series.tallies))
    figure = sized_figure(narrow)
    axes = figure.subplots()
    places = [axis.place(value) for value in series.tallies]
    bottom = [0.0] * len(places)
    for outcome in _seen(series):
        shares = [100 * tally.outcomes[outcome] / tally.runs for tally in series.tallies.values()]
        bars = axes.bar(
            places,
            shares,
            width=axis.bar_width,
            bottom=bottom,
            color=OUTCOME_COLOURS[outcome],
            edgecolor="white",
            linewidth=0.3,
            label=OUTCOME_LABELS[outcome],
        )
        for bar, (value, tally) in zip(bars, series.tallies.items(), strict=True):
            count = f"{tally.outcomes[outcome]} of {tally.runs}"
            set_tip(bar, f"{parameter_label(series.parameter)} {value_text(value)}: {OUTCOME_LABELS[outcome]} {count}")
        bottom = [low + share for low, share in zip(bottom, shares, strict=True)]
    axes.set_ylim(0, 100)
    axes.set_ylabel("share of runs (%)")
    set_title(axes, "How the runs ended", narrow)
    axes.grid(axis="x", visible=False)
    axis.label(axes, series.parameter)
    figure.legend(loc="outside lower center", ncols=legend_columns(narrow, 6))
    return figure


def _seen(series: Series) -> list[str]:
    seen = {outcome for tally in series.tallies.values() for outcome in tally.seen}
    return [outcome for outcome in OUTCOMES if outcome in seen]
