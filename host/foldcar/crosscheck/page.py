"""A cross-check's files: a page in Markdown with its pictures, the runs as CSV, the numbers as JSON."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

from foldcar.atomic_file import atomic_file
from foldcar.carsim import Carsim
from foldcar.crosscheck.agreement import Agreement, Pair, agreement, worst
from foldcar.crosscheck.cases import Case
from foldcar.crosscheck.charts import success_figure, worst_figure
from foldcar.crosscheck.compare import CARSIM, ELLIPSOID, ENGINES, HALF_STEP, MUJOCO, Results, run_with_paths
from foldcar.figures.ground import carsim_heights
from foldcar.figures.output import save_figure
from foldcar.figures.style import OUTCOME_LABELS, RC
from foldcar.results import OUTCOMES

PAGE, RUNS, NUMBERS = "crosscheck.md", "runs.csv", "summary.json"
WORST = 3
PATH_INTERVAL_S = 0.02
NAMES = {
    CARSIM: "carsim",
    MUJOCO: "MuJoCo",
    HALF_STEP: "MuJoCo, half the time step",
    ELLIPSOID: "MuJoCo, ellipsoid tyres",
}


def pairs_of(cases: Sequence[Case], results: Results, first: str, second: str, samples: int) -> list[Pair]:
    """Results of two engines for the cases of the first ``samples`` samples that both have run."""
    return [
        (case, a, b)
        for case, a, b in zip(cases, results[first], results[second], strict=True)
        if case.sample < samples and a is not None and b is not None
    ]


def write_page(
    folder: Path, title: str, cases: Sequence[Case], results: Results, yardstick: int, carsim: Carsim
) -> list[tuple[str, Agreement]]:
    """Write all files; returns the comparisons of the page's first table with their names."""
    everything = max(case.sample for case in cases) + 1
    pairs = pairs_of(cases, results, CARSIM, MUJOCO, everything)
    whole = agreement(pairs)
    comparisons = [(f"{NAMES[CARSIM]} – {NAMES[MUJOCO]}", whole)]
    few = min(yardstick, everything)
    if few:
        for engine in (CARSIM, HALF_STEP, ELLIPSOID):
            name = f"{NAMES[engine]} – {NAMES[MUJOCO]}, samples 0 to {few - 1}"
            comparisons.append((name, agreement(pairs_of(cases, results, engine, MUJOCO, few))))
    with matplotlib.rc_context(RC):
        text = [f"# Cross-check of {title}", "", *_overview(comparisons), *_confusion(whole)]
        for experiment in dict.fromkeys(case.experiment for case in cases):
            own = [pair for pair in pairs if pair[0].experiment == experiment]
            text += _experiment(folder, experiment, agreement(own), own, carsim)
    _write(folder / PAGE, "\n".join(text) + "\n")
    _write(folder / RUNS, _runs_csv(cases, results))
    _write(folder / NUMBERS, json.dumps({name: _numbers(one) for name, one in comparisons}, indent=2) + "\n")
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


COMPARISON_HEAD = ["engines", "runs", "alike %", "95 % interval", "r of rates", "RMSE", "bias"]


def _overview(comparisons: Sequence[tuple[str, Agreement]]) -> list[str]:
    return [
        "Runs that end alike in pass or fail. Over the designs: correlation and root mean square difference",
        "of the success rates, and the first engine's mean surplus of them (percentage points).",
        "",
        *_table(COMPARISON_HEAD, [comparison_row(name, one) for name, one in comparisons]),
    ]


def _confusion(one: Agreement) -> list[str]:
    seen = {outcome for pair in one.confusion for outcome in pair}
    names = [outcome for outcome in OUTCOMES if outcome in seen]
    rows = [[OUTCOME_LABELS[a], *(str(one.confusion.get((a, b), 0)) for b in names)] for a in names]
    kinds = [[OUTCOME_LABELS[a], OUTCOME_LABELS[b], str(count)] for (a, b), count in one.kinds]
    return [
        "## Outcomes",
        "",
        "Rows: carsim; columns: MuJoCo.",
        "",
        *_table(["", *(OUTCOME_LABELS[name] for name in names)], rows),
        "Disagreements of pass and fail by kind:" if kinds else "No run passes in one engine only.",
        "",
        *(_table(["carsim", "MuJoCo", "runs"], kinds) if kinds else []),
    ]


def _experiment(folder: Path, experiment: str, one: Agreement, pairs: Sequence[Pair], carsim: Carsim) -> list[str]:
    picture = f"success_{experiment}.png"
    save_figure(success_figure(one, experiment), folder / picture)
    design = next(iter(one.designs.values()))
    keys = [key for key in design.columns if len({d.columns[key] for d in one.designs.values()}) > 1]
    rows = [
        [
            *(f"{d.columns[key]:g}" for key in keys),
            str(d.runs),
            f"{100 * d.first / d.runs:.1f}",
            f"{100 * d.second / d.runs:.1f}",
        ]
        for d in one.designs.values()
    ]
    text = [
        f"## Experiment {experiment}",
        "",
        *_table(COMPARISON_HEAD, [comparison_row(f"{NAMES[CARSIM]} – {NAMES[MUJOCO]}", one)]),
        f"![Success by design in both engines]({picture})",
        "",
        *_table([*keys, "runs", "carsim passed %", "MuJoCo passed %"], rows),
    ]
    found = worst(pairs, WORST)
    if found:
        picture = f"worst_{experiment}.png"
        drawn = []
        for case, *known in found:
            first, second = run_with_paths(case, known, carsim, PATH_INTERVAL_S)
            drawn.append((case, first, second))
        save_figure(worst_figure(drawn, carsim_heights(carsim)), folder / picture)
        text += ["Disagreements that end furthest apart:", "", f"![The worst disagreements]({picture})", ""]
    return text


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [*("| " + " | ".join(cells) + " |" for cells in lines), ""]


def _runs_csv(cases: Sequence[Case], results: Results) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    parameters = list(dict.fromkeys(key for case in cases for key in case.columns))
    values = ("outcome", "elapsed_time_s", "distance_to_target_m", "max_roll_rad", "max_pitch_rad")
    writer.writerow(
        [
            "experiment",
            "design",
            "sample",
            *parameters,
            *(f"{e}_{value}" for e in ENGINES for value in values),
        ]
    )
    for index, case in enumerate(cases):
        row = [case.experiment, case.design + 1, case.sample, *(case.columns.get(key) for key in parameters)]
        for engine in ENGINES:
            result = results[engine][index] or {}
            row += [result.get(value) for value in values]
        writer.writerow(row)
    return text.getvalue()


def _numbers(one: Agreement) -> Mapping[str, Any]:
    return {
        "runs": one.runs,
        "alike": one.alike,
        "share": one.share,
        "interval": one.interval,
        "correlation": one.correlation,
        "rmse": one.rmse,
        "bias": one.bias,
        "confusion": [[a, b, count] for (a, b), count in sorted(one.confusion.items())],
        "designs": [
            {
                "experiment": name,
                "design": number + 1,
                **d.columns,
                "runs": d.runs,
                "passed": [d.first, d.second],
            }
            for (name, number), d in one.designs.items()
        ],
    }


def _write(file: Path, text: str) -> None:
    with atomic_file(file) as binary:
        binary.write(text.encode())
