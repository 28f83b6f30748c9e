"""The report's part on the number of environments: how the rates settled as they were added, and whether more would help.

Input: an experiment's runs. Output: a part with the designs nearest to the threshold in a figure, and the advice.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from textwrap import fill
from typing import Any

import numpy
from matplotlib.figure import Figure

from foldcar.analysis.rate import jeffreys_interval
from foldcar.analysis.stopping import Convergence, advice, convergence
from foldcar.analysis.words import count, design_text, listed
from foldcar.figures.style import ACCENT, INK
from foldcar.report.advice_slots import Drawing, Part
from foldcar.report.figure_options import FigureOptions
from foldcar.report.figure_size import NARROW_TITLE, fitting_columns, set_title, sized_figure
from foldcar.report.file_names import file_name_part
from foldcar.simulation.results import OUTCOMES
from foldcar.store.frames import run_arrays
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store

# Curves of one figure, and their colours; more designs than that are named in a sentence.
COLOURS = (ACCENT, "#d55e00", "#009e73")
NAMED = 6
# Fewer environments than this give no picture.
LEAST = 10
# Points of a curve.
MOST_POINTS = 200
# Designs further than this from the threshold, in standard deviations, are decided.
FAR = 5.0


def settling_parts(store: Store, info: ExperimentInfo, options: FigureOptions) -> list[Part]:
    """The part of an experiment; none without success, and after a sweep or search that chose its number of runs."""
    if not info.success_defined or info.until is not None or info.searched or not info.stored_runs:
        return []
    runs = run_arrays(store, info.id).counted
    passed = runs.outcome == OUTCOMES.index("passed")
    designs = list(store.designs(info.id).values())
    labels = [design_text({name: design[name] for name in info.varied}) for design in designs]
    total = numpy.bincount(runs.design, minlength=len(designs))
    successes = numpy.bincount(runs.design, passed, minlength=len(designs)).astype(int)
    threshold = max(options.thresholds(info))
    if numpy.max(total) < LEAST:
        return []
    shares = numpy.divide(successes, total, out=numpy.full(len(designs), numpy.inf), where=total > 0)
    nearest = numpy.argsort(numpy.abs(shares - threshold), kind="stable")
    drawn = sorted(int(at) for at in nearest[: len(COLOURS)] if total[at])
    curves = {labels[at]: convergence(passed[runs.design == at]) for at in drawn}
    remark = settling_text(labels, successes, total, threshold)
    near = f" of the designs nearest to {100 * threshold:g} %" if len(labels) > 1 else ""
    caption = (
        f"Success{near} as environments were added, with Jeffreys 95 % intervals; each holds at its number of "
        "environments, not at all of them together."
    )
    name = f"experiment_{file_name_part(info.id)}_environments"
    drawing = Drawing(name, caption, partial(draw_settling, curves, threshold), "settling")
    return [Part("Enough environments?", (remark,), (drawing,))]


def settling_text(labels: Sequence[str], successes: Any, total: Any, threshold: float) -> str:
    """Which designs are not decided against the threshold, and what more environments would do."""
    counted = [at for at in range(len(labels)) if total[at]]
    rates = {at: successes[at] / total[at] for at in counted}
    spread = {at: FAR * (threshold * (1 - threshold) / total[at]) ** 0.5 + 1 / total[at] for at in counted}
    close = [at for at in counted if abs(rates[at] - threshold) <= spread[at]]
    nearest = min(counted, key=lambda at: abs(rates[at] - threshold))
    if len(counted) == 1:
        return advice(int(successes[nearest]), int(total[nearest]), threshold)
    undecided = []
    for at in close:
        low, high = jeffreys_interval(int(successes[at]), int(total[at]))
        if low <= threshold <= high:
            undecided.append(at)
    limit = f"{100 * threshold:g} %"
    if not undecided:
        return (
            f"No design's 95 % interval holds {limit}: more environments would hardly change which of the "
            f"{count(len(counted), 'design')} reach it."
        )
    undecided.sort(key=lambda at: abs(rates[at] - threshold))
    first = undecided[0]
    shown = [labels[at] for at in sorted(undecided[:NAMED])]
    names = "; ".join(shown) if "," in shown[0] else listed(shown)
    more = f"; and {count(len(undecided) - NAMED, 'other')}" if len(undecided) > NAMED else ""
    verb = "is" if len(undecided) == 1 else "are"
    said = advice(int(successes[first]), int(total[first]), threshold)
    return (
        f"{len(undecided)} of {count(len(counted), 'design')} {verb} not decided against {limit} ({names}{more}). "
        f"Nearest to it, {labels[first]}: {said} More environments would hardly move the decided ones across."
    )


def draw_settling(curves: Mapping[str, Convergence], threshold: float, narrow: bool = False) -> Figure:
    """The rates (%) of designs by the number of environments, each with the band of its intervals."""
    figure = sized_figure(narrow, 3.2)
    axes = figure.subplots()
    for colour, (name, curve) in zip(COLOURS, curves.items(), strict=False):
        label = fill(name, NARROW_TITLE) if narrow else name
        at = numpy.unique(numpy.linspace(0, len(curve.rates) - 1, MOST_POINTS).round().astype(int))
        environments = curve.environments[at]
        axes.fill_between(environments, 100 * curve.low[at], 100 * curve.high[at], color=colour, alpha=0.15, linewidth=0)
        axes.plot(environments, 100 * curve.rates[at], color=colour, linewidth=1.6, label=label)
    axes.axhline(100 * threshold, color=INK, linewidth=0.8, linestyle=":")
    axes.set_ylim(0, 103)
    axes.set_xlim(left=1)
    axes.set_xlabel("environments")
    axes.set_ylabel("passed (%)")
    set_title(axes, "Success as environments were added", narrow)
    figure.legend(loc="outside lower center", ncols=fitting_columns(curves, narrow))
    return figure
