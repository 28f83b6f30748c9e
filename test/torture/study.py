"""The study that is disturbed, the rows of its undisturbed run, and what must be so after every disturbance."""

import contextlib
import json
import sqlite3
import subprocess
import sys
from pathlib import Path

from foldcar.store.check import store_digest
from foldcar.store.reader import Store
from forked_foldcar import original

BESIDE = """model model
ego = new Robot at (0, 0), facing -90 deg
new Goal at (Range(0.5, 0.6), 0), facing -90 deg
record ego.position.x as way
record final ego.position.y as side
"""
STEPS = Path(__file__).resolve().parents[2] / "scenarios" / "step_pyramids.scenic"
# Runs in carsim's batch, and fewer with Scenic beside the simulation, in cars that vary.
LISTING = {
    "experiments": {
        "1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 30, "environments": 25}},
        "2": {"veh_id": 1, "env_id": 2, "params": {"timeout": 5, "environments": 2, "variation": "workshop"}},
    },
    "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": {"from": 65, "to": 245, "step": 90}}}]}},
    "environments": {
        "1": {"scenic_filename": str(STEPS), "seed": 42},
        "2": {"scenic_filename": "beside.scenic", "seed": 5},
    },
}
FOLDCAR = [sys.executable, "-m", "foldcar"]
SWEEP = ["sweep", "l.json", "--store", "s.db", "--jobs", "2"]


class LossError(Exception):
    """Something was lost, or is there twice, in part, or other than it was."""


def write_listing(folder: Path) -> None:
    """The study's files."""
    (folder / "beside.scenic").write_text(BESIDE)
    (folder / "l.json").write_text(json.dumps(LISTING))


def rows(store: Path) -> list[str]:
    """Every place in the study that shows a result, without its rows' numbers, in alphabetical order."""
    with contextlib.closing(sqlite3.connect(f"{store.resolve().as_uri()}?mode=ro", uri=True)) as connection:
        found = connection.execute("SELECT * FROM result")
        at = [place for place, (name, *_) in enumerate(found.description) if not name.endswith("_id")]
        return sorted(json.dumps([row[place] for place in at]) for row in found)


def digest(store: Path) -> str:
    """What `foldcar export --digest` prints: of keys and results, whatever their order."""
    with Store.open(store) as opened:
        return store_digest(opened)[0]


def require_same(store: Path, undisturbed: Path, what: str) -> None:
    """LossError unless both stores hold the same results, each once."""
    found, expected = rows(store), rows(undisturbed)
    if found != expected:
        lost, new = sorted(set(expected) - set(found)), sorted(set(found) - set(expected))
        example = (lost or new or found)[0][:300]
        raise LossError(f"{what}: {len(lost)} rows are lost, {len(new)} are others; such as {example}")
    if digest(store) != digest(undisturbed):
        raise LossError(f"{what}: another digest")


def foldcar(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """An undisturbed command, to its end, in a copy of a process that has imported it all."""
    return original().run([*words], folder)


def require_sound(folder: Path, store: str = "s.db") -> None:
    """LossError unless `foldcar check` finds nothing."""
    answer = foldcar(folder, "check", store)
    if answer.returncode != 0:
        raise LossError(f"check of {store}: {answer.stdout}{answer.stderr}")


def resume(folder: Path, undisturbed: Path, store: str = "s.db") -> str:
    """Sweep to the end; LossError unless that succeeds, and gives a sound store with the rows of the undisturbed run."""
    words = [store if word == "s.db" else word for word in SWEEP]
    answer = foldcar(folder, *words)
    if answer.returncode != 0:
        raise LossError(f"the resumed sweep ended with {answer.returncode}: {answer.stderr}")
    require_sound(folder, store)
    require_same(folder / store, undisturbed, "after the resumed sweep")
    return answer.stdout.split(",", 2)[1].strip()
