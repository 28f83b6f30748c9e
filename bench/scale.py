"""Measures how the cost of a family grows with its runs: `bench/scale.py FOLDER` (docs/performance.md).

Output: for 10³, 10⁴, … runs of scenarios/kerb.json a row of a table: the sweep, the same sweep again with nothing to do,
and the report. Each size begins with the store of the one before. Processor times are those of the client, foldcar's own
process, and apart from it of those it starts: carsim and, where cars are to be folded, one that has Scenic. Other load
hardly changes them. `--most 1000000` takes 21 minutes on two processors.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

PROJECT = Path(__file__).resolve().parents[1]
LISTING = PROJECT / "scenarios" / "kerb.json"
DESIGNS = 1000
# Runs a foldcar command in its process and writes what that took.
MEASURED = """
import atexit, json, resource, sys, time
start_s, out = time.perf_counter(), sys.argv[1]
def told():
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    told = {"wall_s": time.perf_counter() - start_s, "own_s": own.ru_utime + own.ru_stime,
            "others_s": others.ru_utime + others.ru_stime, "peak_mb": own.ru_maxrss / 1024}
    open(out, "w").write(json.dumps(told))
atexit.register(told)
sys.argv = ["foldcar", *sys.argv[2:]]
from foldcar.cli import main
main()
"""


def measured(folder: Path, *words: str) -> dict[str, float]:
    """Wall time, processor time of the process and of those that it started (s), its peak memory (MB)."""
    out = folder / "measured.json"
    done = subprocess.run([sys.executable, "-c", MEASURED, out, *words], stdout=subprocess.DEVNULL)
    if done.returncode != 0:
        sys.exit(f"foldcar {' '.join(words)}: exit code {done.returncode}")
    result: dict[str, float] = json.loads(out.read_text())
    return result


def sizes(most: int) -> list[int]:
    """Numbers of runs: powers of ten from that of the designs."""
    sizes = [DESIGNS]
    while sizes[-1] * 10 <= most:
        sizes.append(sizes[-1] * 10)
    return sizes


def row(folder: Path, runs: int, before: int, jobs: int) -> list[str]:
    """The measurements of one size."""
    store = folder / "kerb.db"
    sweep = ["sweep", str(LISTING), "--store", str(store), "--samples", str(runs // DESIGNS), "--jobs", str(jobs)]
    sweep += ["--realities", "0"]
    made, again = measured(folder, *sweep), measured(folder, *sweep)
    report = measured(folder, "report", str(store), "-o", str(folder / f"report_{runs}"))
    new = runs - before
    numbers: list[Any] = [
        f"{runs:,}", f"{made['wall_s']:.1f}", f"{made['own_s']:.1f}", f"{1000 * made['own_s'] / new:.3f}",
        f"{1000 * made['others_s'] / new:.2f}", f"{made['peak_mb']:.0f}", f"{store.stat().st_size / 1e6:.1f}",
        f"{again['own_s']:.1f}", f"{report['own_s']:.1f}", f"{report['peak_mb']:.0f}",
    ]  # fmt: skip
    return numbers


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="for the store and the reports; new")
    parser.add_argument("--most", type=int, default=100_000, help="runs of the largest size")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True)
    table = Table(
        "runs", "sweep, wall s", "its client, s", "ms a new run", "others, ms a new run", "client, MB", "store, MB",
        "again, s", "report, s", "report, MB", title="processor time, unless it says wall",
    )  # fmt: skip
    before = 0
    for runs in sizes(chosen.most):
        table.add_row(*row(chosen.folder, runs, before, chosen.jobs))
        before = runs
        Console(width=160).print(table)


if __name__ == "__main__":
    main()
