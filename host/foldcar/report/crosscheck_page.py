"""A cross-check's files: a page with its pictures, the runs as CSV, the numbers as JSON.

Input: a store into which all engines were swept. Output: index.html, success_N.png and worst_N.png of the Nth
experiment, runs.csv, summary.json.
"""

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

from foldcar.figures.output import save_figure
from foldcar.figures.page import page_template
from foldcar.figures.style import OUTCOME_LABELS, RC
from foldcar.outputs import atomic_file
from foldcar.report.crosscheck_agreement import Agreement, Case, Pair, Results, agreement, read_cases
from foldcar.report.crosscheck_charts import success_figure, worst_figure
from foldcar.report.crosscheck_parted import CANDIDATES, Parted, parted
from foldcar.report.crosscheck_sweeps import BASELINE
from foldcar.shown_text import decoded
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ELLIPSOID, HALF_STEP, MUJOCO, MULTIBODY, SIDE_VIEW
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.results import NUMBERS as METRICS
from foldcar.simulation.results import OUTCOMES
from foldcar.store.reader import Store

PAGE, RUNS, NUMBERS = "index.html", "runs.csv", "summary.json"
WORST = 3
MOST_FAILURES = 10
COLOURS = 256
NAMES = {
    SIDE_VIEW: "side-view",
    MULTIBODY: "multibody",
    MUJOCO: "MuJoCo",
    HALF_STEP: "MuJoCo, half the time step",
    ELLIPSOID: "MuJoCo, ellipsoid tyres",
}
BOTH = f"{NAMES[MULTIBODY]} – {NAMES[MUJOCO]}"
COMPARISON_HEAD = ["engines", "runs", "alike %", "95 % interval", "r of rates", "RMSE", "bias"]
EXPERIMENT_HEAD = ["experiment", "runs", "multibody passed %", "MuJoCo passed %", *COMPARISON_HEAD[2:]]
SIDE_VIEW_HEAD = ["side-view passed %", "side-view alike %", "side-view RMSE"]
BASELINE_HEAD = ["half step alike %", "ellipsoid alike %"]
NOT_CLAIMED = "–"


def pairs_of(cases: Sequence[Case], results: Results, first: str, second: str, samples: int) -> list[Pair]:
    """Results of two engines for the cases of the first ``samples`` samples that both have run."""
    return [
        (case, a, b)
        for case, a, b in zip(cases, results[first], results[second], strict=True)
        if case.sample < samples and a is not None and b is not None
    ]


def write_page(
    folder: Path,
    title: str,
    store: Store,
    experiments: Sequence[str],
    baseline: int,
    carsims: Mapping[str, Carsim],
    jobs: int,
    done: Callable[[int], None] = lambda experiments: None,
) -> list[tuple[str, Agreement]]:
    """Write all files; returns the comparisons of the page's first table with their names. FoldcarError.

    ``store`` holds the listed ``experiments`` in the engines of ``carsims``; ``done`` hears of each one's pictures.
    """
    cases, results = read_cases(store, experiments, carsims)
    everything = max(case.sample for case in cases) + 1
    pairs = pairs_of(cases, results, MULTIBODY, MUJOCO, everything)
    whole = agreement(pairs)
    comparisons = [(BOTH, whole)]
    in_plane = pairs_of(cases, results, SIDE_VIEW, MUJOCO, everything)
    if in_plane:
        comparisons.append((f"{NAMES[SIDE_VIEW]} – {NAMES[MUJOCO]}", agreement(in_plane)))
    few = min(baseline, everything)
    if few:
        for engine in (MULTIBODY, *BASELINE):
            name = f"{NAMES[engine]} – {NAMES[MUJOCO]}, samples 0 to {few - 1}"
            comparisons.append((name, agreement(pairs_of(cases, results, engine, MUJOCO, few))))
    selves = [pairs_of(cases, results, engine, MUJOCO, few) for engine in BASELINE if few]
    by_experiment = {name: [agreement(_of(name, some)) for some in (pairs, *selves)] for name in experiments}
    side_view = {name: agreement(some) for name in experiments if (some := _of(name, in_plane))}
    sections = []
    for number, (name, (one, *_)) in enumerate(by_experiment.items(), start=1):
        both = {engine: carsims[engine] for engine in (MULTIBODY, MUJOCO)}
        worst = parted(store, _of(name, pairs), both, jobs, WORST)
        with matplotlib.rc_context(RC):
            sections.append(_section(folder, number, name, one, worst, carsims[MULTIBODY]))
        done(1)
    page = page_template("foldcar.report", "crosscheck.html").render(
        title=title,
        comparisons=[COMPARISON_HEAD, *(comparison_row(name, one) for name, one in comparisons)],
        by_experiment=experiment_table(by_experiment, side_view) if len(experiments) > 1 else [],
        confusion=_confusion(whole),
        kinds=[[OUTCOME_LABELS[a], OUTCOME_LABELS[b], str(count)] for (a, b), count in whole.kinds],
        failures=_failures(cases, results),
        sections=sections,
        candidates=CANDIDATES,
    )
    _write(folder / PAGE, page)
    _write(folder / RUNS, _runs_csv(cases, results))
    numbers = {
        "comparisons": {name: comparison_numbers(one) for name, one in comparisons},
        "by_experiment": experiment_table(by_experiment, side_view),
    }
    _write(folder / NUMBERS, json.dumps(numbers, indent=2, ensure_ascii=False) + "\n")
    return comparisons


def comparison_row(name: str, one: Agreement) -> list[str]:
    """A comparison as the cells of COMPARISON_HEAD."""
    low, high = one.interval
    return [
        name,
        str(one.runs),
        f"{100 * one.share:.1f}",
        f"{100 * low:.1f} – {100 * high:.1f}",
        "–" if one.correlation is None else f"{one.correlation:.3f}",
        f"{100 * one.rmse:.1f}",
        f"{100 * one.bias:+.1f}",
    ]


def experiment_table(
    experiments: Mapping[str, Sequence[Agreement]], side_view: Mapping[str, Agreement]
) -> list[list[str]]:
    """A row an experiment: multibody and MuJoCo, the side view against MuJoCo where it claims the scenes, and how far
    MuJoCo agrees with itself if it was asked; a head above.
    """
    rows = []
    for name, (one, *selves) in experiments.items():
        _, runs, *cells = comparison_row(name, one)
        passed = [sum(d.first for d in one.designs.values()), sum(d.second for d in one.designs.values())]
        shares = [f"{100 * count / one.runs:.1f}" for count in passed]
        flat = side_view.get(name)
        plane = [NOT_CLAIMED] * len(SIDE_VIEW_HEAD)
        if flat is not None:
            went = sum(d.first for d in flat.designs.values())
            plane = [f"{100 * share:.1f}" for share in (went / flat.runs, flat.share, flat.rmse)]
        rows.append([name, runs, *shares, *cells, *plane, *(f"{100 * other.share:.1f}" for other in selves)])
    head = [*EXPERIMENT_HEAD, *SIDE_VIEW_HEAD]
    return [[*head, *(BASELINE_HEAD if rows and len(rows[0]) > len(head) else [])], *rows]


def _of(experiment: str, pairs: Sequence[Pair]) -> list[Pair]:
    return [pair for pair in pairs if pair[0].experiment == experiment]


def _confusion(one: Agreement) -> list[list[str]]:
    seen = {outcome for pair in one.confusion for outcome in pair}
    names = [outcome for outcome in OUTCOMES if outcome in seen]
    rows = [[OUTCOME_LABELS[a], *(str(one.confusion.get((a, b), 0)) for b in names)] for a in names]
    return [["", *(OUTCOME_LABELS[name] for name in names)], *rows]


def _failures(cases: Sequence[Case], results: Results) -> list[str]:
    found = [
        f"{case.label}, {NAMES[engine]}: {result['message']}"
        for engine in results
        for case, result in zip(cases, results[engine], strict=True)
        if result is not None and result["outcome"] == "failed"
    ]
    more = [f"and {len(found) - MOST_FAILURES} more"] if len(found) > MOST_FAILURES else []
    return found[:MOST_FAILURES] + more


def _section(
    folder: Path, number: int, name: str, one: Agreement, worst: Sequence[Parted], carsim: Carsim
) -> dict[str, Any]:
    chart, picture = f"success_{number}.png", f"worst_{number}.png"
    save_figure(success_figure(one, name), folder / chart, colours=COLOURS)
    design = next(iter(one.designs.values()))
    keys = [key for key in design.columns if len({d.columns[key] for d in one.designs.values()}) > 1]
    rows = [
        [*(f"{d.columns[key]:g}" for key in keys), str(d.runs), *(f"{100 * n / d.runs:.1f}" for n in (d.first, d.second))]
        for d in one.designs.values()
    ]
    if worst:
        save_figure(worst_figure(worst, carsim_heights(carsim)), folder / picture, colours=COLOURS)
    else:
        (folder / picture).unlink(missing_ok=True)
    return {
        "name": name,
        "comparison": [COMPARISON_HEAD, comparison_row(BOTH, one)],
        "chart": chart,
        "designs": [[*keys, "runs", "multibody passed %", "MuJoCo passed %"], *rows],
        "worst": picture if worst else None,
    }


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


def column_name(engine: str) -> str:
    """How the names of an engine's columns in runs.csv begin."""
    return engine.replace("-", "_")


def comparison_numbers(one: Agreement) -> Mapping[str, Any]:
    """A comparison as in summary.json; shares are 0 to 1."""
    return {
        **{key: getattr(one, key) for key in ("runs", "alike", "share", "interval", "correlation", "rmse", "bias")},
        "confusion": [[a, b, count] for (a, b), count in sorted(one.confusion.items())],
        "designs": [
            {"experiment": name, "design": number + 1, **d.columns, "runs": d.runs, "passed": [d.first, d.second]}
            for (name, number), d in one.designs.items()
        ],
    }


def _write(file: Path, text: str) -> None:
    with atomic_file(file) as binary:
        binary.write(decoded(text).encode())
