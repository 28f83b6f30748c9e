"""A run of the simulator as the view page replays it: the car that drives, its ground, where it was.

Input: a design's folded car, body and scene of docs/carsim.md, the run's result and path. Output: JSON, in SI units, that
the view's run.js gives to ``scene.js``.
"""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.scene_shape import SceneShapes
from foldcar.figures.scene_data import ground_data
from foldcar.simulation.heights import Heights


def recorded_run(
    folded: FoldedCar,
    body: Mapping[str, Any],
    scene: Mapping[str, Any],
    answer: Mapping[str, Any],
    path: Sequence[Sequence[float]],
    heights: Heights,
    told: str,
) -> dict[str, Any]:
    """The object that run.js reads; ``told`` says which run it is and what is to be known of it."""
    head, content = ground_data(scene, heights)
    shapes = SceneShapes()
    parts = shapes.add(folded)
    return {
        "told": f"{told} The wheels turn as if they did not slip: a path has no angles of wheels. Orange: the goal"
        + ("; violet: a friction of its own." if any(one["kind"] == "patch" for one in scene["terrain"]) else "."),
        "outcome": answer["outcome"],
        "rows": numpy.round(numpy.asarray(path, dtype=float), 5).tolist(),
        "car": {"body": drawn_body(body), "shape": {"pieces": shapes.pieces, "parts": parts}},
        "ground": {**head, "heights": base64.b64encode(content).decode()},
    }


def drawn_body(body: Mapping[str, Any]) -> dict[str, Any]:
    """What is drawn of a car's body of docs/carsim.md: its geometry."""
    return {
        "track_m": body["track_m"],
        "segments": _of(body["segments"], "x_m", "length_m", "width_m", "height_m", "center_z_m"),
        "hinges": _of(body["hinges"], "x_m", "z_m"),
        "wheels": _of(body["wheels"], "channel", "segment", "side", "x_m", "radius_m", "width_m"),
    }


def _of(rows: Sequence[Mapping[str, Any]], *names: str) -> list[dict[str, Any]]:
    return [{name: row[name] for name in names} for row in rows]
