"""A cross-check's files: a page with its pictures, the runs as CSV, the numbers as JSON.

Input: a store into which all engines were swept. Output: index.html, success_N.png of the Nth experiment, runs.csv,
summary.json.
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy
from matplotlib.figure import Figure

from foldcar.analysis.rate import wilson_interval
from foldcar.figures.output import save_figure
from foldcar.figures.page import page_template
from foldcar.figures.style import ACCENT, OUTCOME_LABELS, RC
from foldcar.outputs import atomic_file
from foldcar.report.crosscheck_agreement import (
    COMPARISON_HEAD,
    Agreement,
    Case,
    DesignRates,
    Results,
    column_name,
    comparison_numbers,
    comparison_row,
    comparisons,
    read_cases,
)
from foldcar.report.paper_figures import axis_label, error_percent
from foldcar.shown_text import decoded
from foldcar.simulation.results import NUMBERS as METRICS
from foldcar.simulation.results import OUTCOMES
from foldcar.store.reader import Store

PAGE, RUNS, NUMBERS = "index.html", "runs.csv", "summary.json"
COLOURS = 256
FIRST, SECOND = "multibody", "MuJoCo"
LOOKS = ((FIRST, ACCENT, "o", "-"), (SECOND, "#d55e00", "s", "--"))


def write_page(
    folder: Path, title: str, store: Store, experiments: Sequence[str], engines: Sequence[str], baseline: int
) -> dict[str, Agreement]:
    """Write all files; returns the comparisons of the page's first table by their names. FoldcarError.

    ``store`` holds the listed ``experiments`` in the ``engines``.
    """
    cases, results = read_cases(store, experiments, engines)
    whole = comparisons(cases, results, baseline)
    by_experiment = {name: comparisons(*_of(name, cases, results), baseline) for name in experiments}
    sections = [_section(folder, at, name, found) for at, (name, found) in enumerate(by_experiment.items(), start=1)]
    rows = [comparison_row(name, next(iter(found.values()))) for name, found in by_experiment.items()]
    page = page_template("foldcar.report", "crosscheck.html").render(
        title=title,
        comparisons=_table(whole),
        by_experiment=[["experiment", *COMPARISON_HEAD[1:]], *rows] if len(rows) > 1 else [],
        confusion=_confusion(next(iter(whole.values()))),
        sections=sections,
    )
    _write(folder / PAGE, page)
    _write(folder / RUNS, _runs_csv(cases, results))
    numbers = {
        "comparisons": _numbers(whole),
        "by_experiment": {name: _numbers(found) for name, found in by_experiment.items()},
    }
    _write(folder / NUMBERS, json.dumps(numbers, indent=2, ensure_ascii=False) + "\n")
    return whole


def _of(experiment: str, cases: Sequence[Case], results: Results) -> tuple[list[Case], Results]:
    kept = [at for at, case in enumerate(cases) if case.experiment == experiment]
    return [cases[at] for at in kept], {engine: [some[at] for at in kept] for engine, some in results.items()}


def _table(found: Mapping[str, Agreement]) -> list[list[str]]:
    return [COMPARISON_HEAD, *(comparison_row(name, one) for name, one in found.items())]


def _numbers(found: Mapping[str, Agreement]) -> dict[str, Mapping[str, Any]]:
    return {name: comparison_numbers(one) for name, one in found.items()}


def _confusion(one: Agreement) -> list[list[str]]:
    seen = {outcome for pair in one.confusion for outcome in pair}
    names = [outcome for outcome in OUTCOMES if outcome in seen]
    rows = [[OUTCOME_LABELS[a], *(str(one.confusion.get((a, b), 0)) for b in names)] for a in names]
    return [["", *(OUTCOME_LABELS[name] for name in names)], *rows]


def _section(folder: Path, number: int, name: str, found: Mapping[str, Agreement]) -> dict[str, Any]:
    """An experiment's part of the page; its picture is written."""
    chart, designs = f"success_{number}.png", list(next(iter(found.values())).designs.values())
    keys = [key for key in designs[0].columns if len({d.columns[key] for d in designs}) > 1]
    with matplotlib.rc_context(RC):
        save_figure(_success_figure(designs, keys, name), folder / chart, colours=COLOURS)
    rows = [
        [*(f"{d.columns[key]:g}" for key in keys), str(d.runs), *(f"{100 * n / d.runs:.1f}" for n in (d.first, d.second))]
        for d in designs
    ]
    head = [*keys, "runs", "multibody passed %", "MuJoCo passed %"]
    return {"name": name, "comparison": _table(found), "chart": chart, "designs": [head, *rows]}


def _success_figure(designs: Sequence[DesignRates], keys: Sequence[str], experiment: str) -> Figure:
    """Success rates of an experiment's designs in both engines, with Wilson 95 % intervals."""
    figure = Figure(figsize=(7.2, 3.7), layout="constrained")
    axes = figure.subplots()
    # Designs of a family with several parameters are numbered.
    places = [one.columns[keys[0]] for one in designs] if len(keys) == 1 else list(range(1, len(designs) + 1))
    nudge = 0.12 * float(numpy.min(numpy.diff(places))) if len(places) > 1 else 0.05
    for side, (name, colour, marker, line) in zip((-1, 1), LOOKS, strict=True):
        counts = [(rates.first if name == FIRST else rates.second, rates.runs) for rates in designs]
        bars = numpy.hstack([error_percent(n / runs, wilson_interval(n, runs)) for n, runs in counts])
        look: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": line, "markersize": 4, "linewidth": 1.3}
        x, y = numpy.array(places) + side * nudge, [100 * n / runs for n, runs in counts]
        axes.errorbar(x, y, yerr=bars, elinewidth=0.9, capsize=2, label=name, **look)
    axes.set_ylim(-3, 103)
    axes.set_ylabel("runs passed (%)")
    axes.set_xlabel(axis_label(keys[0]) if len(keys) == 1 else "design")
    axes.set_title(f"Experiment {experiment}: success in both engines, Wilson 95 % intervals")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _runs_csv(cases: Sequence[Case], results: Results) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    parameters = list(dict.fromkeys(key for case in cases for key in case.columns))
    values = ("outcome", *METRICS)
    answers = (f"{column_name(engine)}_{value}" for engine in results for value in values)
    writer.writerow(["experiment", "design", "sample", *parameters, *answers])
    for index, case in enumerate(cases):
        row = [case.experiment, case.design + 1, case.sample, *(case.columns.get(key) for key in parameters)]
        for engine in results:
            result = results[engine][index] or {}
            row += [result.get(value) for value in values]
        writer.writerow(row)
    return text.getvalue()


def _write(file: Path, text: str) -> None:
    with atomic_file(file) as binary:
        binary.write(decoded(text).encode())
