"""Simulator processes that die in the middle of a chunk: killed from outside or by a limit of the system."""

import contextlib
import json
import os
import shlex
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import CarsimError, RunRequest
from foldcar.simulation.scenic_runner import ScenicRunner
from study_car import car_texts, empty_scene

WAIT_S = 120.0


@pytest.fixture(scope="module")
def chunk() -> dict[str, Any]:
    """Three runs of one car, as `run` takes them; the middle one drives for ten minutes over a wide plain."""
    far = {"x_min_m": -900, "x_max_m": 900, "y_min_m": -900, "y_max_m": 900}
    disc = {"kind": "disc", "x_m": -800, "y_m": 0, "radius_m": 1}
    short, long = empty_scene(goal_x_m=1.3), {**empty_scene(), "goal": disc, "course": far}
    drive = json.dumps({"speed_m_s": 0.69, "time_limit_s": 60})
    slow = json.dumps({"speed_m_s": 0.2, "time_limit_s": 600, "parameters": {"TRIAL_MAX_S": 600}})
    requests = [
        RunRequest("b", scene, settings, f"run {i}", 0)
        for i, (scene, settings) in enumerate([("short", drive), ("long", slow), ("short", drive)])
    ]
    scenes = {"short": json.dumps(short), "long": json.dumps(long)}
    return {"bodies": {"b": car_texts()[0]}, "scenes": scenes, "requests": requests}


def children(parent: int | None = None) -> set[int]:
    """A process's children that still run, this one's by default."""
    result = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, owner = entry.read_text().rsplit(")", 1)[1].split()[:2]
            if int(owner) == (parent or os.getpid()) and state != "Z":
                result.add(int(entry.parent.name))
    return result


def awaited(find: Callable[[], Any], what: str) -> Any:
    """What ``find`` finds, once it does."""
    deadline_s = time.monotonic() + WAIT_S
    while not (result := find()):
        assert time.monotonic() < deadline_s, what
        time.sleep(0.01)
    return result


@contextlib.contextmanager
def under_way(call: Callable[[], Any]) -> Iterator[tuple[Future[Any], Callable[[], int]]]:
    """The call in a thread; the function beside it waits for its next process and gives the id of that."""
    seen = children()

    def next_process() -> int:
        (process,) = awaited(lambda: children() - seen, "no process was started")
        seen.add(process)
        return int(process)

    with ThreadPoolExecutor(1) as pool:
        yield pool.submit(call), next_process


def at_the_long_run(process: int) -> None:
    """Wait until the process has computed for 0.1 s: the short run before the long one takes a few hundredths."""

    def computed() -> bool:
        user, system = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK") > 0.1

    awaited(computed, "the process did not run")


@pytest.fixture
def carsim(carsim_binary: Path) -> Carsim:
    return Carsim(carsim_binary)


def test_a_process_killed_once_costs_nothing(carsim: Carsim, carsim_binary: Path, chunk: dict[str, Any]) -> None:
    whole = Carsim(carsim_binary).run(**chunk)

    with under_way(lambda: carsim.run(**chunk)) as (answers, next_process):
        process = next_process()
        at_the_long_run(process)
        os.kill(process, signal.SIGKILL)
        disturbed = answers.result(WAIT_S)

    assert disturbed == whole
    assert "error" not in whole[1]


def test_a_run_whose_process_is_killed_twice_has_failed(carsim: Carsim, chunk: dict[str, Any]) -> None:
    with under_way(lambda: carsim.run(**chunk)) as (answers, next_process):
        for _ in range(2):
            process = next_process()
            at_the_long_run(process)
            os.kill(process, signal.SIGSEGV)
        first, killed, last = answers.result(WAIT_S)

    assert killed == {"error": "the simulation crashed (killed by SIGSEGV)"}
    assert first["outcome"] == last["outcome"]
    assert "error" not in first


def test_a_limit_of_the_system_takes_only_the_run_that_breaks_it(
    tmp_path: Path, carsim_binary: Path, chunk: dict[str, Any]
) -> None:
    limited = tmp_path / "limited-carsim"
    limited.write_text(f'#!/bin/sh\nulimit -c 0\nulimit -S -t 1\nexec {shlex.quote(str(carsim_binary))} "$@"\n')
    limited.chmod(0o755)
    first, slow, last = chunk["requests"]
    longest = json.dumps({"speed_m_s": 0.2, "time_limit_s": 3600, "parameters": {"TRIAL_MAX_S": 3600}})
    endless = RunRequest("b", "long", longest, slow.label, 0)

    answers = Carsim(limited).run(chunk["bodies"], chunk["scenes"], [first, endless, last])

    assert answers[1] == {"error": "the simulation crashed (killed by SIGXCPU)"}
    assert answers[0]["outcome"] == answers[2]["outcome"] == "passed"


def test_stopping_ends_a_chunk_at_once_and_starts_nothing_anew(carsim: Carsim, chunk: dict[str, Any]) -> None:
    before = children()

    with under_way(lambda: carsim.run(**chunk)) as (answers, next_process):
        at_the_long_run(next_process())
        carsim.stop()
        with pytest.raises(CarsimError, match="stopped"):
            answers.result(5.0)

    assert children() <= before
    assert len(carsim.run(chunk["bodies"], chunk["scenes"], chunk["requests"][:1])) == 1


DRIVING = (
    "model model\nego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (30, 0), facing -90 deg\n"
    "param course_x_max = 40\nimport time\ndef pause(x):\n    time.sleep(0.02)\n    return x\n"
    "record pause(ego.position.x) as x\n"
)


@pytest.fixture
def beside(tmp_path: Path, carsim_binary: Path) -> Iterator[tuple[ScenicRunner, dict[str, Any]]]:
    """Scenic beside a run of some seconds of wall time."""
    program = tmp_path / "program.scenic"
    program.write_text(DRIVING)
    chunk = {
        "bodies": {"b": car_texts()[0]},
        "scenes": {"s": json.dumps(open_environment(program, {}, 1).sample(0))},
        "requests": [RunRequest("b", "s", json.dumps({"speed_m_s": 0.5, "time_limit_s": 12}), "the run", 0)],
    }
    with contextlib.closing(ScenicRunner(program, {}, 1, None, None, [str(carsim_binary)])) as runner:
        yield runner, chunk


def simulator_of(worker: int, other_than: int = 0) -> int:
    """The carsim that a Scenic worker's copy for a run has started, once it has."""

    def processes() -> set[int]:
        runs = [run for sample in children(worker) for run in children(sample)]
        return {process for run in runs for process in children(run)} - {other_than}

    (process,) = awaited(processes, "the worker has started no carsim")
    return int(process)


def test_beside_scenic_too_a_process_killed_once_costs_nothing(beside: tuple[ScenicRunner, dict[str, Any]]) -> None:
    runner, chunk = beside
    (whole,) = runner.run(**chunk)

    runner.close()
    with under_way(lambda: runner.run(**chunk)) as (answers, next_process):
        worker = next_process()
        simulator_of(worker)
        time.sleep(0.3)
        os.kill(worker, signal.SIGKILL)
        (disturbed,) = answers.result(WAIT_S)

    assert disturbed == whole and len(whole["recorded"]["x"]["value"]) > 40


def test_beside_scenic_too_a_simulator_killed_twice_is_a_failed_run(beside: tuple[ScenicRunner, dict[str, Any]]) -> None:
    runner, chunk = beside

    with under_way(lambda: runner.run(**chunk)) as (answers, next_process):
        worker = next_process()
        first = simulator_of(worker)
        os.kill(first, signal.SIGKILL)
        os.kill(simulator_of(worker, other_than=first), signal.SIGKILL)
        (answer,) = answers.result(WAIT_S)

    assert answer == {"error": "the simulation crashed (killed by SIGKILL)"}
