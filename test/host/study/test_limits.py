"""`carsim limits`: what it prints is what `carsim batch` holds its input to, and what the host's own checks allow."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import CHANNELS
from foldcar.car.design import MAX_AXLES, MAX_SEGMENTS
from foldcar.scenes.checks import MAX_COORDINATE_M
from foldcar.scenes.scene_json import MAX_FRICTION, MAX_NODES, MAX_PIECES, PLACE_KEYS
from foldcar.scenes.terrain_kinds import KINDS
from foldcar.simulation.carsim import CarsimLimits
from study_car import car_body, empty_scene, hinged_body, run_carsim

PLACE = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}
PIECES: dict[str, dict[str, Any]] = {
    name: {key: value for key, value in PLACE.items() if kind.shape != "disc" or key != "heading_rad"}
    | {key: min(1, 0.1 * largest) for key, (_, largest) in kind.sizes.items()}
    for name, kind in KINDS.items()
}
# Differences with a value for each channel.
WHEEL_DIFFERENCES = {
    *("wheel_radius", "tyre_grip", "servo_speed", "servo_torque", "neutral_us", "deadband_us", "eccentricity_m"),
    "eccentricity_phase_rad",
}
# Bounds that follow from other numbers of the line stand before the table's.
DEPENDENT = {
    ("body.wheels.servo.saturation_us", "least"),
    ("scene.course.x_max_m", "least"),
    ("scene.course.y_max_m", "least"),
    ("scene.terrain.half_round.height_m", "largest"),
    ("scene.terrain.pothole.edge_m", "largest"),
    ("scene.terrain.rough.correlation_m", "largest"),
}


def line_with(path: str, value: float) -> dict[str, Any]:
    """A line of the protocol that is sound but for that number."""
    kind, *keys = path.split(".")
    whole: dict[str, dict[str, Any]] = {
        "body": {"id": "b", **hinged_body()},
        "scene": {"id": "s", **empty_scene(goal_x_m=1.0)},
        "run": {"id": "r", "body": "b", "scene": "s", "speed_m_s": 0.5, "time_limit_s": 1.0},
        "heights": {"id": "h", "scene": "s", "x_m": [0.0], "y_m": [0.0]},
    }
    if kind == "reality":
        (name,) = keys
        return {"run": {**whole["run"], "reality": {name: [value] * CHANNELS if name in WHEEL_DIFFERENCES else value}}}
    line = deepcopy(whole[kind])
    if keys[0] == "terrain":
        line["terrain"] = [{"kind": keys[1], **PIECES[keys[1]]}]
        keys = ["terrain", keys[-1]]
    if path == "scene.goal.radius_m":
        line["goal"] = {"kind": "disc", "x_m": 1.0, "y_m": 0.0, "radius_m": 0.1}
    if keys[0] == "program":
        line["program"] = {"endings": [], "time_limit_s": 1, "verdict": None, "records": [], "step_s": 0.25}
    target: Any = line
    for key in keys[:-1]:
        target = target[key]
        target = target[0] if isinstance(target, list) else target
    target[keys[-1]] = [value] if kind == "heights" else value
    return {kind: line}


def test_batch_holds_its_input_to_the_printed_limits(carsim_binary: Path, carsim_limits: CarsimLimits) -> None:
    beyond: list[tuple[str, float, str]] = []
    for path, (least, largest) in carsim_limits.numbers.items():
        if path.endswith((".count", ".nodes", ".heights", ".faces")) or path.startswith("advance."):
            continue
        span = max(1.0, abs(least), abs(largest))
        if (path, "least") not in DEPENDENT:
            beyond.append((path, least - span, f"is below the limit {json.dumps(least)}"))
        if (path, "largest") not in DEPENDENT:
            beyond.append((path, largest + span, f"is above the limit {json.dumps(largest)}"))
    lines = [line_with(path, value) for path, value, _ in beyond]

    done = run_carsim(carsim_binary, lines)

    messages = [json.loads(line)["error"]["message"] for line in done.stdout.splitlines()]
    assert len(messages) == len(beyond) > 120
    for (path, _, limit), message in zip(beyond, messages, strict=True):
        assert f".{message}".find(f".{path.split('.')[0]}.") in (0, 4) and f".{path.split('.')[-1]}" in message, message
        assert message.endswith(limit), (path, message)


def test_what_lies_between_the_limits_is_taken(carsim_binary: Path) -> None:
    lines: list[dict[str, Any]] = [{"body": {"id": "b", **hinged_body()}}]
    lines += [line_with(f"scene.terrain.{kind}.x_m", 0.0) for kind in PIECES]

    done = run_carsim(carsim_binary, lines)

    assert (done.returncode, done.stdout) == (0, "")


def test_no_design_has_more_than_the_simulator_takes(carsim_limits: CarsimLimits) -> None:
    numbers = carsim_limits.numbers

    assert numbers["body.segments.count"] == (1, MAX_SEGMENTS)
    assert numbers["body.wheels.count"] == (2, 2 * MAX_AXLES)
    assert numbers["body.wheels.channel"] == (0, CHANNELS - 1)


@pytest.mark.parametrize("kind", KINDS)
def test_no_scene_has_terrain_that_the_simulator_refuses(carsim_limits: CarsimLimits, kind: str) -> None:
    sizes = {**PLACE_KEYS, **KINDS[kind].sizes}
    if KINDS[kind].shape == "disc":
        del sizes["heading_rad"]
    printed = {
        path.rsplit(".", 1)[1]: limits
        for path, limits in carsim_limits.numbers.items()
        if path.startswith(f"scene.terrain.{kind}.") and not path.endswith(".nodes")
    }

    assert sizes.keys() == printed.keys()
    for key, (least, largest) in sizes.items():
        assert printed[key][0] <= least <= largest <= printed[key][1], key


def test_no_scene_is_larger_than_the_simulator_takes(carsim_limits: CarsimLimits) -> None:
    numbers = carsim_limits.numbers

    assert numbers["scene.terrain.count"] == (0, MAX_PIECES)
    assert numbers["scene.terrain.rough.nodes"] == (0, MAX_NODES)
    assert numbers["scene.friction"][1] == MAX_FRICTION
    assert numbers["scene.course.x_min_m"] == (-MAX_COORDINATE_M, MAX_COORDINATE_M)


def test_the_rules_of_a_trial_are_the_documented_ones(carsim_limits: CarsimLimits) -> None:
    rules = carsim_limits.trial

    assert (rules.settling_s, rules.firmware_tick_s, rules.step_s) == (0.25, 0.02, pytest.approx(1 / 240))
    # 75 degrees; 10 mm and 2 degrees in 4 s.
    assert rules.tipped_up == pytest.approx(0.2588, abs=0.002)
    assert (rules.stuck_distance_m, rules.stuck_time_s) == (0.010, 4.0)
    assert rules.stuck_turn_rad == pytest.approx(0.0349, abs=0.0002)


def answer_of(binary: Path, body: dict[str, Any], terrain: list[dict[str, Any]], **scene: Any) -> dict[str, Any]:
    """The answer to half a second of a run, in a batch that must not be killed by a signal."""
    scene = {**empty_scene(goal_x_m=1.0), "terrain": terrain, **scene}
    run = {"id": "r", "body": "b", "scene": "s", "speed_m_s": 5.0, "time_limit_s": 0.5}
    lines = [{"body": {**body, "id": "b"}}, {"scene": {**scene, "id": "s"}}, {"run": run}]
    done = run_carsim(binary, lines)
    assert done.returncode in (0, 2), done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@pytest.mark.parametrize(
    ("piece", "count", "limit"),
    [
        ({"kind": "hill", **PLACE, "sd_along_m": 0.005, "sd_across_m": 0.005, "height_m": 0.05}, 3000, "heights"),
        ({"kind": "half_round", **PLACE, "length_m": 1.0, "width_m": 1.0, "height_m": 0.01}, 9999, "faces"),
    ],
)  # fmt: skip
def test_ground_that_would_take_minutes_a_second_is_refused_by_a_limit_that_says_so(
    carsim_binary: Path, carsim_limits: CarsimLimits, piece: dict[str, Any], count: int, limit: str
) -> None:
    error = answer_of(carsim_binary, car_body(), [piece] * count)["error"]

    assert error["message"].startswith(f"scene.terrain.{limit}: the ")
    assert f"the limit is {carsim_limits.numbers[f'scene.terrain.{limit}'][1]:.0f}: let fewer " in error["message"]
