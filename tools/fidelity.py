"""Updates tables and pictures of docs/fidelity.md from cross-checks of scenarios/fidelity.json and across.json.

Usage: fidelity.py CROSSCHECK_DIR ACROSS_DIR PAGE. Input: runs.csv of both folders, pictures of the first. Output: the
page with the text between its marks replaced, and the pictures in the folder of the page's name beside it.
"""

import csv
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from page_block import replaced

from foldcar.errors import FoldcarError
from foldcar.outputs import atomic_file
from foldcar.report.crosscheck_agreement import (
    COMPARISON_HEAD,
    Agreement,
    Case,
    Pair,
    agreement,
    column_name,
    comparison_row,
)
from foldcar.simulation.engines import ELLIPSOID, HALF_STEP, MUJOCO, MULTIBODY, SIDE_VIEW
from foldcar.simulation.results import NUMBERS

ENGINES = {
    "side-view, across the course": SIDE_VIEW,
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
ACROSS = (
    ("bumps", "bumps across"),
    ("round_bumps", "half-round bumps across"),
    ("kerbs", "kerbs across"),
    ("steps", "steps across"),
    ("pyramids", "pyramids under both tracks"),
    ("ramps", "ramps across"),
    ("bars", "rough strips of bars"),
    ("across_hills", "hills across"),
)
# The names of the rows that have all runs of a listing.
ALL, ALL_ACROSS = "all", "all across"
HEAD = ["experiment", "runs", *(f"{name} %" for name in ("side-view", "multibody", "MuJoCo")),
        "side-view RMSE", "multibody alike %", "multibody RMSE"]  # fmt: skip
NOT_CLAIMED = "–"
# Names here of the cross-check's pictures, which are numbered as the listing's experiments.
PICTURES = {
    "success_1.png": ("width.png", "Success by width"),
}
PARTED = 5


def main(folder: Path, across: Path, page: Path) -> None:
    """Update the page and its pictures. FoldcarError if something is missing, before anything is written."""
    rows, level = read_rows(folder / "runs.csv", NAMES), read_rows(across / "runs.csv", ACROSS)
    shown = [(folder / name, *target) for name, target in PICTURES.items() if (folder / name).is_file()]
    blocks = {
        "experiments": markdown([HEAD, *experiments(rows, NAMES, ALL), *experiments(level, ACROSS, ALL_ACROSS)]),
        "engines": markdown(engines(rows, level)),
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


def read_rows(file: Path, names: Sequence[tuple[str, str]]) -> list[dict[str, str]]:
    """The rows of a cross-check's runs; FoldcarError if it has none or lacks an experiment of the page."""
    try:
        with file.open(encoding="utf-8") as lines:
            rows = list(csv.DictReader(lines))
    except OSError as error:
        raise FoldcarError(f"{file}: {error.strerror}; `foldcar crosscheck` makes it") from error
    found = {row["experiment"] for row in rows}
    for start, name in names:
        if not any(one.startswith(start) for one in found):
            raise FoldcarError(f"{file}: no run of {name}; cross-check the whole listing")
    return rows


def experiments(rows: Sequence[Mapping[str, str]], names: Sequence[tuple[str, str]], everything: str) -> list[list[str]]:
    """A row an experiment of the page and one of all: each engine's share, side-view and multibody against MuJoCo."""
    table = []
    for name in (*(name for _, name in names), everything):
        some = [row for row in rows if name in (name_of(row, names), everything)]
        in_plane = pairs_of(some, SIDE_VIEW)
        flat, one = agreement(in_plane) if len(in_plane) == len(some) else None, agreement(pairs_of(some, MULTIBODY))
        plane = [NOT_CLAIMED, NOT_CLAIMED] if flat is None else [passed(flat)[0], f"{100 * flat.rmse:.1f}"]
        agree = [f"{100 * share:.1f}" for share in (one.share, one.rmse)]
        table.append([name, str(one.runs), plane[0], *passed(one), plane[1], *agree])
    return table


def passed(one: Agreement) -> list[str]:
    """The percentages of the runs that pass in the first and in the second engine."""
    counts = [sum(d.first for d in one.designs.values()), sum(d.second for d in one.designs.values())]
    return [f"{100 * count / one.runs:.1f}" for count in counts]


def engines(rows: Sequence[Mapping[str, str]], level: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """A row an engine, in all experiments, against MuJoCo; FoldcarError if one was not asked."""
    found = []
    for name, engine in ENGINES.items():
        pairs = pairs_of(level if engine == SIDE_VIEW else rows, engine)
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
    order = sorted(whole.designs.items(), key=lambda pair: -abs(pair[1].first - pair[1].second) / pair[1].runs ** 0.5)
    found = [["experiment", "design", "runs", "multibody %", "MuJoCo %"]]
    for (name, _), one in order[:PARTED]:
        label = ", ".join(f"{key} {one.columns[key]:g}" for key in sorted(varied[name]))
        found.append([name, label, str(one.runs), *(f"{100 * n / one.runs:.0f}" for n in (one.first, one.second))])
    return found


def name_of(row: Mapping[str, str], names: Sequence[tuple[str, str]]) -> str:
    """The page's name of a run's experiment."""
    return next(name for start, name in names if row["experiment"].startswith(start))


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
        main(*map(Path, sys.argv[1:4]))
    except FoldcarError as error:
        print(f"fidelity: {error}", file=sys.stderr)
        sys.exit(2)
