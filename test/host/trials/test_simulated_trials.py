"""`foldcar log` with the car of `foldcar link`: it says that it is simulated, and in which scene it drives."""

import contextlib
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json, car_json
from foldcar.car.design import compose
from foldcar.link.simulated_car import simulated_car
from foldcar.link.tlog import read_tlog
from foldcar.scenes.fingerprint import scene_name
from foldcar.store.reader import Store
from forked_foldcar import original
from live_car import LOG, greeted, trials_in
from study_car import empty_scene

PROGRAM = """
model model
ego = new Robot at (0, 0), facing -90 deg
ramp = new Ramp at (0.5, Range(0.5, 0.7)), facing -90 deg, with plateau 0.1
goal = new Goal at (0.6, 0), facing -90 deg
"""


@pytest.fixture
def course(tmp_path: Path) -> Path:
    """The listing l.json: two experiments with other seeds, whose samples differ in the place of a ramp."""
    (tmp_path / "ramp.scenic").write_text(PROGRAM)
    params = {"timeout": 5, "environments": 8}
    data = {
        "experiments": {str(k): {"veh_id": 1, "env_id": k, "params": params} for k in (1, 2)},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [95]}}]}},
        "environments": {str(k): {"scenic_filename": "ramp.scenic", "seed": k} for k in (1, 2)},
    }
    (tmp_path / "l.json").write_text(json.dumps(data))
    return tmp_path


@contextlib.contextmanager
def link(folder: Path, *words: str) -> Iterator[str]:
    """The port of `foldcar link` on l.json."""
    process = original().start(["link", "l.json", *words], folder)
    try:
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        process.communicate()


def test_a_simulated_car_that_is_faster_than_real_time_waits_for_the_hosts_heartbeats(
    course: Path, carsim_binary: Path, foldcar: Any
) -> None:
    with link(course, "--experiment", "1", "--sample", "0", "--speedup", "400") as port:
        answer = foldcar(*LOG, "--port", port, "--yes", "--trials", "1", "--countdown", "1")

    assert answer.returncode == 0, answer.stderr
    assert [(trial.outcome, trial.ending) for trial in trials_in(course / "s.db")] == [("passed", "goal")]


def test_the_car_follows_to_the_sample_of_each_trial(
    course: Path, carsim_binary: Path, foldcar: Any, refused: Any
) -> None:
    with link(course, "--experiment", "1", "--sample", "3") as port:
        other = refused("log", "l.json", "--experiment", "2", "--store", "s.db", "--port", port, "--yes")
        made_nothing = not (course / "s.db").exists() and not (course / "s-logs").exists()
        answer = foldcar(*LOG, "--port", port, "--yes", "--trials", "3", "--countdown", "0")
        done = foldcar(*LOG, "--port", port, "--yes", "--trials", "1", "--countdown", "0", "--sample", "3")

    assert made_nothing
    assert other == (
        "the simulated car cannot drive in sample 0 of experiment 2: start `foldcar link` with this experiment of l.json "
        "as it is now, and with --sample 0"
    )
    assert (answer.returncode, done.returncode) == (0, 0), answer.stderr + done.stderr
    assert "SIMULATED CAR: its trials are stored as simulated" in answer.stdout
    assert "Trial 1: passed (SIMULATED CAR); log: " in answer.stdout
    # The ramp is one obstacle: in each of three trials a row for it and for its two pieces.
    assert [line.split()[0] for line in answer.stdout.splitlines() if line[:2] in ("A ", "B ")] == ["A"] * 9
    trials = trials_in(course / "s.db")
    assert {trial.sample for trial in trials[:3]} < set(range(8)) and len({trial.sample for trial in trials[:3]}) == 3
    assert trials[3].sample == 3
    assert {(trial.car, trial.scenic_program) for trial in trials} == {("simulated", "ramp.scenic")}
    for trial in trials:
        with Store.open(course / "s.db") as store:
            drive = store.trial_drive(trial.id)
        log = list(read_tlog(course / str(trial.log)))
        named = {m.id for _, m in log if m.get_type() == "FOLDCAR_SCENE"}
        # The first half of the name is the hash of the stored scene, as any program computes it.
        assert drive is not None and named == {f"{hashlib.sha256(drive[2].encode()).hexdigest()[:16]}/{trial.sample}"}
        assert {m.hardware for _, m in log if m.get_type() == "FOLDCAR_DESIGN"} == {2}
    replayed = foldcar("trials", "replay", "s.db", "1")
    assert "not compared: of a simulated car" in replayed.stdout and "agree" not in replayed.stdout
    # Each was driven in the scene of its sample: simulated there again, it ends as it did.
    for trial in trials:
        assert "agree" in foldcar("trials", "replay", "s.db", str(trial.id), "--simulated-trials").stdout
    # In a study whose cars vary, the simulated car is another one than that of `compare`.
    assert "exactly its design" not in replayed.stdout
    listing = json.loads((course / "l.json").read_text())
    listing["experiments"]["1"]["params"] |= {"environments": 1, "variation": "workshop"}
    (course / "varied.json").write_text(json.dumps(listing))
    swept = foldcar("sweep", "varied.json", "--experiment", "1", "--store", "s.db", "--realities", "0")
    assert swept.returncode == 0, swept.stderr
    assert "exactly its design" in foldcar("trials", "replay", "s.db", "1").stdout


def test_a_changed_program_is_refused(course: Path, carsim_binary: Path, refused: Any) -> None:
    with link(course, "--experiment", "1") as port:
        (course / "ramp.scenic").write_text(PROGRAM.replace("0.7", "0.6"))
        message = refused(*LOG, "--port", port, "--yes")

    assert "the simulated car cannot drive in sample 0 of experiment 1" in message


@pytest.mark.parametrize("scene_id", ["42/0", "x" * 100])
def test_a_car_in_a_scene_of_ones_own_is_refused(course: Path, carsim_binary: Path, refused: Any, scene_id: str) -> None:
    design = compose("W_B_W", {"width": 95.0})
    scene = {**empty_scene(goal_x_m=0.6), "id": scene_id}
    with simulated_car([str(carsim_binary)], body_json(design), [(scene, {})], car_json(design)) as car:
        with greeted(car.port) as connected:
            identity = connected.identity()
        message = refused(*LOG, "--port", car.port, "--yes")

    assert (identity.simulated, identity.scene) == (True, scene_id[:64])
    assert not (course / "s.db").exists()
    assert "the simulated car cannot drive in sample 0 of experiment 1" in message


def test_a_scenes_name_ignores_its_id_and_the_order_of_keys() -> None:
    scene = empty_scene(goal_x_m=0.6)
    name = scene_name(scene, 12)

    assert scene_name({"id": "x", **dict(reversed(scene.items()))}, 12) == name
    assert scene_name({**scene, "friction": 0.61}, 12) != name
    assert name.partition("/")[2] == "12"


def test_a_replay_uses_the_engine_of_the_runs(course: Path, carsim_binary: Path, foldcar: Any) -> None:
    with link(course, "--experiment", "1", "--sample", "0", "--speedup", "400") as port:
        answer = foldcar(*LOG, "--port", port, "--yes", "--trials", "1", "--countdown", "0", "--sample", "0")
    assert answer.returncode == 0, answer.stderr
    assert "Side view" not in foldcar("trials", "replay", "s.db", "1").stdout

    swept = foldcar("sweep", "l.json", "--experiment", "1", "--store", "s.db", "--engine", "side-view")

    assert swept.returncode == 0, swept.stderr
    with Store.open(course / "s.db") as store:
        (engine,) = {info.engine for info in store.info().experiments.values()}
        (run,) = [result for result in store.results() if result.sample == 0]
    replayed = foldcar("trials", "replay", "s.db", "1").stdout
    assert engine and f"simulated {run.outcome}" in " ".join(replayed.split()) and f"({engine})" in replayed


def test_a_replay_without_the_programs_monitor_is_not_compared(course: Path, carsim_binary: Path, foldcar: Any) -> None:
    monitor = "monitor Stop():\n    while ego.position.x < 0.3:\n        wait\n    terminate\nrequire monitor Stop()\n"
    (course / "ramp.scenic").write_text(PROGRAM + monitor)
    with link(course, "--experiment", "1", "--sample", "0", "--speedup", "400") as port:
        answer = foldcar(*LOG, "--port", port, "--yes", "--trials", "1", "--countdown", "0", "--sample", "0")
    assert answer.returncode == 0, answer.stderr

    replayed = foldcar("trials", "replay", "s.db", "1", "--simulated-trials").stdout

    assert "not compared: the trial's program runs during the simulation" in replayed and "agree" not in replayed
