"""A car and its scene as MJCF, MuJoCo's XML: the model of carsim's own engine, saved by it."""

import json
from collections.abc import Mapping
from typing import Any

from foldcar.simulation.carsim import Carsim, input_line

# A level floor without end, for the course's limits end a run only.
LEVEL_SCENE: dict[str, Any] = {
    "friction": 1.0,
    "terrain": [],
    "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
    "goal": None,
    "course": {"x_min_m": -1.0, "x_max_m": 1.0, "y_min_m": -1.0, "y_max_m": 1.0},
}


def mjcf(carsim: Carsim, body: Mapping[str, Any], scene: Mapping[str, Any] | None = None, name: str = "foldcar") -> str:
    """The text of the model, of that name, of body and scene of docs/carsim.md, put down at the scene's start.

    Without a scene the car stands on a level floor with friction 1. ``carsim`` must have MuJoCo; CarsimError if it does
    not, or refuses body or scene.
    """
    lines = [input_line("body", "car", json.dumps(body)), input_line("scene", "scene", json.dumps(scene or LEVEL_SCENE))]
    (answer,) = carsim.answers([*lines, json.dumps({"mjcf": {"id": name, "body": "car", "scene": "scene"}})])
    return str(answer["xml"])
