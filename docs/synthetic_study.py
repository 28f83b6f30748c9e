"""Applies the whole method to a truth that the analysis does not know: run as `python docs/synthetic_study.py FOLDER`.

The real world is MuJoCo's. Parameters of the simulator are off their nominal values there, and it has properties without
a parameter: soft tyres that lean, a centre of mass to one side, a supply that sags. `foldcar link` simulates each built
car on USB.

The study is swept with nominal values and in other realities. In two rounds `select` names designs, and `log` drives
trials of cars of these designs. After the first round, obstacles and cars are measured. Finally `select` names the
leader. Then the truth is swept and the answer is compared with it. The exit code is 1 if the answer is wrong.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = ROOT / "scenarios" / "step_pyramids.scenic"
# Steps that weak servos climb too.
PYRAMIDS = {
    "step_height": 0.0215, "top_side": 0.07, "tread": 0.04, "offset": 0.05, "near_x": 0.45, "far_x": 0.9, "friction": 0.6
}  # fmt: skip
REALITY = {
    "obstacle_height": 1.2, "servo_torque": 0.75, "com_height_m": 0.01, "track_m": 0.008, "start_heading_sd_rad": 0.06,
    "wheel_spread": 1.0,
    # No run in another reality has these.
    "wheel_camber_rad": -0.035, "tyre_contact_time_s": 0.02, "com_y_m": 0.006, "supply_resistance_ohm": 0.3,
}  # fmt: skip
# As measured, with errors of 2 %, 2 mm and 0.5 mm.
MEASURED = {"obstacle_height": 1.18, "com_height_m": 0.012, "track_m": 0.0075}
THRESHOLD = 0.5
# The chosen design may pass by so much less often than the best one.
LOSS = 0.05
CARS_OF_A_DESIGN = 2
SPEEDUP = "4"
# A car whose clock runs faster than its host's waits longer for it.
PATIENCE = {"CMD_TIMEOUT_MS": 5000, "ARM_TIMEOUT_S": 60}


class Setting(NamedTuple):
    """How large the study is: ``designs`` of each round."""

    designs: tuple[int, ...] = (3, 2)
    trials: int = 24
    environments: int = 100
    step_mm: float = 10
    realities: int | None = None


QUICK = Setting(designs=(1, 1), trials=4, environments=20, step_mm=40, realities=200)


class Trial(NamedTuple):
    """A trial to drive: a car of a design in a sampled environment."""

    width_mm: float
    car: str
    sample: int


def main() -> int:
    """Make the study in the folder named on the command line. Returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="new or empty folder for listing, stores, logs and picture")
    parser.add_argument("--quick", action="store_true", help="two designs and four trials: too few for a right answer")
    given = parser.parse_args()
    folder: Path = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    setting = QUICK if given.quick else Setting()
    listing = write_listing(folder, setting)
    study = folder / "study.db"

    realities = () if setting.realities is None else ("--realities", str(setting.realities))
    run("sweep", listing, "--store", study, *realities)
    for designs in setting.designs:
        chosen = select(study, designs)
        show(f"to build: {chosen['works']} {chosen['learn']}")
        for trial in planned(chosen, setting.trials // len(setting.designs)):
            drive(listing, study, trial)
        run("trials", "measure", study, *(f"{name}={value}" for name, value in MEASURED.items()))
    run("compare", study, "--simulated-trials")
    answer = select(study, setting.designs[-1])
    show(f"answer: {answer['works']} {answer['learn']}")

    sweep_truth(listing, folder / "truth.db", 4 * setting.environments)
    return judge(folder, setting, answer)


def write_listing(folder: Path, setting: Setting) -> Path:
    """Write listing and reality; returns the listing's path."""
    (folder / "reality.json").write_text(json.dumps(REALITY, indent=2))
    experiment = {"timeout": 60, "environments": setting.environments, "threshold": THRESHOLD}
    common = {"width": {"from": 65, "to": 185, "step": setting.step_mm}, "height": 50, "radius": 60}
    lengths = [{"common": common}, {"W": {"length": 60}}, {"B": {"length": 80}}]
    data = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": experiment}},
        "vehicles": {"1": {"type": "W_B_W", "params": lengths}},
        "environments": {"1": {"scenic_filename": str(PROGRAM), "seed": 7, "scenic_params": PYRAMIDS}},
    }
    file = folder / "study.json"
    file.write_text(json.dumps(data, indent=2))
    return file


def select(study: Path, designs: int) -> Any:
    """What `foldcar select` prints with --json, with the ``widths`` of the best steps' designs, so many at most."""
    chosen = json.loads(run("select", study, "--simulated-trials", "--json", quiet=True))["experiments"][0]
    widths = dict.fromkeys(step["design"]["width_mm"] for step in chosen["steps"] if step["design"])
    chosen["widths"] = list(widths)[:designs]
    return chosen


def planned(chosen: Any, number: int) -> list[Trial]:
    """So many trials in turns: each design's cars one after the other, each design in the order of the environments."""
    widths = chosen["widths"]
    samples = chosen["environments"]
    trials = []
    # Without widths, another afternoon is not worth it.
    for k in range(number if widths else 0):
        width_mm, turn = widths[k % len(widths)], k // len(widths)
        car = f"{width_mm:g}{'ab'[turn % CARS_OF_A_DESIGN]}"
        trials.append(Trial(width_mm, car, samples[turn % len(samples)]))
    return trials


def drive(listing: Path, study: Path, trial: Trial) -> None:
    """Drive a trial of a car that `foldcar link` simulates; repeat it if a busy machine aborts it."""
    folder, width = listing.parent, f"width={trial.width_mm:g}"
    chosen: list[str | Path] = ["--experiment", "1", "--sample", str(trial.sample), "--car", trial.car]
    words: list[str | Path] = ["link", listing, *chosen, "--set", width, "--engine", "mujoco", "--speedup", SPEEDUP]
    words += ["--reality", folder / "reality.json"]
    for _ in range(5):
        with subprocess.Popen(command(words), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as car:
            assert car.stdout is not None
            port = car.stdout.readline().strip()
            for name, value in PATIENCE.items():
                patience: list[str | Path] = ["params", "set", name, str(value), "--port", port]
                subprocess.run(command(patience), stdout=subprocess.DEVNULL, check=True)
            logged: list[str | Path] = ["log", listing, *chosen, "--store", study, "--port", port, "--trials", "1"]
            done = subprocess.run(command([*logged, "--countdown", "0", "--yes"]), capture_output=True, text=True)
            car.terminate()
        if done.returncode == 0:
            import foldcar

            last = foldcar.Study(study).trials.iloc[-1]
            show(f"{last['trial']}: car {trial.car}, sample {trial.sample}: {last['outcome']}")
            return
    raise SystemExit(f"car {trial.car}, sample {trial.sample}: {done.stderr.strip()}")


def sweep_truth(listing: Path, store: Path, environments: int) -> None:
    """The true rates of a listing's designs in so many environments."""
    reality = ("--engine", "mujoco", "--reality", listing.parent / "reality.json")
    run("sweep", listing, "--store", store, "--samples", str(environments), *reality)


def judge(folder: Path, setting: Setting, answer: Any) -> int:
    """Hold the answer against the true rates. Returns the exit code."""
    true, nominal = rates(folder / "truth.db"), rates(folder / "study.db")
    show("width  true  nominal (%)")
    for width, rate in true.items():
        show(f"{width:5g} {100 * rate.value:5.0f} {100 * nominal[width].value:8.0f}")
    errors = [abs(nominal[width].value - rate.value) for width, rate in true.items()]
    show(f"nominal rates: {100 * sum(errors) / len(errors):.0f} points off (mean), {100 * max(errors):.0f} at most")
    draw(folder, true, nominal)
    if answer["leader"] is None:
        show("WRONG: no design leads")
        return 1
    leader = answer["leader"]["width_mm"]
    # Those that may be the best are counted again, so often that chance hardly tells which is.
    least = max(rate.low for rate in true.values())
    again = json.loads((folder / "study.json").read_text())
    again["vehicles"]["1"]["params"][0]["common"]["width"] = [
        width for width, rate in true.items() if rate.high >= least or width == leader
    ]
    (folder / "best.json").write_text(json.dumps(again, indent=2))
    sweep_truth(folder / "best.json", folder / "best.db", 20 * setting.environments)
    counted = rates(folder / "best.db")
    best = max(counted, key=lambda width: counted[width].value)
    loss = counted[best].value - counted[leader].value
    highest = max(rate.value for rate in nominal.values())
    naive = [true[width].value for width, rate in nominal.items() if rate.value == highest]
    show(f"best {best:g} mm, {100 * counted[best].value:.1f} %; found {leader:g} mm, {100 * counted[leader].value:.1f} %"
         f"; the nominal simulator's best: {100 * min(naive):.0f} to {100 * max(naive):.0f} %")  # fmt: skip
    right = loss <= LOSS
    show("right" if right else "WRONG")
    return 0 if right else 1


def rates(store: Path) -> dict[float, Any]:
    """The simulated rates of a store's only experiment, with their intervals, by width."""
    import foldcar

    study = foldcar.Study(store)
    widths = sorted(set(study.runs["width_mm"]))
    return {width: study.rate(width_mm=width) for width in widths}


def draw(folder: Path, true: dict[float, Any], nominal: dict[float, Any]) -> None:
    """The rates over the widths, and the trials that were learned from, in rates.png."""
    from matplotlib import pyplot

    import foldcar

    figure, axes = pyplot.subplots(figsize=(7, 4), layout="constrained")
    looks = {"truth": ("black", "o-"), "nominal": ("tab:blue", "s--")}
    for (name, (colour, style)), one in zip(looks.items(), (true, nominal), strict=True):
        middle = [100 * rate.value for rate in one.values()]
        low, high = ([100 * getattr(rate, end) for rate in one.values()] for end in ("low", "high"))
        axes.fill_between(list(one), low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(list(one), middle, style, color=colour, label=name, markersize=4)
    trials = foldcar.Study(folder / "study.db").trials.groupby("width_mm")["passed"]
    for width, (passed, count) in trials.agg(["sum", "count"]).iterrows():
        axes.plot(width, 100 * passed / count, "x", color="tab:red", markersize=8)
        axes.annotate(f"{passed:g}/{count:g}", (width, 100 * passed / count), xytext=(4, 4), textcoords="offset points",
                      color="tab:red", fontsize=8)  # fmt: skip
    axes.plot([], [], "x", color="tab:red", label="trials")
    axes.set(xlabel="width (mm)", ylabel="passed (%)", ylim=(-4, 104))
    axes.legend(frameon=False, ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.12))
    figure.savefig(folder / "rates.png", dpi=120)


def run(*words: str | Path, quiet: bool = False) -> str:
    """Run a command of foldcar and show what it prints, and how long it took; returns that."""
    begun_s = time.monotonic()
    if not quiet:
        show("$ foldcar " + " ".join(str(word) for word in words))
    done = subprocess.run(command(words), stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise SystemExit(f"foldcar {words[0]}: exit code {done.returncode}")
    if not quiet:
        show(f"{done.stdout}({time.monotonic() - begun_s:.0f} s)")
    return done.stdout


def command(words: Sequence[str | Path]) -> list[str]:
    """foldcar with these words, in the Python that runs this script."""
    return [sys.executable, "-m", "foldcar", *(str(word) for word in words)]


def show(line: str) -> None:
    """Print at once, for pipes too."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
