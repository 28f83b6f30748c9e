"""Measures the speed of the width study and its parts; run it with `make bench`.

Output: a table of the study by `foldcar sweep` with one and two jobs, of the same runs in one `carsim` process that
measures its own times, of terrain slicing in a field of hills, and of Scenic's cost (scenic_way.py); a table of a part
of it in each engine, and in MuJoCo from Python (mujoco_way.py), by the processor time.
"""

import json
import os
import resource
import sqlite3
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from mujoco_way import python_factor
from rich.console import Console
from rich.table import Table
from scenic_way import OBJECTS, RUN_S, TURNS, sampling_ms, scenic_run_ms

from foldcar.study.experiments import read_study

PROJECT = Path(__file__).resolve().parents[1]
LISTING = PROJECT / "scenarios" / "width_study.json"
HILLS = PROJECT / "scenarios" / "gaussian_hills.json"
TURNS_OF_SPEED = 20
CARSIM = PROJECT / ".pio" / "build" / "carsim" / "program"
CARSIM_MUJOCO = PROJECT / ".pio" / "build" / "carsim_mujoco" / "program"
FOLDCAR = Path(sys.executable).with_name("foldcar")


@dataclass(frozen=True)
class Timed:
    """Wall time (s) and peak memory (MB, the largest process) of a command."""

    wall_s: float
    peak_mb: float


def run(*arguments: str | Path) -> Timed:
    """Run a foldcar command without output; the benchmark exits if it fails."""
    command = [str(FOLDCAR), *map(str, arguments)]
    start_s = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {process.returncode}")
    return Timed(time.perf_counter() - start_s, usage.ru_maxrss / 1024)


def sweep(
    store: Path, jobs: int, environments: int | None = None, listing: Path = LISTING, engine: str = "multibody"
) -> Timed:
    """Sweep the study, or another listing, into a new store."""
    more = () if environments is None else ("--samples", str(environments))
    return run("sweep", listing, "--store", store, "--jobs", str(jobs), "--engine", engine, "--realities", "0", *more)


def batch_lines(store: Path) -> str:
    """The input of `carsim batch` for all runs of a store, as in the sweep."""
    connection = sqlite3.connect(f"{store.as_uri()}?mode=ro", uri=True)

    def named(kind: str, prefix: str) -> list[str]:
        rows = connection.execute(f"SELECT id, json FROM {kind} ORDER BY id")
        return [json.dumps({kind: {"id": f"{prefix}{key}", **json.loads(text)}}) for key, text in rows]

    lines = named("body", "b") + named("scene", "s")
    runs = connection.execute(
        "SELECT body_id, scene_id, json FROM run JOIN settings ON settings.id = settings_id ORDER BY scene_id, body_id"
    )
    for index, (body, scene, settings) in enumerate(runs):
        identity = {"id": str(index), "body": f"b{body}", "scene": f"s{scene}"}
        lines.append(json.dumps({"run": {**identity, **json.loads(settings)}}))
    connection.close()
    return "\n".join(lines) + "\n"


def carsim_timing(lines: str, *command: Path | str) -> dict[str, float]:
    """The times (s) that `carsim batch --timing` reports."""
    answer = subprocess.run(
        [*command, "batch", "--timing"],
        input=lines,
        text=True,
        capture_output=True,
        check=True,
    )
    timing: dict[str, float] = json.loads(answer.stderr.splitlines()[-1])["timing"]
    return timing


def speeds(lines: str, *commands: tuple[Path | str, ...]) -> list[float]:
    """Simulated seconds a second of processor time of each command, settling, start and terrain included.

    The best of TURNS_OF_SPEED, taken by turns: what else a machine does can only make a command slower.
    """
    best = [0.0] * len(commands)
    for _ in range(TURNS_OF_SPEED):
        for index, command in enumerate(commands):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            simulated_s = carsim_timing(lines, *command)["simulated_s"]
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            took_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            best[index] = max(best[index], simulated_s / took_s)
    return best


def scenic_seconds(samples: int) -> float:
    """Wall time (s) to import Scenic, compile the study's program and sample its scenes, in a new process."""
    experiment = read_study(LISTING).experiments[0]
    return run("sample", experiment.program, "-n", str(samples), "--seed", str(experiment.seed)).wall_s


def main() -> None:
    """Measure and print the table."""
    console = Console()
    with tempfile.TemporaryDirectory() as folder, console.status("the study, 1 job") as status:
        one_store, two_store = Path(folder, "1.db"), Path(folder, "2.db")
        one = sweep(one_store, 1)
        status.update("the study, 2 jobs")
        two = sweep(two_store, 2)
        again = sweep(two_store, 2)
        status.update("its report")
        report = run("report", two_store, "-o", Path(folder, "report"))
        status.update("a quarter of the study, for its memory")
        quarter = sweep(Path(folder, "quarter.db"), 2, environments=25)
        status.update("the same runs inside carsim")
        lines = batch_lines(two_store)
        timing = carsim_timing(lines, CARSIM)
        runs = lines.count('{"run"')
        status.update("a part of the study in MuJoCo")
        solid_store = Path(folder, "mujoco.db")
        sweep(solid_store, 2, environments=3, engine="mujoco")
        some = batch_lines(solid_store)
        status.update("the same runs in each engine")
        multibody, side_view, mujoco = speeds(some, (CARSIM,), (CARSIM, "--side-view"), (CARSIM_MUJOCO,))
        factors = [
            ("multibody", "yes", multibody),
            ("side view (Box2D)", "yes", side_view),
            ("MuJoCo", "yes", mujoco),
            ("MuJoCo from Python, exported model", "no", python_factor(solid_store)),
        ]
        status.update("a field of hills")
        hills_store = Path(folder, "hills.db")
        sweep(hills_store, 2, listing=HILLS)
        hills = carsim_timing(batch_lines(hills_store), CARSIM)
        status.update("Scenic alone")
        scenic_s = scenic_seconds(100)
        many_ms = [(turn, sampling_ms(turn)) for turn in TURNS]
        status.update("Scenic beside the simulation")
        beside_ms = scenic_run_ms(CARSIM)

    wall_s = timing["wall_s"]
    outside = 1 - timing["physics_s"] / wall_s
    table = Table("what", "measured", title=f"{runs} runs of the width study on {os.cpu_count()} processors")
    table.columns[1].justify = "right"
    rows = [
        ("real-time factor of one core, firmware in the loop", f"{timing['simulated_s'] / wall_s:.0f} ×"),
        ("share of the equations of motion and contact impulses", f"{100 * timing['physics_s'] / wall_s:.1f} %"),
        ("share of everything else", f"{100 * outside:.1f} %"),
        ("  of which finding contacts", f"{100 * timing['terrain_s'] / wall_s:.1f} %"),
        ("  of which the firmware", f"{100 * timing['firmware_s'] / wall_s:.2f} %"),
        ("finding contacts among 20 hills", f"{100 * hills['terrain_s'] / hills['wall_s']:.1f} %"),
        ("whole study, 1 job", f"{one.wall_s:.1f} s, {runs / one.wall_s:.0f} runs/s"),
        ("whole study, 2 jobs", f"{two.wall_s:.1f} s, {runs / two.wall_s:.0f} runs/s"),
        ("whole study, 2 jobs against 1", f"{one.wall_s / two.wall_s:.2f} ×"),
        ("the same study again, nothing to run", f"{again.wall_s:.1f} s"),
        ("Scenic: import, compile, sample 100 scenes", f"{scenic_s:.1f} s"),
        ("  share of the whole study, 2 jobs", f"{100 * scenic_s / two.wall_s:.0f} %"),
        (f"Scenic: sample a scene of {OBJECTS} objects", ""),
        *((f"  {turn}", f"{ms:.1f} ms") for turn, ms in many_ms),
        (f"Scenic beside a run of {RUN_S:g} s, without the physics", f"{beside_ms:.0f} ms"),
        ("report", f"{report.wall_s:.1f} s"),
        ("peak memory of the host, whole study", f"{two.peak_mb:.0f} MB"),
        ("peak memory of the host, a quarter of it", f"{quarter.peak_mb:.0f} MB"),
    ]
    for row in rows:
        table.add_row(*row)
    console.print(table)
    count = some.count('{"run"')
    title = f"{count} of these runs on one core, by its processor time"
    table = Table("engine", "firmware", "× real time", "multibody faster by, ×", title=title)
    table.columns[2].justify = table.columns[3].justify = "right"
    for name, firmware, factor in factors:
        table.add_row(name, firmware, f"{factor:.0f}", f"{multibody / factor:.2g}")
    console.print(table)


if __name__ == "__main__":
    main()
