"""Updates tables and pictures of docs/fidelity.md from a cross-check of scenarios/fidelity.json.

Usage: fidelity.py CROSSCHECK_DIR PAGE. Input: runs.csv and pictures of the folder. Output: the page with the text
between its marks replaced, and the pictures in the folder of the page's name beside it.
"""

import csv
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from foldcar.atomic_file import atomic_file
from foldcar.crosscheck.agreement import Pair, agreement
from foldcar.crosscheck.charts import FIRST, LOOKS
from foldcar.crosscheck.page import COMPARISON_HEAD, column_name, comparison_row, experiment_table
from foldcar.crosscheck.stored import Case
from foldcar.figures.output import save_figure
from foldcar.figures.style import RC
from foldcar.simulation.engines import ELLIPSOID, HALF_STEP, MUJOCO, SIDE_VIEW

# The tables' marks: experiments in the side view and in MuJoCo, engines on step pyramids.
BEGIN, END = "<!-- table of tools/fidelity.py -->", "<!-- end of table -->"
BEGIN_ENGINES, END_ENGINES = "<!-- engines of tools/fidelity.py -->", "<!-- end of engines -->"
ENGINES = {
    "side view": SIDE_VIEW,
    "MuJoCo, half step": HALF_STEP,
    "MuJoCo, ellipsoid tyres": ELLIPSOID,
}
# Names of experiments on the page by the beginning of their ids; those with one name share a row.
NAMES = (
    ("study", "the width study"),
    ("width", "widths 65 to 245 mm, friction 0.6"),
    ("friction_0.3", "friction 0.3"),
    ("friction_0.4", "friction 0.4"),
    ("friction_0.5", "friction 0.5"),
    ("friction_0.7", "friction 0.7"),
    ("friction_0.8", "friction 0.8"),
    ("radius", "wheels of 30, 40, 50 mm radius"),
    ("tyre", "tyres 8, 16, 20 mm wide"),
    ("bumps", "bumps of 6 to 30 mm, radius 36 to 60 mm"),
    ("hills", "Gaussian hills"),
    ("ten_bumps", "ten random bumps"),
    ("course", "the obstacle course"),
)
EVERYTHING = "all"
# Columns of the cross-check's own table that the page leaves out.
LEFT_OUT = ("95 % interval", "r of rates", "bias", "ellipsoid alike %")
# Experiments on other ground.
ELSEWHERE = ("bumps", "hills", "ten_bumps", "course")
# Names here of the cross-check's pictures, which are numbered as the listing's experiments.
PICTURES = {
    "success_1.png": "width.png",
    "worst_1.png": "worst_width.png",
    "worst_18.png": "worst_hills.png",
    "worst_20.png": "worst_course.png",
}


def main(folder: Path, page: Path) -> None:
    """Update the page and its pictures."""
    with (folder / "runs.csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    names = [name for _, name in NAMES] + [EVERYTHING]
    groups = {
        name: [
            agreement(pairs)
            for engine in (SIDE_VIEW, HALF_STEP, ELLIPSOID)
            if (pairs := pairs_of([row for row in rows if name in (name_of(row), EVERYTHING)], engine))
        ]
        for name in names
    }
    table = without_columns(experiment_table(groups), LEFT_OUT)
    pyramids = [row for row in rows if not row["experiment"].startswith(ELSEWHERE)]
    engines = [
        comparison_row(name, agreement(pairs))
        for name, engine in ENGINES.items()
        if (pairs := pairs_of(pyramids, engine))
    ]
    text = replaced(page.read_text(encoding="utf-8"), BEGIN, END, markdown(table))
    text = replaced(text, BEGIN_ENGINES, END_ENGINES, markdown([COMPARISON_HEAD, *engines]))
    with atomic_file(page) as binary:
        binary.write(text.encode())
    pictures = page.with_suffix("")
    pictures.mkdir(exist_ok=True)
    for picture, name in PICTURES.items():
        shutil.copyfile(folder / picture, pictures / name)
    with matplotlib.rc_context(RC):
        save_figure(overview(table), pictures / "overview.png", colours=64)


def without_columns(table: Sequence[Sequence[str]], names: Sequence[str]) -> list[list[str]]:
    """The table without the columns that its first row gives these names."""
    kept = [index for index, name in enumerate(table[0]) if name not in names]
    return [[row[index] for index in kept] for row in table]


def replaced(text: str, begin: str, end: str, between: str) -> str:
    """The text with the part between two marks, each of which occurs once, replaced."""
    before, rest = text.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{between}{end}{after}"


def name_of(row: Mapping[str, str]) -> str:
    """The page's name of a run's experiment."""
    return next(name for start, name in NAMES if row["experiment"].startswith(start))


def pairs_of(rows: Sequence[Mapping[str, str]], engine: str) -> list[Pair]:
    """The outcomes of an engine and of MuJoCo for the runs that both have."""
    return [
        (
            Case(row["experiment"], int(row["design"]), int(row["sample"]), {}),
            {"outcome": row[f"{column_name(engine)}_outcome"]},
            {"outcome": row[f"{column_name(MUJOCO)}_outcome"]},
        )
        for row in rows
        if row[f"{column_name(engine)}_outcome"] and row[f"{column_name(MUJOCO)}_outcome"]
    ]


def markdown(table: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first row is its head."""
    head, *rows = ("|" + "|".join(cells) + "|\n" for cells in table)
    return "".join([head, "|" + "---|" * len(table[0]) + "\n", *rows])


def overview(table: Sequence[Sequence[str]]) -> Any:
    """A figure of the success in both engines, one line for each row of the table."""
    rows = table[1:]
    figure = Figure(figsize=(7.2, 0.32 * len(rows) + 1.0), layout="constrained")
    axes = figure.subplots()
    places = range(len(rows), 0, -1)
    rates = [[float(row[2]), float(row[3])] for row in rows]
    axes.hlines(places, [min(pair) for pair in rates], [max(pair) for pair in rates], color="#999999", zorder=1)
    for name, colour, marker, _ in LOOKS:
        values = [pair[0 if name == FIRST else 1] for pair in rates]
        axes.plot(values, places, marker, color=colour, markersize=6, label=name, zorder=2)
    axes.set_yticks(places, [row[0] for row in rows])
    axes.set_xlim(-2, 102)
    axes.set_xlabel("runs passed (%)")
    axes.set_title("Success in both engines")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
