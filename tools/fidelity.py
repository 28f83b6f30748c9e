"""Updates tables and pictures of docs/fidelity.md from a cross-check of scenarios/fidelity.json.

Usage: fidelity.py CROSSCHECK_DIR PAGE. Input: runs.csv and pictures of the folder. Output: the page with the text
between its marks replaced, and the pictures in the folder of the page's name beside it.
"""

import csv
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from page_block import replaced

from foldcar.atomic_file import atomic_file
from foldcar.crosscheck.agreement import Agreement, Pair, agreement
from foldcar.crosscheck.page import COMPARISON_HEAD, column_name, comparison_row, experiment_table
from foldcar.crosscheck.stored import Case
from foldcar.errors import FoldcarError
from foldcar.simulation.engines import ELLIPSOID, HALF_STEP, MUJOCO, MULTIBODY
from foldcar.simulation.results import NUMBERS

ENGINES = {
    "multibody": MULTIBODY,
    "MuJoCo, half step": HALF_STEP,
    "MuJoCo, ellipsoid tyres": ELLIPSOID,
}
# Names of experiments on the page by the beginning of their ids; those with one name share a row.
NAMES = (
    ("study", "the width study"),
    ("width", "widths, friction 0.6"),
    ("friction_0.3", "friction 0.3"),
    ("friction_0.4", "friction 0.4"),
    ("friction_0.5", "friction 0.5"),
    ("friction_0.7", "friction 0.7"),
    ("friction_0.8", "friction 0.8"),
    ("radius", "wheel radii"),
    ("tyre", "tyre widths"),
    ("bumps", "bumps"),
    ("hills", "hills"),
    ("ten_bumps", "ten bumps"),
    ("course", "obstacle course"),
)
EVERYTHING = "all"
# Columns of the cross-check's own table that the page leaves out.
LEFT_OUT = ("95 % interval", "r of rates", "bias")
# Names here of the cross-check's pictures, which are numbered as the listing's experiments.
PICTURES = {
    "success_1.png": ("width.png", "Success by width"),
    "worst_1.png": ("worst_width.png", "Width study: runs that part most"),
    "worst_20.png": ("worst_course.png", "Obstacle course: runs that part most"),
}
PARTED = 5


def main(folder: Path, page: Path) -> None:
    """Update the page and its pictures. FoldcarError if something is missing, before anything is written."""
    rows = read_rows(folder / "runs.csv")
    shown = [(folder / name, *target) for name, target in PICTURES.items() if (folder / name).is_file()]
    blocks = {
        "experiments": markdown(experiments(rows)),
        "engines": markdown(engines(rows)),
        "designs": markdown(parted_designs(rows)),
        "pictures": "\n".join(f"![{caption}]({page.stem}/{name})\n" for _, name, caption in shown),
    }
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        text = replaced(text, page, f"<!-- {name}: tools/fidelity.py -->", f"<!-- end of {name} -->", block)
    pictures = page.with_suffix("")
    pictures.mkdir(exist_ok=True)
    for file in pictures.glob("*.png"):
        file.unlink()
    for source, name, _ in shown:
        shutil.copyfile(source, pictures / name)
    with atomic_file(page) as binary:
        binary.write(text.encode())


def read_rows(file: Path) -> list[dict[str, str]]:
    """The rows of a cross-check's runs; FoldcarError if it has none or lacks an experiment of the page."""
    try:
        with file.open(encoding="utf-8") as lines:
            rows = list(csv.DictReader(lines))
    except OSError as error:
        raise FoldcarError(f"{file}: {error.strerror}; `foldcar crosscheck` makes it") from error
    found = {row["experiment"] for row in rows}
    for start, name in NAMES:
        if not any(one.startswith(start) for one in found):
            raise FoldcarError(f"{file}: no run of {name}; cross-check the whole of scenarios/fidelity.json")
    return rows


def experiments(rows: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """A row an experiment of the page: multibody against MuJoCo."""
    names = [*(name for _, name in NAMES), EVERYTHING]
    groups = {
        name: [agreement(pairs_of([row for row in rows if name in (name_of(row), EVERYTHING)], MULTIBODY))]
        for name in names
    }
    head, *table = experiment_table(groups)
    kept = [index for index, name in enumerate(head) if name not in LEFT_OUT]
    return [[row[index] for index in kept] for row in (head, *table)]


def engines(rows: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """A row an engine, in all experiments, against MuJoCo; FoldcarError if one was not asked."""
    found = []
    for name, engine in ENGINES.items():
        pairs = pairs_of(rows, engine)
        if not pairs:
            raise FoldcarError(f"no run of {name}: cross-check with a --baseline")
        found.append(comparison_row(name, agreement(pairs)))
    return [COMPARISON_HEAD, *found]


def parted_designs(rows: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """The designs whose success rates part most in multibody and MuJoCo, by the difference in its standard errors."""
    whole: Agreement = agreement(pairs_of(rows, MULTIBODY))
    varied = {
        name: {key for one, d in whole.designs.items() if one[0] == name for key in d.columns
               if len({other.columns[key] for them, other in whole.designs.items() if them[0] == name}) > 1}
        for name, _ in whole.designs
    }  # fmt: skip
    order = sorted(whole.designs.items(), key=lambda pair: -abs(pair[1].first - pair[1].second) / pair[1].runs**0.5)
    found = [["experiment", "design", "runs", "multibody %", "MuJoCo %"]]
    for (name, _), one in order[:PARTED]:
        label = ", ".join(f"{key} {one.columns[key]:g}" for key in sorted(varied[name]))
        found.append([name, label, str(one.runs), *(f"{100 * n / one.runs:.0f}" for n in (one.first, one.second))])
    return found


def name_of(row: Mapping[str, str]) -> str:
    """The page's name of a run's experiment."""
    return next(name for start, name in NAMES if row["experiment"].startswith(start))


def pairs_of(rows: Sequence[Mapping[str, str]], engine: str) -> list[Pair]:
    """The outcomes of an engine and of MuJoCo for the runs that both have."""
    first, second = (f"{column_name(one)}_outcome" for one in (engine, MUJOCO))
    return [
        (
            Case(row["experiment"], int(row["design"]), int(row["sample"]), parameters(row)),
            {"outcome": row[first]},
            {"outcome": row[second]},
        )
        for row in rows
        if row[first] and row[second]
    ]


def parameters(row: Mapping[str, str]) -> dict[str, float]:
    """The design's parameters: what is neither the run's place nor an engine's answer."""
    answers = {f"{column_name(one)}_{value}" for one in (*ENGINES.values(), MUJOCO) for value in ("outcome", *NUMBERS)}
    named = {key: text for key, text in row.items() if key not in {"experiment", "design", "sample"} | answers}
    return {key: float(text) for key, text in named.items() if text}


def markdown(table: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first row is its head."""
    head, *rows = ("|" + "|".join(cells) + "|\n" for cells in table)
    return "".join([head, "|" + "---|" * len(table[0]) + "\n", *rows])


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
    except FoldcarError as error:
        print(f"fidelity: {error}", file=sys.stderr)
        sys.exit(2)
