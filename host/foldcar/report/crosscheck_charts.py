"""The pictures of a cross-check: success by design in both engines, and the worst disagreements."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from foldcar.analysis.rate import wilson_interval
from foldcar.figures.ground import height_map
from foldcar.figures.height_colours import height_scale
from foldcar.figures.profile import travelled_m
from foldcar.figures.style import ACCENT, INK, OUTCOME_LABELS
from foldcar.figures.top_view import draw_top_view, view_of
from foldcar.report.crosscheck_agreement import Agreement, DesignRates
from foldcar.report.crosscheck_parted import Parted
from foldcar.report.parameter_plots import axis_label, error_percent
from foldcar.simulation.heights import Heights

FIRST, SECOND = "multibody", "MuJoCo"
LOOKS = ((FIRST, ACCENT, "o", "-"), (SECOND, "#d55e00", "s", "--"))
CELLS = 300
# Designs of a family with several parameters are numbered; beyond these no number is legible.
MOST_TICKS = 20


def success_figure(result: Agreement, experiment: str) -> Figure:
    """Success rates of the experiment's designs in both engines, with Wilson 95 % intervals."""
    designs = [rates for (name, _), rates in result.designs.items() if name == experiment]
    figure = Figure(figsize=(7.2, 3.7), layout="constrained")
    axes = figure.subplots()
    places, label = _places(designs)
    nudge = 0.12 * float(numpy.min(numpy.diff(places))) if len(places) > 1 else 0.05
    for side, (name, colour, marker, line) in zip((-1, 1), LOOKS, strict=True):
        counts = [(rates.first if name == FIRST else rates.second, rates.runs) for rates in designs]
        bars = numpy.hstack([error_percent(n / runs, wilson_interval(n, runs)) for n, runs in counts])
        look: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": line, "markersize": 4, "linewidth": 1.3}
        x, y = numpy.array(places) + side * nudge, [100 * n / runs for n, runs in counts]
        axes.errorbar(x, y, yerr=bars, elinewidth=0.9, capsize=2, label=name, **look)
    axes.set_ylim(-3, 103)
    axes.set_ylabel("runs passed (%)")
    axes.set_xlabel(label)
    if label == "design" and len(places) <= MOST_TICKS:
        axes.set_xticks(places)
    axes.set_title(f"Experiment {experiment}: success in both engines, Wilson 95 % intervals")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def worst_figure(pairs: Sequence[Parted], heights: Heights) -> Figure:
    """Each pair from above and in height and roll over the distance driven."""
    figure = Figure(figsize=(10.0, 3.1 * len(pairs)), layout="constrained")
    parts = figure.subfigures(len(pairs), 1, squeeze=False)
    for part, pair in zip(parts[:, 0], pairs, strict=True):
        case, first, second = pair.case, pair.first, pair.second
        above, right = part.subfigures(1, 2, width_ratios=(1.25, 1))
        left, (height, roll) = above.subplots(), right.subplots(2, 1, sharex=True)
        parameters = ", ".join(f"{axis_label(key)} {value:g}" for key, value in _shown(case.columns, pairs))
        title = f"{case.label}{': ' if parameters else ''}{parameters}"
        part.suptitle(title, x=0.01, ha="left", fontsize=9, weight="bold")
        paths = [numpy.asarray(result["path"], dtype=float) for result in (first, second)]
        ground = height_map(heights, pair.scene, view_of([pair.scene], numpy.concatenate(paths)), CELLS)
        draw_top_view(left, pair.scene, ground, height_scale([ground]))
        for (name, colour, marker, line), result, rows in zip(LOOKS, (first, second), paths, strict=True):
            ending = f"{OUTCOME_LABELS[result['outcome']]}, {result['elapsed_time_s']:.1f} s"
            look = {"color": colour, "linestyle": line, "linewidth": 1.5}
            left.plot(rows[:, 1], rows[:, 2], zorder=5, label=f"{name}: {ending}", **look)
            left.plot(rows[-1:, 1], rows[-1:, 2], marker, color=colour, markersize=5, zorder=6)
            _draw_over_distance(height, roll, rows, look)
        handles, labels = left.get_legend_handles_labels()
        wanted = [i for i, text in enumerate(labels) if ": " in text]
        above.legend([handles[i] for i in wanted], [labels[i] for i in wanted], loc="outside lower center", ncols=2)
    return figure


def _draw_over_distance(height: Axes, roll: Axes, rows: Any, look: Mapping[str, Any]) -> None:
    driven = travelled_m(rows)
    height.plot(driven, rows[:, 3] * 1e3, **look)
    roll.plot(driven, numpy.degrees(rows[:, 6]), **look)
    height.set_ylabel("height (mm)")
    roll.set_ylabel("roll (°)")
    roll.set_xlabel("distance driven (m)")
    roll.axhline(0, color=INK, linewidth=0.6)


def _places(designs: Sequence[DesignRates]) -> tuple[list[float], str]:
    """Where the designs stand on the axis, and its label: the one varied parameter, else their number."""
    varied = [key for key in designs[0].columns if len({rates.columns[key] for rates in designs}) > 1]
    if len(varied) == 1:
        return [rates.columns[varied[0]] for rates in designs], axis_label(varied[0])
    return [float(number + 1) for number in range(len(designs))], "design"


def _shown(columns: Mapping[str, float], pairs: Sequence[Parted]) -> list[tuple[str, float]]:
    """The parameters in which the drawn designs differ; of alike ones the width, if they have one."""
    varied = [key for key in columns if len({pair.case.columns.get(key) for pair in pairs}) > 1]
    return [(key, columns[key]) for key in varied or ["width_mm"] if key in columns]
