"""A car and its scene as MJCF, MuJoCo's XML: the model that carsim's MuJoCo engine uses and saves."""

import json
from collections.abc import Mapping
from typing import Any

from foldcar.simulation.carsim import Carsim, input_line

# A level floor without end: the course's limits only end a run.
LEVEL_SCENE: dict[str, Any] = {
    "friction": 1.0,
    "terrain": [],
    "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
    "goal": None,
    "course": {"x_min_m": -1.0, "x_max_m": 1.0, "y_min_m": -1.0, "y_max_m": 1.0},
}


def mjcf(carsim: Carsim, body: Mapping[str, Any], scene: Mapping[str, Any] | None = None, name: str = "foldcar") -> str:
    """Return the model of body and scene of docs/carsim.md, with the car at the scene's start, as MJCF.

    Without a scene the car stands on a level floor with friction 1. Raises CarsimError if ``carsim`` has no MuJoCo, or
    refuses body or scene.
    """
    lines = [input_line("body", "car", json.dumps(body)), input_line("scene", "scene", json.dumps(scene or LEVEL_SCENE))]
    (answer,) = carsim.answers([*lines, json.dumps({"mjcf": {"id": name, "body": "car", "scene": "scene"}})])
    return str(answer["xml"])
