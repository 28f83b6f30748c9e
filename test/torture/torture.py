"""Disturbs sweeps, outputs and trials at random for a while, and looks whether anything was lost.

Input: the environment's TORTURE_S (seconds), TORTURE_SEED, TORTURE_ONLY (name of a disturbance, or several with commas)
and TORTURE_ROUND (only this round). Output: a line a disturbance and a table of counts; exit code 1 at the first loss,
with the way to repeat it, and what is left of it in the folder that it names.
"""

import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))

import disks
import loggers
import processes
import sweeps
from study import SWEEP, LossError, digest, require_sound, write_listing

DISTURBANCES = {
    "sweep killed": sweeps.killed_client,
    "simulators and workers killed": sweeps.killed_simulators,
    "Ctrl-C or another signal": sweeps.interrupted,
    "two sweeps into one store": sweeps.two_sweeps,
    "file too large": disks.limited_file,
    "disk full": disks.full_disk,
    "disk read-only": disks.read_only_disk,
    "output killed or too large": disks.outputs,
    "trial disturbed": loggers.disturbed_log,
}


def main() -> int:
    """Disturb until the time is over."""
    seconds, seed = float(os.environ.get("TORTURE_S", "1800")), os.environ.get("TORTURE_SEED", "1")
    only = [name for name in os.environ.get("TORTURE_ONLY", "").split(",") if name]
    if unknown := set(only) - set(DISTURBANCES):
        print(f"TORTURE_ONLY: {', '.join(sorted(unknown))}: none of {', '.join(DISTURBANCES)}", file=sys.stderr)
        return 2
    base = Path(tempfile.mkdtemp(prefix="foldcar-torture-"))
    counts: Counter[str] = Counter()
    skipped: Counter[str] = Counter()
    start_s = time.monotonic()
    try:
        whole = prepare(base / "prepared")
        print(f"seed {seed}, {seconds:g} s; the undisturbed rows: {digest(whole)[:16]}", flush=True)
        for number, name in plan(seed, only):
            if time.monotonic() - start_s > seconds and counts:
                break
            folder = base / f"round-{number}"
            folder.mkdir()
            write_listing(folder)
            begin_s = time.monotonic()
            try:
                text = DISTURBANCES[name](folder, whole, random.Random(f"{seed} {number} {name}"))
            except LossError as loss:
                print(f"LOSS in round {number}, {name}: {loss}\nwhat is left of it: {folder}")
                print(f"again: make torture TORTURE_SEED={seed} TORTURE_ROUND={number}")
                return 1
            finally:
                for pid in processes.marked(folder):
                    processes.kill(pid)
            (skipped if text.startswith("skipped") else counts)[name] += 1
            print(f"{number:4} {time.monotonic() - begin_s:5.1f} s  {name}: {text}", flush=True)
            shutil.rmtree(folder)
    except BaseException:
        print(f"what is left of it: {base}")
        raise
    shutil.rmtree(base)
    print(f"\n{'disturbance':32} times, nothing lost")
    for name in DISTURBANCES:
        print(f"{name:32} {counts[name]:5}{f', {skipped[name]} skipped' if skipped[name] else ''}")
    print(f"{'together':32} {counts.total():5} in {time.monotonic() - start_s:.0f} s")
    return 0


def plan(seed: str, only: list[str]):
    """Numbers of rounds and their disturbances, all of them in a new order each time."""
    order, number = random.Random(seed), 0
    wanted = os.environ.get("TORTURE_ROUND") or None
    while True:
        names = list(DISTURBANCES)
        order.shuffle(names)
        for name in names:
            number += 1
            if wanted == str(number) or (wanted is None and (not only or name in only)):
                yield number, name
            if wanted == str(number):
                return


def prepare(folder: Path) -> Path:
    """The undisturbed store."""
    folder.mkdir()
    write_listing(folder)
    start_s = time.monotonic()
    code, _, errors = processes.ended(processes.start(folder, SWEEP))
    processes.sweep_s = time.monotonic() - start_s
    if code != 0:
        raise LossError(errors)
    require_sound(folder)
    (folder / "s.db").rename(folder / "whole.db")
    return folder / "whole.db"


if __name__ == "__main__":
    sys.exit(main())
