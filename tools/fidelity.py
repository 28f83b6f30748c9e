"""Sweeps scenarios/fidelity.json and across.json in all engines, compares the results, updates docs/fidelity.md.

Usage: fidelity.py STORE ACROSS_STORE PAGE. Both stores are made if they are missing, and resumed otherwise; `foldcar
report` shows them. Output: the page with the tables between its marks replaced.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy
from page_block import replaced

from foldcar.api.sweeping import planned_sweep
from foldcar.commands.progress_bar import ProgressBar
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.outputs import atomic_file
from foldcar.simulation.engines import ELLIPSOID, ENGINES, HALF_STEP, MUJOCO, MULTIBODY, SIDE_VIEW
from foldcar.simulation.results import REJECTED
from foldcar.statistics.rate import wilson_interval
from foldcar.store.info import engine_id
from foldcar.store.reader import Store

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
TITLES = {
    SIDE_VIEW: "side-view, across the course",
    MULTIBODY: "multibody",
    HALF_STEP: "MuJoCo, half step",
    ELLIPSOID: "MuJoCo, ellipsoid tyres",
}
# MuJoCo's variants show how far it agrees with itself. They run in so many samples of each experiment.
VARIANT_SAMPLES = 10
# The experiments of fidelity.json whose ground is the same under both tracks, so that the side view claims them.
SIDE_VIEW_EXPERIMENTS = [f"bumps_{height}" for height in (6, 12, 18, 24, 30)]
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


class Run(NamedTuple):
    """One design in one sample, by the listing's name of its experiment."""

    experiment: str
    design: int
    sample: int


@dataclass(frozen=True)
class Results:
    """The outcomes of both listings by engine and run, and the parameters of the designs by experiment."""

    outcomes: Mapping[str, Mapping[Run, str]]
    designs: Mapping[str, Mapping[int, Mapping[str, float]]]

    def pairs(self, engine: str, experiments: Sequence[str]) -> dict[Run, tuple[str, str]]:
        """The outcomes of an engine and of MuJoCo in the runs that both have."""
        first, second = self.outcomes[engine], self.outcomes[MUJOCO]
        both = [run for run in second if run in first and run.experiment in experiments]
        return {run: (first[run], second[run]) for run in both}


@dataclass(frozen=True)
class DesignCounts:
    """A design's number of runs, and the numbers that passed in the first and in the second engine."""

    runs: int
    first: int
    second: int


@dataclass(frozen=True)
class Agreement:
    """The number of compared ``runs``, and of those ``alike`` in pass or fail; ``designs`` by experiment and number.

    ``correlation`` of the designs' success rates is None where either engine has one rate for all. ``rmse`` and ``bias``
    (first minus second) are fractions.
    """

    runs: int
    alike: int
    designs: Mapping[tuple[str, int], DesignCounts]
    correlation: float | None
    rmse: float
    bias: float

    @property
    def fraction(self) -> float:
        """The fraction of runs that agree in pass or fail."""
        return self.alike / self.runs


def agreement(pairs: Mapping[Run, tuple[str, str]]) -> Agreement:
    """Compare pairs of outcomes, without runs that either engine rejected; FoldcarError if none is left."""
    tallies: dict[tuple[str, int], list[int]] = {}
    alike = 0
    for run, outcomes in pairs.items():
        if REJECTED in outcomes:
            continue
        passed = [outcome == "passed" for outcome in outcomes]
        alike += passed[0] == passed[1]
        tally = tallies.setdefault((run.experiment, run.design), [0, 0, 0])
        for place, counts in enumerate((True, *passed)):
            tally[place] += counts
    if not tallies:
        raise FoldcarError("nothing to compare: no run that was not rejected in either engine")
    designs = {key: DesignCounts(*tally) for key, tally in sorted(tallies.items())}
    rates = numpy.array([(counts.first / counts.runs, counts.second / counts.runs) for counts in designs.values()])
    differences = rates[:, 0] - rates[:, 1]
    varied = len(rates) > 1 and bool(numpy.all(numpy.ptp(rates, axis=0) > 0))
    return Agreement(
        runs=sum(counts.runs for counts in designs.values()),
        alike=alike,
        designs=designs,
        correlation=float(numpy.corrcoef(rates.T)[0, 1]) if varied else None,
        rmse=float(numpy.sqrt(numpy.mean(differences**2))),
        bias=float(numpy.mean(differences)),
    )


def main(store: Path, across: Path, page: Path) -> None:
    """Sweep what the stores lack, then update the page. FoldcarError."""
    for engine in (MULTIBODY, MUJOCO):
        sweep("fidelity.json", store, engine)
        sweep("across.json", across, engine)
    for engine in (HALF_STEP, ELLIPSOID):
        sweep("fidelity.json", store, engine, environments=VARIANT_SAMPLES)
    for name in SIDE_VIEW_EXPERIMENTS:
        sweep("fidelity.json", store, SIDE_VIEW, experiment=name)
    sweep("across.json", across, SIDE_VIEW)
    results, results_across = read_results(store), read_results(across)
    blocks = {
        "experiments": [
            HEAD, *experiment_rows(results, NAMES, ALL), *experiment_rows(results_across, ACROSS, ALL_ACROSS)
        ],
        "engines": engine_rows(results, results_across),
    }  # fmt: skip
    text = page.read_text(encoding="utf-8")
    for name, table in blocks.items():
        text = replaced(text, page, f"<!-- {name}: tools/fidelity.py -->", f"<!-- end of {name} -->", markdown(table))
    with atomic_file(page) as binary:
        binary.write(text.encode())


def sweep(
    listing: str, store: Path, engine: str, *, experiment: str | None = None, environments: int | None = None
) -> None:
    """Simulate the runs of a listing in that engine which the store lacks."""
    planned = planned_sweep(
        SCENARIOS / listing, store, "make fidelity", experiment=experiment, environments=environments, engine=engine,
        realities=0,
    )  # fmt: skip
    with ProgressBar(planned.progress, label=f"{listing}, {engine}") as bar:
        planned.run(usable_processors(), bar.update, bar.print_line)


def read_results(store: Path) -> Results:
    """All outcomes of a store into which a listing was swept in several engines."""
    outcomes: dict[str, dict[Run, str]] = {engine: {} for engine in ENGINES}
    designs: dict[str, Mapping[int, Mapping[str, float]]] = {}
    with Store.open(store) as opened:
        for name, info in opened.info().experiments.items():
            listed = info.listed_id
            (engine,) = (key for key, candidate in ENGINES.items() if engine_id(listed, candidate.title) == name)
            designs[listed] = {
                number: {key: float(value) for key, value in design.items() if not isinstance(value, str)}
                for number, design in opened.designs(name).items()
            }
            for design, sample, row in opened.run_rows(name):
                outcomes[engine][Run(listed, design, sample)] = row["outcome"]
    return Results(outcomes, designs)


def experiment_rows(results: Results, names: Sequence[tuple[str, str]], everything: str) -> list[list[str]]:
    """A row for each experiment of the page and one for all: side-view and multibody against MuJoCo."""
    grouped: dict[str, list[str]] = {name: [] for _, name in names}
    for listed in results.designs:
        grouped[next(name for start, name in names if listed.startswith(start))].append(listed)
    table = []
    for name, experiments in (*grouped.items(), (everything, list(results.designs))):
        compared = agreement(results.pairs(MULTIBODY, experiments))
        in_plane = results.pairs(SIDE_VIEW, experiments)
        side_view = [NOT_CLAIMED, NOT_CLAIMED]
        if len(in_plane) == len(results.pairs(MULTIBODY, experiments)):
            flat = agreement(in_plane)
            side_view = [passed_percents(flat)[0], f"{100 * flat.rmse:.1f}"]
        agree = [f"{100 * number:.1f}" for number in (compared.fraction, compared.rmse)]
        table.append([name, str(compared.runs), side_view[0], *passed_percents(compared), side_view[1], *agree])
    return table


def passed_percents(compared: Agreement) -> list[str]:
    """The percentages of the runs that pass in the first and in the second engine."""
    designs = compared.designs.values()
    counts = [sum(d.first for d in designs), sum(d.second for d in designs)]
    return [f"{100 * count / compared.runs:.1f}" for count in counts]


def engine_rows(results: Results, across: Results) -> list[list[str]]:
    """A row for each engine, in all experiments, against MuJoCo."""
    table = [["engines", "runs", "alike %", "95 % interval", "r of rates", "RMSE", "bias"]]
    for engine, title in TITLES.items():
        swept = across if engine == SIDE_VIEW else results
        compared = agreement(swept.pairs(engine, list(swept.designs)))
        low, high = wilson_interval(compared.alike, compared.runs)
        table.append([
            title,
            str(compared.runs),
            f"{100 * compared.fraction:.1f}",
            f"{100 * low:.1f} – {100 * high:.1f}",
            "–" if compared.correlation is None else f"{compared.correlation:.3f}",
            f"{100 * compared.rmse:.1f}",
            f"{100 * compared.bias:+.1f}",
        ])  # fmt: skip
    return table


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
