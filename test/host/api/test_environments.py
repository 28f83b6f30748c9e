"""Environments in Python: numpy's numbers, other processes, many values of a parameter."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy
import pytest

import foldcar
from conftest import STEP_PYRAMIDS

# A monitor runs beside the simulation.
MONITORED = """
model model
param width = 0.4
ego = new Robot at (0, 0), facing -90 deg
new Bump at (0.5, 0), facing -90 deg, with width globalParameters.width
goal = new Goal at (0.6, 0), facing -90 deg
monitor Far():
    while True:
        if ego.position.x > 5:
            terminate
        wait
require monitor Far()
"""


def test_parameters_may_be_numbers_of_numpy() -> None:
    """A notebook scans `numpy.linspace(…)`."""
    plain = foldcar.environment(STEP_PYRAMIDS, params={"friction": 0.5})
    for value in (numpy.float64(0.5), numpy.float32(0.5), numpy.linspace(0, 0.5, 2)[1], numpy.array(0.5)):
        assert foldcar.environment(STEP_PYRAMIDS, params={"friction": value}) is plain
    with pytest.raises(foldcar.FoldcarError, match=r"^params: Object of type object is not JSON serializable; write "):
        foldcar.environment(STEP_PYRAMIDS, params={"friction": object()})


def test_parameters_of_a_compiled_program_cannot_be_changed() -> None:
    environment = foldcar.environment(STEP_PYRAMIDS, params={"friction": 0.5})
    with pytest.raises(TypeError):
        environment.params["friction"] = 0.9  # type: ignore[index]
    assert "'friction': 0.5" in repr(environment)


def test_environments_and_scenes_go_to_other_processes() -> None:
    car, environment = foldcar.design("W_B_W", width=95), foldcar.environment(STEP_PYRAMIDS, seed=42)
    here = foldcar.evaluate(car, environment, 2, jobs=1)

    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        there = pool.submit(foldcar.evaluate, car, environment, 2, jobs=1).result(200)

    assert there.runs.equals(here.runs) and there.success == here.success
    scene = environment.scene(1)
    for other in (pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene)):
        assert other.json == scene.json and other.environment is environment


def test_few_programs_with_a_monitor_keep_processes(tmp_path: Path) -> None:
    """Somebody scans a parameter of a program that runs beside the simulation."""
    (tmp_path / "monitored.scenic").write_text(MONITORED)
    car, environments = foldcar.design("W_B_W", width=95), []
    for width in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        environments.append(foldcar.environment(tmp_path / "monitored.scenic", params={"width": width}))
        result = foldcar.evaluate(car, environments[-1], 1, timeout_s=10)
        assert result.rate.value == 1

    waiting = [len(vars(environment.runner)["_idle"]) for environment in environments]
    assert waiting == [0, 0, 1, 1, 1, 1]
    assert foldcar.evaluate(car, environments[0], 1, timeout_s=10).rate.value == 1
