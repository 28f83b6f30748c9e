"""Measures what `sweep --engine mujoco --until decided` costs against MuJoCo on everything; renews docs/advice.md.

Usage: dear_runs.py FOLDER PAGE. Sweeps two families in both engines into stores in FOLDER, which it resumes, and takes
from these the runs that each way of spending them makes: the schedule is a function of results. Time is the runs'
simulated time at each engine's processor time per simulated second, which is measured on a few runs. Output: the page
with its table replaced.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy
from numpy.typing import NDArray
from page_block import replaced

from foldcar.outputs import atomic_file
from foldcar.simulation.engines import MUJOCO, MULTIBODY
from foldcar.statistics.rate import wilson_interval
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.reader import Store
from foldcar.study.stopping import Schedule

BEGIN, END = "<!-- table of tools/dear_runs.py -->", "<!-- end of table -->"
SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
# Widths about the borders only, on a slippery floor.
BORDERS = {
    "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"environments": 100, "threshold": [0.5, 0.75]}}},
    "vehicles": {
        "1": {
            "type": "W_B_W",
            "params": [
                {"common": {"width": {"from": 110, "to": 180, "step": 5}, "height": 50, "radius": 60}},
                {"W": {"length": 60, "tire_thickness": 12}},
                {"B": {"length": 80}},
            ],
        }
    },
    "environments": {
        "1": {"scenic_filename": str(SCENARIOS / "step_pyramids.scenic"), "seed": 11, "scenic_params": {"friction": 0.45}}
    },
}
# Environments whose runs measure an engine's speed.
TIMED = 3
# Names of the families in the table.
NAMES = {"width_study": "width study", "borders": "borders"}


@dataclass(frozen=True)
class Runs:
    """All runs of a family in one engine: whether they passed, and their processor time (s), both (designs, samples)."""

    passed: Any
    seconds: Any

    def until(self, rule: StoppingRule, other: "Schedule | None" = None) -> tuple[Schedule, list[int]]:
        """The schedule at its end, and the designs in the order of their first runs."""
        designs, most = self.passed.shape
        counts = None if other is None else (other.passed.tolist(), other.runs.tolist())
        schedule, order = Schedule(rule, most, [0] * designs, counts), []
        while batches := schedule.next():
            order += [batch.design for batch in batches if not batch.samples.start]
            new = {b.design: self.passed[b.design, b.samples.start : b.samples.stop] for b in batches}
            schedule.record({design: (int(row.sum()), len(row)) for design, row in new.items()}, batches)
        return schedule, order

    def cost(self, runs: Sequence[int] | NDArray[numpy.int_]) -> float:
        """The time (s) of the first so many runs of each design."""
        return float(sum(row[:count].sum() for row, count in zip(self.seconds, runs, strict=True)))


def sweep(listing: Path, store: Path, engine: str, *words: str) -> float:
    """Sweep as a user does; gives its processor time (s)."""
    before = os.times()
    command = [sys.executable, "-m", "foldcar", "sweep", str(listing), "--store", str(store), "--engine", engine, *words]
    subprocess.run(command, check=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def simulated(store: Path, mujoco: bool) -> tuple[Any, Any]:
    """Whether runs passed, and their simulated time (s), both (designs, samples)."""
    passed: dict[Any, list[bool]] = {}
    seconds: dict[Any, list[float]] = {}
    with Store.open(store) as opened:
        (name,) = (one for one, info in opened.info().experiments.items() if bool(info.engine) is mujoco)
        for result in opened.results(name):
            key = tuple(result.design.values())
            passed.setdefault(key, []).append(result.outcome == "passed")
            elapsed_s = result.metrics["elapsed_time_s"]
            if elapsed_s is None:
                sys.exit(f"{store}: {name}: run {key}, {result.sample} failed")
            seconds.setdefault(key, []).append(elapsed_s)
    return numpy.array([*passed.values()]), numpy.array([*seconds.values()])


def measured(listing: Path, store: Path, engine: str) -> Runs:
    """Every run of the listing in the engine, at its speed."""
    sweep(listing, store, engine)
    passed, seconds = simulated(store, engine == MUJOCO)
    with tempfile.TemporaryDirectory() as folder:
        small = Path(folder) / "s.db"
        # Twice: what starting costs is in both.
        spent = sweep(listing, small, engine, "--environments", str(TIMED), "--jobs", "1")
        spent -= sweep(listing, small, engine, "--environments", str(TIMED), "--jobs", "1")
    return Runs(passed, seconds * spent / seconds[:, :TIMED].sum())


def verdicts(passed: Any, n: int, rule: StoppingRule) -> Any:
    """Which designs Wilson's intervals put on one side of every threshold after a fixed number of runs."""
    ends = [wilson_interval(int(count), n, rule.confidence) for count in passed[:, :n].sum(axis=1)]
    return numpy.array([all(low > t or high < t for t in rule.thresholds) for low, high in ends])


def rows(name: str, side: Runs, mujoco: Runs, rule: StoppingRule) -> list[list[str]]:
    """The table's rows of a family; the rest of what is measured is printed."""
    designs, most = mujoco.passed.shape
    first, _ = side.until(rule)
    ordered, order = mujoco.until(rule, first)
    plain, _ = mujoco.until(rule)
    # Hindsight: the fewest runs of each design that decide, here and with any more, what the ordered sweep decided.
    enough = most
    while enough > 1 and verdicts(mujoco.passed, enough - 1, rule)[ordered.decided].all():
        enough -= 1
    fewest = int(verdicts(mujoco.passed, enough, rule).sum())
    everything = mujoco.cost([most] * designs)
    before = side.cost(first.runs)
    ways: list[tuple[str, Sequence[int] | NDArray[numpy.int_], float, int]] = [
        ("MuJoCo, all environments", [most] * designs, 0.0, int(verdicts(mujoco.passed, most, rule).sum())),
        ("MuJoCo, equally many, fewest in hindsight", [enough] * designs, 0.0, fewest),
        ("MuJoCo until decided", plain.runs, 0.0, int(plain.decided.sum())),
        ("both until decided, multibody first", ordered.runs, before, int(ordered.decided.sum())),
    ]
    tables = []
    for way, runs, extra, decided in ways:
        cost = mujoco.cost(runs) + extra
        share = f"{100 * cost / everything:.0f}"
        tables.append([name, way, f"{sum(runs)}", f"{decided} of {designs}", f"{cost:.0f}", share])
    print(
        f"{name}: multibody's runs {first.runs.sum()}, {before:.0f} s; of MuJoCo's time of the same runs "
        f"{100 * side.seconds.mean() / mujoco.seconds.mean():.0f} %"
    )
    # Designs on whose side the engines' verdicts part: when their first runs are made.
    here, there = (one.passed / one.runs for one in (ordered, first))
    zone = [numpy.searchsorted(rule.thresholds, rate) for rate in (here, there)]
    parted = numpy.flatnonzero(zone[0] != zone[1])
    places = [order.index(int(one)) + 1 for one in parted]
    listed = (parted + 1).tolist()
    print(f"  {len(parted)} designs on other sides in MuJoCo: in the order {sorted(places)}, in the listing {listed}")
    return tables


def correlation(side: Runs, mujoco: Runs) -> tuple[float, float, float]:
    """Within designs the correlation of outcomes; the ratio of costs; the best pairing's cost in that of MuJoCo alone."""
    a, b = (one.passed - one.passed.mean(axis=1, keepdims=True) for one in (side, mujoco))
    rho = float((a * b).sum() / numpy.sqrt((a**2).sum() * (b**2).sum()))
    ratio = float(side.seconds.mean() / mujoco.seconds.mean())
    return rho, ratio, float((numpy.sqrt(1 - rho**2) + numpy.sqrt(rho**2 * ratio)) ** 2)


def main(folder: Path, page: Path) -> None:
    """Sweep what is missing, and renew the table."""
    folder.mkdir(parents=True, exist_ok=True)
    borders = folder / "borders.json"
    borders.write_text(json.dumps(BORDERS), encoding="utf-8")
    rule = StoppingRule(None, (0.5, 0.75))
    table = [["family", "way", "runs in MuJoCo", "decided", "time, s", "%"]]
    table.append(["---"] * len(table[0]))
    paired = []
    for listing in (SCENARIOS / "width_study.json", borders):
        store = folder / f"{listing.stem}.db"
        side, mujoco = (measured(listing, store, engine) for engine in (MULTIBODY, MUJOCO))
        table += rows(NAMES[listing.stem], side, mujoco, rule)
        rho, ratio, cost = correlation(side, mujoco)
        paired.append(f"{NAMES[listing.stem]}: ρ = {rho:.2f}, c = {ratio:.2f}, {cost:.2f} times the cost")
    text = "".join(f"|{'|'.join(row)}|\n" for row in table) + f"\nPairing, {'; '.join(paired)} of MuJoCo alone.\n"
    with atomic_file(page) as binary:
        binary.write(replaced(page.read_text(encoding="utf-8"), page, BEGIN, END, text).encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
