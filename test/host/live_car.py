"""A simulated car at a port and the records of its trials, for tests of `foldcar log` and related commands."""

import contextlib
import json
import subprocess
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json, car_json
from foldcar.car.design import compose
from foldcar.link.car import greeted as greeted
from foldcar.link.simulated_car import SimulatedCar, simulated_car
from foldcar.link.tlog import read_tlog
from foldcar.scenes.fingerprint import scene_name
from foldcar.scenes.source import open_environment
from foldcar.simulation.engines import find_carsim
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial
from study_car import empty_scene, listing_of

# A course without obstacles: at 0.69 m/s the goal is 1.45 s away.
FREE_COURSE = """
model model
ego = new Robot at (0, 0), facing -90 deg
block = new Bump at (0.5, 0.6), facing -90 deg
goal = new Goal at (1.0, 0), facing -90 deg
"""
SAMPLES = 2
# A simulation waits for a silent host if it is faster than real time.
WAITING_SPEEDUP = 1.001
LOG = ("log", "l.json", "--experiment", "1", "--store", "s.db")


def write_free_course(folder: Path, timeout_s: float = 3) -> Path:
    """Write l.json, a listing of two widths on the free course with two samples and this time limit; returns it."""
    (folder / "free.scenic").write_text(FREE_COURSE)
    data = listing_of("free.scenic", {"width": [95, 120]}, seed=1, timeout=timeout_s, environments=SAMPLES)
    (folder / "l.json").write_text(json.dumps(data))
    return folder / "l.json"


@cache
def free_course_scene() -> dict[str, Any]:
    """Sample 0 of the free course."""
    with tempfile.TemporaryDirectory() as folder:
        write_free_course(Path(folder))
        return open_environment(Path(folder) / "free.scenic", {}, 1).sample(0)


@contextlib.contextmanager
def car_at_port(
    width: float = 95.0, goal_x_m: float | None = 1.0, tcp: bool = False, waits: bool = True, **servo: float
) -> Iterator[SimulatedCar]:
    """A simulated car with its goal at ``goal_x_m`` (m), whose scenes have the names of samples of the free course.

    If it ``waits``, a host that a busy machine delays by less than a second does not become silent on the car's clock.
    ``servo`` sets the true values of all its servos.
    """
    design = compose("W_B_W", {"width": width})
    body = body_json(design)
    for wheel in body["wheels"]:
        wheel["servo"].update(servo)
    scene, named = empty_scene(goal_x_m=goal_x_m), free_course_scene()
    worlds = [({**scene, "id": scene_name(named, k)}, {}) for k in range(SAMPLES)]
    port = 0 if tcp else None
    speedup = WAITING_SPEEDUP if waits else 1.0
    with simulated_car([str(find_carsim())], body, worlds, car_json(design), speedup, port, subprocess.PIPE) as car:
        yield car


def inject(car: SimulatedCar, **what: Any) -> None:
    """Send the car's process a command that injects a fault (docs/carsim.md)."""
    assert car.process.stdin is not None
    car.process.stdin.write(json.dumps(what) + "\n")
    car.process.stdin.flush()


def injected_s(car: SimulatedCar, **what: Any) -> float:
    """Inject a fault, and return the simulated time (s) at which the car has it; for a car without other commands."""
    inject(car, **what)
    assert car.process.stdout is not None
    return float(json.loads(car.process.stdout.readline())["t_us"]) / 1e6


def car_clock_s(car: SimulatedCar) -> float:
    """The simulated time (s) of a car that has been given no command but by :func:`injected_s`."""
    return injected_s(car, inject="drop", share=0.0)


def trials_in(store: Path) -> list[Trial]:
    """All trials in a store, by number."""
    with Store.open(store) as opened:
        return list(opened.trials())


def moving(folder: Path) -> bool:
    """Whether a log in s-logs/ shows that the car has been moving for 0.2 s or more."""
    for file in folder.glob("s-logs/*.tlog"):
        log = list(read_tlog(file))
        moved = [t for t, m in log if m.get_type() == "FOLDCAR_TRUTH" and m.speed > 0.1]
        if moved and log[-1][0] - moved[0] >= 200_000:
            return True
    return False
