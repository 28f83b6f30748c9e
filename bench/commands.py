"""Measures the processor time of each command on the width study and writes the table of docs/performance.md.

Usage: commands.py FOLDCAR [PAGE]     a program, perhaps of another commit; without a page the table is printed only

Each command is run three times; the smallest time counts, because other work only adds to it. Commands that need a car on
USB are left out.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PROJECT / "tools"))
from page_block import replaced  # noqa: E402

BEGIN, END = "<!-- commands: written by bench/commands.py -->", "<!-- end of commands -->"
REPETITIONS = 3
WIDTH_STUDY = str(PROJECT / "scenarios/width_study.json")
CARS = str(PROJECT / "patterns/published_cars.json")
# What the table says of a command, and its words. `new.db` is removed before each repetition, what `-o` names too.
COMMANDS = (
    ("`--help`", ["--help"]),
    ("`sample`, 9 scenes", ["sample", str(PROJECT / "scenarios/step_pyramids.scenic"), "-n", "9", "-o", "scenes"]),
    ("`run`", ["run", WIDTH_STUDY, "--experiment", "1", "--set", "width=115"]),
    ("`sweep`, 37 runs", ["sweep", WIDTH_STUDY, "--store", "new.db", "--samples", "1", "--realities", "0"]),
    ("`sweep`, 3,700 runs that the store has", ["sweep", WIDTH_STUDY, "--store", "study.db"]),
    ("`select`", ["select", "study.db"]),
    ("`compare`, 44 trials", ["compare", "study.db"]),
    ("`report`", ["report", "study.db", "-o", "page"]),
    ("`export --csv`", ["export", "study.db", "--csv", "runs.csv"]),
    ("`trials list`", ["trials", "list", "study.db"]),
    ("`check`", ["check", "study.db"]),
    ("`merge`", ["merge", "study.db", "study.db", "-o", "merged.db"]),
    ("`pattern`, w95", ["pattern", CARS, "--vehicle", "w95", "-o", "car"]),
    ("`view`", ["view", CARS, "--vehicle", "w95", "-o", "car.html"]),
    ("`model`", ["model", WIDTH_STUDY, "--vehicle", "1", "--set", "width=95", "--to", "mjcf", "-o", "models"]),
    ("`doctor`", ["doctor"]),
)
MADE = ("scenes", "new.db", "page", "runs.csv", "merged.db", "car", "car.html", "models")


def processor_time_s(foldcar: str, words: Sequence[str], folder: Path) -> float:
    """Return the user and system time of a command and its children. The program exits if the command fails."""
    process = subprocess.Popen(
        [foldcar, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    # `doctor` ends with 1 where something is missing.
    if process.returncode not in (0, 1):
        sys.exit(f"commands: foldcar {' '.join(words)}: exit code {process.returncode}: {errors}")
    return usage.ru_utime + usage.ru_stime


def measure(foldcar: str) -> list[str]:
    """Return the rows of the table."""
    rows = ["|command|processor time, s|", "|---|---|"]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        sweep_s = processor_time_s(foldcar, ["sweep", WIDTH_STUDY, "--store", "study.db"], folder)
        rows.append(f"|`sweep`, the whole study|{sweep_s:.0f}|")
        trials = str(PROJECT / "scenarios/published_trials.csv")
        processor_time_s(foldcar, ["trials", "import", "study.db", trials], folder)
        for name, words in COMMANDS:
            times_s = []
            for _ in range(REPETITIONS):
                for made in MADE:
                    path = folder / made
                    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
                times_s.append(processor_time_s(foldcar, words, folder))
            rows.append(f"|{name}|{min(times_s):.1f}|")
            print(rows[-1], file=sys.stderr, flush=True)
    return rows


def main() -> None:
    """Run the command line."""
    table = "\n".join(measure(sys.argv[1])) + "\n"
    if len(sys.argv) > 2:
        page = Path(sys.argv[2])
        page.write_text(replaced(page.read_text("utf-8"), page, BEGIN, END, table), encoding="utf-8")
    else:
        print(table)


if __name__ == "__main__":
    main()
