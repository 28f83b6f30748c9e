"""The figure for papers of experiments that differ in one number of their environment: success over that number."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy
from matplotlib.figure import Figure

from foldcar.analysis.rate import mean_interval
from foldcar.figures.style import ACCENT, INK
from foldcar.report.environment_groups import EnvironmentGroup, environment_groups
from foldcar.report.file_names import file_name_part
from foldcar.report.page_designs import Designs
from foldcar.report.paper_figures import Drawing
from foldcar.report.parameter_plots import HEIGHT_IN, WIDE_IN, axis_label, error_percent

# Designs with a line each.
MOST_LINES = 8


def across_drawings(experiments: Mapping[str, Designs], thresholds: Sequence[float]) -> Iterator[Drawing]:
    """A drawing for each parameter of the environment in which experiments differ, of those with runs, by their ids."""
    for number, group in enumerate(environment_groups(one.info for one in experiments.values()), 1):
        rates = across_rates(group, experiments)
        if rates:
            said = f"Success over {axis_label(group.parameter)} of the environment. {' '.join(group.remarks)}".strip()
            name = f"across_{number}_{file_name_part(group.parameter)}_success"
            yield Drawing(name, said, partial(_draw, group, rates, thresholds))


def across_rates(group: EnvironmentGroup, experiments: Mapping[str, Designs]) -> dict[str, list[tuple[int, int]]]:
    """Passed and all runs, by the group's values, of the designs that have runs at every one: the same for each value."""
    found: dict[str, list[tuple[int, int]]] = {}
    tables = [experiments[info.id] for info in group.experiments.values()]
    for table in tables:
        for name, (passed, runs) in zip(table.names, table.counted.tolist(), strict=True):
            if runs:
                found.setdefault(name, []).append((passed, runs))
    return {name: counts for name, counts in found.items() if len(counts) == len(tables)}


def _draw(group: EnvironmentGroup, rates: Mapping[str, list[tuple[int, int]]], thresholds: Sequence[float]) -> Figure:
    figure = Figure(figsize=(WIDE_IN, HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    x, names = list(group.experiments), list(rates)
    shares = numpy.array([[passed / runs for passed, runs in counts] for counts in rates.values()])
    for at in numpy.unique(numpy.linspace(0, len(names) - 1, MOST_LINES).round().astype(int)) if names[1:] else ():
        axes.plot(x, 100 * shares[at], linewidth=0.9, color=INK, alpha=0.25 + 0.6 * at / len(names), label=names[at])
    stopped = any(info.until is not None for info in group.experiments.values())
    counts = [list(zip(*column, strict=True)) for column in zip(*rates.values(), strict=True)]
    ends = [mean_interval(passed, runs, stopped) for passed, runs in counts]
    means = shares.mean(axis=0)
    bars = numpy.hstack([error_percent(mean, one) for mean, one in zip(means, ends, strict=True)])
    what = "the design" if len(names) == 1 else f"mean of {len(names)} designs"
    axes.errorbar(x, 100 * means, yerr=bars, fmt="o-", color=ACCENT, capsize=3, label=f"{what}, 95 % interval")
    for threshold in thresholds:
        axes.axhline(100 * threshold, color=INK, linewidth=0.7, linestyle=":")
    axes.set_ylim(0, 103)
    axes.set_ylabel("passed (%)")
    axes.set_xlabel(axis_label(group.parameter))
    axes.set_title(f"Success over {axis_label(group.parameter)} of the environment")
    figure.legend(loc="outside lower center", ncols=2, fontsize=7)
    return figure
