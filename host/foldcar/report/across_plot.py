"""The figure for papers of experiments that differ in one number of their environment: success over that number."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy
from matplotlib.figure import Figure

from foldcar.analysis.rate import mean_interval
from foldcar.figures.style import ACCENT, INK
from foldcar.report.page_designs import Designs
from foldcar.report.paper_figures import Drawing, file_name_part
from foldcar.report.parameter_plots import HEIGHT_IN, WIDE_IN, axis_label, error_percent
from foldcar.store.info import ExperimentInfo

# Designs with a line each.
MOST_LINES = 8
# What may differ between experiments of one group, or differs with the number of their runs.
FREE = {
    "id", "vehicle", "environment", "scenic_params", "environments", "planned_runs", "stored_runs", "thresholds", "until",
    "designs", "decided", "skipped", "calibration", "listed_environment", "unlike_sides",
}  # fmt: skip


@dataclass(frozen=True)
class EnvironmentGroup:
    """Experiments with stored runs by their value of ``parameter``, ascending; ``remarks`` say which were left out."""

    parameter: str
    others: Mapping[str, Any]
    experiments: Mapping[float, ExperimentInfo]
    remarks: tuple[str, ...]


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


def environment_groups(infos: Iterable[ExperimentInfo]) -> list[EnvironmentGroup]:
    """The groups of at least two values, in the order in which their first experiments stand.

    Experiments of a group have the same cars, program, seed, settings and calibration; the numbers of samples may differ.
    """
    with_success = [info for info in infos if info.success_defined]
    found: dict[tuple[str, str], list[ExperimentInfo]] = {}
    for info in with_success:
        for name, value in info.scenic_params.items():
            if _number(value):
                found.setdefault((name, _rest(info, name)), []).append(info)
    groups = []
    for (name, rest), members in found.items():
        by_value: dict[float, ExperimentInfo] = {}
        # Of experiments that are alike, the one with most runs.
        for info in sorted(members, key=lambda one: -one.stored_runs):
            if info.stored_runs:
                by_value.setdefault(float(info.scenic_params[name]), info)
        if len(by_value) < 2:
            continue
        unset = [one for one in with_success if name not in one.scenic_params and _rest(one, name) == rest]
        others = {key: value for key, value in members[0].scenic_params.items() if key != name}
        kept = dict(sorted(by_value.items()))
        groups.append(EnvironmentGroup(name, others, kept, tuple(_remarks(name, members, kept, unset))))
    return groups


def _remarks(
    name: str, members: list[ExperimentInfo], kept: Mapping[float, ExperimentInfo], unset: list[ExperimentInfo]
) -> list[str]:
    said = list(dict.fromkeys(info.warning for info in kept.values() if info.warning))
    for info in members:
        if info in kept.values():
            continue
        instead = kept.get(float(info.scenic_params[name]))
        why = "has no runs yet" if instead is None else f"has the same environment as {instead.id}, which has more runs"
        said.append(f"Experiment {info.id} {why}; it is not drawn.")
    said += [
        f"Experiment {info.id} does not set {name}: the program's own value is not in the store; it is not drawn."
        for info in unset
    ]
    return said


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rest(info: ExperimentInfo, name: str) -> str:
    """All by which an experiment must be like another one, but the parameter ``name``, as a text to compare."""
    facts = {field.name: getattr(info, field.name) for field in fields(info) if field.name not in FREE}
    calibration = None if info.calibration is None else info.calibration["fingerprint"]
    others = {key: value for key, value in info.scenic_params.items() if key != name}
    return repr([sorted(facts.items()), calibration, sorted(others.items())])
