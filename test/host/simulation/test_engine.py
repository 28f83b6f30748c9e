"""The MuJoCo engine from the commands: the same studies, beside multibody in one store."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import pytest

from browser import study_of
from foldcar.models.mjcf import mjcf
from foldcar.models.webots_world import drive_fraction
from foldcar.simulation.carsim import Carsim, ask_pulses
from foldcar.simulation.engines import engine_of, engine_title
from foldcar.simulation.runner import RunRequest
from foldcar.store.reader import Store
from study_car import car_body, empty_scene, hinged_body

Command = Callable[..., "subprocess.CompletedProcess[str]"]
STEP_M = 0.012


def driven(carsim: Carsim, body: dict[str, Any], scene: dict[str, Any], **settings: Any) -> dict[str, Any]:
    """The answer to a run of 2 s."""
    request = RunRequest("b", "s", json.dumps({"speed_m_s": 0.5, "time_limit_s": 2.0, **settings}), "the run", 0)
    (answer,) = carsim.run({"b": json.dumps(body)}, {"s": json.dumps(scene)}, [request])
    return answer


def test_engines_are_known_by_what_their_programs_say() -> None:
    assert [engine_of(text) for text in ("", "side-view", "MuJoCo 4.0.0", "MuJoCo 3.17.0, half step")] == [
        "multibody",
        "side-view",
        "mujoco",
        "mujoco-half-step",
    ]
    assert engine_title("MuJoCo 4.0.0, ellipsoid tyres") == "MuJoCo, ellipsoid tyres"


def test_the_exported_model_drives_as_the_native_one(native: Carsim) -> None:
    """The same pulses over a kerb: an export that MuJoCo's own package steps, and the engine's own model."""
    body = car_body()
    kerb = {"kind": "box", "x_m": 0.55, "y_m": 0.0, "heading_rad": 0.0, "length_m": 0.5, "width_m": 1.0}
    scene = empty_scene(terrain=[{**kerb, "height_m": STEP_M}])
    settings = {"speed_m_s": 0.5, "time_limit_s": 1.0}
    rules = native.limits().trial
    path = driven(native, body, scene, **settings, path_interval_s=0.02)["path"]

    # carsim's rows lie at the firmware's own ticks, whose pulses these are.
    (pulses,) = ask_pulses(native, [settings])
    model = mujoco.MjModel.from_xml_string(mjcf(native, body, scene))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(rules.settling_s / rules.step_s))
    own_runs = []
    for i in range(round(path[-1][0] / rules.step_s)):
        for number, wheel in enumerate(body["wheels"]):
            fraction = drive_fraction(wheel["servo"], pulses.at(i * rules.step_s)[wheel["channel"]])
            data.ctrl[number] = fraction or 0.0
        mujoco.mj_step(model, data)
        own_runs.append(data.qpos[:3].tolist())
    for t_s, *place in path[1:]:
        assert place[:3] == pytest.approx(own_runs[round(t_s / rules.step_s) - 1], abs=0.003), t_s
    assert path[-1][1] > 0.35 and path[-1][3] > 0.06 + 0.9 * STEP_M


@pytest.mark.parametrize("hinged", [False, True])
def test_hinged_cars_and_smooth_ground_run(native: Carsim, hinged: bool) -> None:
    hill = {"kind": "hill", "x_m": 0.5, "y_m": 0.05, "heading_rad": 0.0, "height_m": 0.02}
    hill |= {"sd_along_m": 0.1, "sd_across_m": 0.1}
    body = hinged_body() if hinged else car_body()

    answer = driven(native, body, empty_scene(terrain=[hill]), path_interval_s=0.1)

    highest = max(row[3] for row in answer["path"])
    assert answer["outcome"] == "timeout" and answer["path"][-1][1] > 0.5
    assert body["wheels"][0]["radius_m"] + 0.005 < highest < body["wheels"][0]["radius_m"] + 0.025


@pytest.fixture
def listing(listing_data: Any, write_listing: Any) -> Path:
    """Two samples of two widths."""
    listing_data["experiments"]["1"]["params"]["environments"] = 2
    file: Path = write_listing(listing_data)
    return file


@pytest.mark.slow
def test_a_sweep_gives_the_same_numbers_over_jobs_and_stands_beside_the_multibody(
    tmp_path: Path, foldcar: Command, listing: Path
) -> None:
    for jobs in ("1", "2"):
        done = foldcar("sweep", listing, "--store", f"{jobs}.db", "--engine", "mujoco", "--jobs", jobs)
        assert done.returncode == 0, done.stderr
    assert foldcar("sweep", listing, "--store", "2.db").returncode == 0

    results = []
    for jobs in ("1", "2"):
        with Store.open(tmp_path / f"{jobs}.db") as store:
            results.append([(r.sample, r.outcome, r.metrics) for r in store.results("1 (MuJoCo)")])
            infos = store.info().experiments
    assert results[0] == results[1] and len(results[0]) == 4
    assert [info.engine.partition(" ")[0] for info in infos.values()] == ["MuJoCo", ""]
    assert {info.listed_id for info in infos.values()} == {"1"}
    page = foldcar("report", "2.db", "-o", "page")
    assert page.returncode == 0, page.stderr
    first, second = study_of(tmp_path / "page")["experiments"]
    assert dict(first["provenance"])["engine"].startswith("MuJoCo ")
    assert "engine" not in dict(second["provenance"])
    assert first["headline"].startswith("In MuJoCo ") and second["headline"].startswith("In simulation ")


def test_another_program_in_its_place_is_refused(foldcar: Command, listing: Path, carsim_binary: Path) -> None:
    env = {**os.environ, "FOLDCAR_CARSIM_MUJOCO": str(carsim_binary)}
    done = foldcar("sweep", listing, "--store", "s.db", "--engine", "mujoco", env=env)

    assert done.returncode == 2
    assert "its engine is multibody, not mujoco" in done.stderr and done.stderr.count("\n") == 1
