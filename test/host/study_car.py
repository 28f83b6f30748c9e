"""The width study's car and an empty scene as inputs of the simulator."""

import copy
from typing import Any

from foldcar.car.body import body_json
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
