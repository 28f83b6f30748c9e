"""The whole method on a truth that the analysis does not know: run as `python docs/synthetic_study.py FOLDER`.

Cars and ground of reality.json stand for the real world: `foldcar link` poses as each car on USB. The study is swept with
the nominal simulator; `select` names cars, `log` drives their trials, `compare` and `calibrate` learn from them, `select`
names more. At the end the truth is swept too, and the answers are held against it; the exit code is 1 if one is wrong.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

PROGRAM = Path(__file__).resolve().parent.parent / "scenarios" / "step_pyramids.scenic"
# Steps that weak servos climb too.
PYRAMIDS = {
    "step_height": 0.0215, "top_side": 0.07, "tread": 0.04, "offset": 0.05, "near_x": 0.45, "far_x": 0.9, "friction": 0.6
}  # fmt: skip
REALITY = {
    "obstacle_height": 1.2,
    "servo_torque": 0.75,
    "com_height_m": 0.01,
    "track_m": 0.012,
    "start_heading_sd_rad": 0.06,
}
THRESHOLD = 0.5
SPEEDUP = "8"
# A car whose clock runs faster than its host's waits longer for it.
PATIENCE = "CMD_TIMEOUT_MS 5000\nARM_TIMEOUT_S 60\n"


def main() -> int:
    """Make the study in the folder named on the command line. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="new or empty folder for listing, stores and logs")
    parser.add_argument("--cars", type=int, default=5, help="cars to build in each of two rounds")
    parser.add_argument("--trials", type=int, default=8, help="trials of each car")
    parser.add_argument("--environments", type=int, default=100, help="sampled environments")
    parser.add_argument("--step", type=float, default=10, help="widths are 65 to 185 mm in these steps")
    given = parser.parse_args()
    folder: Path = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    listing = write_listing(folder, given.environments, given.step)
    study, reality = folder / "study.db", folder / "reality.json"

    run("sweep", listing, "--store", study)
    for number in (1, 2):
        chosen = select(study, given.cars)
        show(f"round {number}: {chosen['sentence']}")
        for car in chosen["recommendations"]:
            width = f"width={car['design']['width_mm']:g}"
            # Each round builds a new car.
            for sample in chosen["environments"][: given.trials]:
                drive(listing, study, reality, width, sample, f"{width} of round {number}")
        run("compare", study, "--simulated-trials", "--experiment", "1")
        run("calibrate", study, "--simulated-trials", "--runs", "12000", "--name", f"round{number}")
        run("sweep", listing, "--store", study, "--calibration", f"round{number}")
    answer = select(study, given.cars)
    show(f"answer: {answer['sentence']}")
    run("report", study, "--simulated-trials", "-o", folder / "report")

    run("sweep", listing, "--store", folder / "truth.db", "--reality", reality)
    return judge(folder, answer)


def write_listing(folder: Path, environments: int, step: float) -> Path:
    """Write listing and reality; returns the listing's path."""
    (folder / "reality.json").write_text(json.dumps(REALITY, indent=2))
    (folder / "patience.parm").write_text(PATIENCE)
    experiment = {"timeout": 60, "environments": environments, "threshold": THRESHOLD}
    common = {"width": {"from": 65, "to": 185, "step": step}, "height": 50, "radius": 60}
    lengths = [{"common": common}, {"W": {"length": 60}}, {"B": {"length": 80}}]
    data = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": experiment}},
        "vehicles": {"1": {"type": "W_B_W", "params": lengths}},
        "environments": {"1": {"scenic_filename": str(PROGRAM), "seed": 7, "scenic_params": PYRAMIDS}},
    }
    file = folder / "study.json"
    file.write_text(json.dumps(data, indent=2))
    return file


def select(study: Path, cars: int) -> Any:
    """What `foldcar select` says, as it prints it with --json."""
    words = ("select", study, "--build", str(cars), "--simulated-trials", "--experiment", "1", "--json")
    return json.loads(run(*words, quiet=True))["experiments"][0]


def drive(listing: Path, study: Path, reality: Path, width: str, sample: int, car: str) -> None:
    """One trial of a car that `foldcar link` poses as. A busy machine that lets a car wait aborts it: then once more."""
    chosen: list[str | Path] = ["--experiment", "1", "--sample", str(sample), "--car", car]
    words: list[str | Path] = ["link", listing, *chosen, "--set", width]
    words += ["--reality", reality, "--speedup", SPEEDUP]
    for _ in range(5):
        with subprocess.Popen(command(words), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as car:
            assert car.stdout is not None
            port = car.stdout.readline().strip()
            patience: list[str | Path] = ["params", "load", reality.with_name("patience.parm"), "--port", port]
            subprocess.run(command(patience), stdout=subprocess.DEVNULL, check=True)
            logged: list[str | Path] = ["log", listing, *chosen, "--store", study, "--port", port, "--trials", "1"]
            done = subprocess.run(command([*logged, "--countdown", "0", "--yes"]), capture_output=True, text=True)
            car.terminate()
        if done.returncode == 0:
            show(f"{width}, sample {sample}: {done.stdout.strip().splitlines()[-1]}")
            return
    raise SystemExit(f"{width}, sample {sample}: {done.stderr.strip()}")


def judge(folder: Path, answer: Any) -> int:
    """Hold the answer and the last calibration against the true rates. Returns the exit code."""
    true = rates(folder / "truth.db", None)
    nominal = rates(folder / "study.db", "1")
    calibrated = rates(folder / "study.db", "1 (calibrated round2)")
    show("width  true  nominal  calibrated (%)")
    for width, rate in true.items():
        show(f"{width:5g} {100 * rate:5.0f} {100 * nominal[width]:8.0f} {100 * calibrated[width]:11.0f}")
    errors = [
        sum(abs(found[width] - rate) for width, rate in true.items()) / len(true) for found in (nominal, calibrated)
    ]
    best = max(true, key=lambda width: true[width])
    leader = answer["leader"]["width_mm"]
    loss = true[best] - true[leader]
    show(f"best {best:g} mm, {100 * true[best]:.0f} %; found {leader:g} mm, {100 * true[leader]:.0f} %")
    show(f"mean error of rates: nominal {100 * errors[0]:.0f}, calibrated {100 * errors[1]:.0f} points")
    right = loss <= 0.1 and errors[1] < errors[0]
    show("right" if right else "WRONG")
    return 0 if right else 1


def rates(store: Path, experiment: str | None) -> dict[float, float]:
    """Share of passed runs by width; ``experiment`` None: of the only one."""
    import foldcar

    runs = foldcar.Study(store).runs
    chosen = runs if experiment is None else runs[runs["experiment"] == experiment]
    return dict(chosen.groupby("width_mm")["passed"].mean())


def run(*words: str | Path, quiet: bool = False) -> str:
    """Run a command of foldcar and show what it prints; returns that."""
    if not quiet:
        show("$ foldcar " + " ".join(str(word) for word in words))
    done = subprocess.run(command(words), stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise SystemExit(f"foldcar {words[0]}: exit code {done.returncode}")
    if not quiet:
        show(done.stdout)
    return done.stdout


def command(words: Sequence[str | Path]) -> list[str]:
    """foldcar with these words, in the Python that runs this script."""
    return [sys.executable, "-m", "foldcar", *(str(word) for word in words)]


def show(line: str) -> None:
    """Print at once, for pipes too."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
