"""The width study's car, a hinged one and an empty scene as inputs of the simulator, its program asked; a listing."""

import copy
import json
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json, firmware_parameters, full_speed_m_s
from foldcar.car.design import compose


def car_body(**changes: float) -> dict[str, Any]:
    """The body of the width study's car, 95 mm wide; ``changes`` replace values of the car and all its parts, by key."""
    body = copy.deepcopy(body_json(compose("W_B_W", {})))
    parts = [body, body["segments"][0], *body["wheels"], *(wheel["servo"] for wheel in body["wheels"])]
    for key, value in changes.items():
        holders = [part for part in parts if key in part]
        assert holders, key
        for part in holders:
            part[key] = value
    return body


def car_texts(width_mm: float = 120, timeout_s: float = 20) -> tuple[str, str]:
    """The body and the settings of one of the width study's cars, as JSON."""
    design = compose("W_B_W", {"width": width_mm})
    body = body_json(design)
    settings = {
        "speed_m_s": full_speed_m_s(design),
        "yaw_rate_rad_s": 0.0,
        "time_limit_s": timeout_s,
        "parameters": firmware_parameters(design, body),
    }
    return json.dumps(body), json.dumps(settings)


def hinged_body() -> dict[str, Any]:
    """Two segments, each with an axle, joined by a hinge."""
    body = car_body(eccentricity_m=0.001, eccentricity_phase_rad=0.7, com_y_m=0.003)
    segment = body["segments"][0]
    front = {**segment, "x_m": 0.05, "length_m": 0.098, "com_x_m": 0.06, "mass_kg": 0.1}
    rear = {**segment, "x_m": -0.05, "length_m": 0.098, "com_x_m": -0.04, "mass_kg": 0.05}
    hinge = {"x_m": 0.0, "z_m": 0.02, "stiffness_n_m_rad": 0.1, "damping_n_m_s_rad": 0.001}
    body |= {"segments": [front, rear], "hinges": [hinge | {"min_rad": -0.5, "max_rad": 0.4}]}
    for wheel in body["wheels"]:
        wheel["segment"] = 0 if wheel["x_m"] > 0 else 1
    return body


def listing_of(program: object, common: dict[str, Any], seed: int = 42, **params: Any) -> dict[str, Any]:
    """A listing of one experiment: the width study's cars with these values in that program."""
    return {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": params}},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": common}]}},
        "environments": {"1": {"scenic_filename": str(program), "seed": seed}},
    }


def empty_scene(
    terrain: Any = (), friction: float = 0.6, x_m: float = 0.0, goal_x_m: float | None = None
) -> dict[str, Any]:
    """A scene with a wide course and the car at ``x_m`` (m)."""
    goal = {"kind": "line", "x_m": goal_x_m, "y_m": 0.0, "heading_rad": 0.0}
    return {
        "friction": friction,
        "terrain": list(terrain),
        "start": {"x_m": x_m, "y_m": 0.0, "heading_rad": 0.0},
        "goal": None if goal_x_m is None else goal,
        "course": {"x_min_m": -10.0, "x_max_m": 10.0, "y_min_m": -10.0, "y_max_m": 10.0},
    }


def run_carsim(carsim: Path, lines: Iterable[Any], *words: str) -> "subprocess.CompletedProcess[str]":
    """What ``carsim batch`` says to lines, JSON data or texts; ``words`` stand in place of "batch"."""
    text = "".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines)
    return subprocess.run([carsim, *(words or ["batch"])], input=text, capture_output=True, text=True, timeout=600)
