"""Environments: the same inputs give the same scenes, placed and spread as the programs say."""

import json
import math
import os
import random
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy
import pytest
from scipy.stats import chi2

from foldcar.scenes.program import compile_program
from foldcar.scenes.scene_json import scene_with_obstacles
from foldcar.scenes.source import open_environment

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
PYRAMIDS = SCENARIOS / "step_pyramids.scenic"
MUTATED = SCENARIOS / "two_bumps_mutated.scenic"
PROGRAMS = sorted(SCENARIOS.glob("*.scenic"))

# A correct program fails one of these bounds once in a million seeds; the seeds are fixed.
RARE = 0.5e-6


def assert_spread(values: list[float], mean: float, deviation: float) -> None:
    """The values are as far from the mean as Gaussian noise of that deviation is, by a chi-square bound."""
    statistic = sum(((value - mean) / deviation) ** 2 for value in values)
    assert chi2.ppf(RARE, len(values)) < statistic < chi2.ppf(1 - RARE, len(values))


@cache
def first_samples(program: Path) -> list[dict[str, Any]]:
    """Samples 0 to 5 of a program, drawn in their order."""
    source = open_environment(program, {}, 42)
    return [source.sample(k) for k in range(6)]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_same_seed_same_scenes_whatever_the_order(program: Path) -> None:
    second = open_environment(program, {}, 42)
    assert [second.sample(k) for k in (5, 0, 3)] == [first_samples(program)[k] for k in (5, 0, 3)]


def test_other_seeds_and_samples_differ() -> None:
    source = open_environment(PYRAMIDS, {}, 42)
    texts = {json.dumps(source.sample(k)) for k in range(20)}
    texts.add(json.dumps(open_environment(PYRAMIDS, {}, 43).sample(0)))
    assert len(texts) == 21


def test_same_bytes_in_another_process_with_another_hash_seed() -> None:
    code = (
        "import json, pathlib, sys; from foldcar.scenes.source import open_environment; "
        "print(json.dumps([open_environment(pathlib.Path(p), {}, 42).sample(3) for p in sys.argv[1:]]))"
    )
    programs = PROGRAMS[:3]
    command = [sys.executable, "-c", code, *map(str, programs)]
    other = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    done = subprocess.run(command, env={**os.environ, "PYTHONHASHSEED": other}, capture_output=True, check=True)
    assert json.loads(done.stdout) == [first_samples(program)[3] for program in programs]


def test_global_generators_are_given_back() -> None:
    random.seed(5)
    numpy.random.seed(5)
    expected = random.random(), numpy.random.random()
    random.seed(5)
    numpy.random.seed(5)
    open_environment(PYRAMIDS, {}, 1).sample(0)
    assert (random.random(), numpy.random.random()) == expected


def test_step_pyramids_are_the_studied_ones() -> None:
    scene = open_environment(PYRAMIDS, {"position_sd": 0.0, "heading_sd": 0.0}, 0).sample(0)
    box = {"kind": "box", "heading_rad": 0.0}
    expected = [
        {**box, "x_m": x, "y_m": y, "length_m": side, "width_m": side, "height_m": height}
        for x, y in ((0.45, 0.105), (0.90, -0.105))
        for side, height in ((0.23, 0.0295), (0.16, 0.059), (0.09, 0.0885))
    ]
    assert scene == {
        "friction": 0.75,
        "terrain": expected,
        "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
        "goal": {"kind": "line", "x_m": 1.315, "y_m": 0.0, "heading_rad": 0.0},
        "course": {"x_min_m": -0.5, "x_max_m": 2.0, "y_min_m": -1.0, "y_max_m": 1.0},
    }


def test_step_pyramids_spread_as_declared_and_the_goal_follows_the_last_edge() -> None:
    source = open_environment(PYRAMIDS, {}, 42)
    scenes = [source.sample(k) for k in range(100)]
    near, far = ([scene["terrain"][index] for scene in scenes] for index in (0, 3))
    start = [scene["start"] for scene in scenes]
    for values, mean, deviation in (
        ([box["x_m"] for box in near], 0.45, 0.01),
        ([box["y_m"] for box in near], 0.105, 0.01),
        ([box["x_m"] for box in far], 0.90, 0.01),
        ([box["y_m"] for box in far], -0.105, 0.01),
        ([place["x_m"] for place in start], 0.0, 0.01),
        ([place["y_m"] for place in start], 0.0, 0.01),
        ([place["heading_rad"] for place in start], 0.0, 0.02),
    ):
        assert_spread(values, mean, deviation)
    for scene in scenes:
        assert len({(box["x_m"], box["y_m"]) for box in scene["terrain"]}) == 2
        last_edge = max(box["x_m"] + box["length_m"] / 2 for box in scene["terrain"])
        assert scene["goal"]["x_m"] == pytest.approx(last_edge + 0.30, abs=2e-9)


def test_mutated_bumps_spread_as_declared() -> None:
    still = open_environment(SCENARIOS / "two_bumps.scenic", {}, 0).sample(0)
    source = open_environment(MUTATED, {}, 42)
    scenes = [source.sample(k) for k in range(60)]
    assert [box["length_m"] for box in scenes[0]["terrain"]] == [box["length_m"] for box in still["terrain"]]

    def places(scene: dict[str, Any]) -> list[dict[str, float]]:
        return [*scene["terrain"], scene["goal"], scene["start"]]

    for index, undisturbed in enumerate(places(still)):
        disturbed = [places(scene)[index] for scene in scenes]
        # `mutate … by 0.01` scales Scenic's standard deviations of 1 m and 5 degrees.
        for key, deviation in (("x_m", 0.01), ("y_m", 0.01), ("heading_rad", 0.01 * math.radians(5))):
            assert_spread([place[key] for place in disturbed], undisturbed[key], deviation)


def test_parameters_of_the_listing_change_the_scene_and_reach_an_imported_program() -> None:
    params = {"bump_height": 0.03, "bump_gap": 0.1, "friction": 0.8}
    scene = open_environment(SCENARIOS / "two_bumps.scenic", params, 0).sample(0)
    near, far = scene["terrain"]
    assert (near["height_m"], far["height_m"], scene["friction"]) == (0.03, 0.03, 0.8)
    assert far["x_m"] - near["x_m"] == pytest.approx(0.1 + 0.06)
    scene = open_environment(MUTATED, {"bump_height": 0.012}, 0).sample(0)
    assert [box["height_m"] for box in scene["terrain"]] == [0.012, 0.012]


def test_box_corners_are_where_scenic_puts_them(tmp_path: Path) -> None:
    program = tmp_path / "turned.scenic"
    program.write_text(
        "model model\n"
        "import math\n"
        "new Bump at (0.3, 0.2), facing 30 deg, with length 0.3, with width 0.1\n"
        "new Step at (-0.5, 0.5), facing -140 deg, with length 0.2, with width 0.5\n"
        "ego = new Robot at (0, -0.5), facing 10 deg\n"
        "ahead = new Marker ahead of ego by 0.5\n"
        "goal = new Goal at (0, 0.9), with reach 0.05\n"
    )
    scene, _ = compile_program(program, {}).generate()
    converted, _ = scene_with_obstacles(scene, program, "turned")
    boxes = [thing for thing in scene.objects if type(thing).__name__ in ("Bump", "Step")]
    assert len(boxes) == len(converted["terrain"]) == 2
    for thing, box in zip(boxes, converted["terrain"], strict=True):
        place = complex(box["x_m"], box["y_m"])
        along = complex(math.cos(box["heading_rad"]), math.sin(box["heading_rad"]))
        corners = [
            place + along * complex(ahead * box["length_m"] / 2, left * box["width_m"] / 2)
            for ahead in (-1, 1)
            for left in (-1, 1)
        ]
        for corner in thing.corners:
            assert min(abs(complex(corner.x, corner.y) - own) for own in corners) < 1e-8
    # The robot looks towards what Scenic puts ahead of it.
    (ahead,) = (thing.position for thing in scene.objects if type(thing).__name__ == "Marker")
    start = converted["start"]
    direction = math.atan2(ahead.y - start["y_m"], ahead.x - start["x_m"])
    assert start["heading_rad"] == pytest.approx(direction, abs=1e-8)
    assert converted["goal"] == {"kind": "disc", "x_m": 0.0, "y_m": 0.9, "radius_m": 0.05}


def test_the_working_folder_stays_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    program = tmp_path / "moving.scenic"
    program.write_text(
        "import os\nmodel model\nego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (1, 0), facing -90 deg\n"
        "os.chdir('/')\nrequire os.chdir('/') is None\n"
    )
    open_environment(Path("moving.scenic"), {}, 1).sample(0)
    assert Path.cwd() == tmp_path
