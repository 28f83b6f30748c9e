"""Draws success against one parameter, a panel for each value of another: intervals, and the smooth model."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from foldcar.figures.style import ACCENT, INK
from foldcar.report.axis import interval_text, parameter_label, value_text
from foldcar.report.design_table import Count, assigned, every, mean_interval, spread
from foldcar.report.figure_size import NARROW_IN, WIDE_IN, legend_columns
from foldcar.report.map_plan import Panel
from foldcar.report.tips import set_tip

MOST_SLICES = 6
COLUMNS = {False: 3, True: 2}
FINE = 121
DESIGNS = "#e69f00"


@dataclass(frozen=True)
class Slices:
    """Success against ``along``, one of the axes of ``panel``, at values of the other one if there is one.

    ``overall`` holds the designs by the value along the axis for a first panel with all of them; empty for none.
    """

    panel: Panel
    along: str
    overall: dict[float, list[Count]] = field(default_factory=dict)

    @property
    def fixed(self) -> str | None:
        """The axis that is fixed in each panel."""
        return self.panel.y if self.along == self.panel.x else self.panel.x

    @property
    def values(self) -> list[float | None]:
        """The values of the fixed axis that are shown, a panel each; None for the only panel without such an axis."""
        if self.fixed is None:
            return [None]
        return [*spread(self.panel.table.values(self.fixed), MOST_SLICES - bool(self.overall))]


def draw_slices(slices: Slices, thresholds: Sequence[float], narrow: bool = False) -> Figure:
    """The panels, with the same axes."""
    values = slices.values
    count = len(values) + bool(slices.overall)
    columns = min(COLUMNS[narrow], count)
    rows = -(-count // columns)
    figure = Figure(
        figsize=(NARROW_IN if narrow else WIDE_IN, 0.9 + rows * (1.75 if narrow else 1.95)), layout="constrained"
    )
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    panels = list(grid.flat)
    if slices.overall:
        _draw_overall(panels[0], slices)
    for value, axes in zip(values, panels[bool(slices.overall) :], strict=False):
        _draw_slice(axes, slices, value)
    for axes in panels[:count]:
        for threshold in thresholds:
            axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
        axes.set_ylim(-3, 103)
        axes.set_yticks(range(0, 101, 25))
        axes.title.set_fontsize(8.5)
    _ticks(panels[0], slices.panel.table.values(slices.along), 3.0 if narrow else 5.8, columns)
    for axes in panels[count:]:
        axes.set_visible(False)
    # The lowest of each column: the last row may be incomplete.
    for axes in panels[:count][-columns:]:
        axes.set_xlabel(parameter_label(slices.along))
        axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel("passed (%)")
    figure.legend(handles=_legend(slices), loc="outside lower center", ncols=legend_columns(narrow, 4))
    return figure


def _ticks(axes: Axes, values: Sequence[float], width_in: float, columns: int) -> None:
    shown = every(values, max(2, int(width_in / columns / 0.42)))
    axes.set_xticks(shown, [value_text(value) for value in shown])
    margin = 0.06 * (values[-1] - values[0]) or 1.0
    axes.set_xlim(values[0] - margin, values[-1] + margin)


def _draw_slice(axes: Axes, slices: Slices, value: float | None) -> None:
    panel = slices.panel
    fixed = {} if slices.fixed is None or value is None else {slices.fixed: value}
    cells = panel.table.where(fixed).cells
    counts = {along: cells[(along,)] for (along,) in sorted(cells)}
    _draw_counts(axes, slices, counts)
    if panel.model is not None:
        at = 0 if slices.along == panel.x else 1
        # Between the designs that were simulated: beyond, the model has nothing to go by.
        line = numpy.linspace(min(counts), max(counts), FINE)
        points = line[:, None] if value is None else numpy.insert(line[:, None], 1 - at, value, axis=1)
        rate, low, high = panel.model.rates(points)
        axes.fill_between(line, 100 * low, 100 * high, color=ACCENT, alpha=0.22, linewidth=0)
        axes.plot(line, 100 * rate, color=ACCENT, linewidth=1.4)
    axes.set_title(", ".join(assigned(name, one) for name, one in fixed.items()))


def _draw_counts(axes: Axes, slices: Slices, counts: dict[float, Count]) -> None:
    single = slices.panel.table.single
    bars = _bars([count.success for count in counts.values()], [count.interval for count in counts.values()])
    axes.errorbar(
        list(counts),
        [100 * count.success for count in counts.values()],
        yerr=None if single else bars,
        fmt="o:" if single else "o",
        color=INK,
        linewidth=0.8,
        markersize=3.2,
        elinewidth=0.9,
        capsize=0,
        zorder=3,
    )
    for along, count in counts.items():
        # Only the tip: a larger invisible point over each point.
        (point,) = axes.plot([along], [100 * count.success], "o", markersize=9, alpha=0.0)
        text = f"{count.passed} of {count.runs} runs passed, 95 % interval {interval_text(count.interval)} %"
        set_tip(point, f"{assigned(slices.along, along)}: {text}")


def _draw_overall(axes: Axes, slices: Slices) -> None:
    along = sorted(slices.overall)
    shares = [[count.success for count in slices.overall[value]] for value in along]
    means = [float(numpy.mean(each)) for each in shares]
    lowest, highest = [100 * min(each) for each in shares], [100 * max(each) for each in shares]
    axes.fill_between(along, lowest, highest, color=DESIGNS, alpha=0.3, linewidth=0)
    axes.plot(along, [100 * mean for mean in means], color=INK, linewidth=1.2)
    bars = _bars(means, [mean_interval(slices.overall[value]) for value in along])
    shown = None if slices.panel.table.single else bars
    axes.errorbar(
        along, [100 * mean for mean in means], yerr=shown, fmt="s", color=INK, markersize=3.6, elinewidth=0.9, zorder=3
    )
    most = max(len(each) for each in shares)
    axes.set_title(f"mean of {most} designs")


def _bars(shares: Sequence[float], intervals: Sequence[tuple[float, float]]) -> list[list[float]]:
    """Distances down and up to the ends of the intervals (percentage points); rounding must not make one negative."""
    pairs = list(zip(shares, intervals, strict=True))
    return [
        [max(0.0, 100 * (share - low)) for share, (low, _) in pairs],
        [max(0.0, 100 * (high - share)) for share, (_, high) in pairs],
    ]


def _legend(slices: Slices) -> list[Line2D | Patch]:
    label = "single runs" if slices.panel.table.single else "runs, 95 % interval"
    handles: list[Line2D | Patch] = [Line2D([], [], color=INK, marker="o", markersize=4, label=label)]
    if slices.panel.model is not None:
        handles.append(Line2D([], [], color=ACCENT, linewidth=1.4, label="smooth model"))
        handles.append(Patch(color=ACCENT, alpha=0.22, label="its 95 % band"))
    if slices.overall:
        handles.append(Patch(color=DESIGNS, alpha=0.3, label="worst to best design"))
    return handles
