"""The height of a scene's ground as the simulator computes it; all pictures and models of ground use it."""

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.simulation.carsim import Carsim

Floats = NDArray[numpy.float64]
# A function (scene, x_m, y_m) -> z_m; the arrays have equal shapes.
Heights = Callable[[Mapping[str, Any], Floats, Floats], Floats]


def carsim_heights(carsim: Carsim) -> Heights:
    """Return a function that lets ``carsim`` compute the heights (m) of a scene's ground at given points.

    The returned function takes a scene and two arrays of one shape, the points' x and y (m). It returns an array of that
    shape. It raises CarsimError if carsim refuses the scene.
    """

    def heights(scene: Mapping[str, Any], x_m: Floats, y_m: Floats) -> Floats:
        points = {"x_m": x_m.ravel().tolist(), "y_m": y_m.ravel().tolist()}
        scene_line = json.dumps({"scene": {**scene, "id": "scene"}})
        question_line = json.dumps({"heights": {"id": "heights", "scene": "scene", **points}})
        (answer,) = carsim.answers([scene_line, question_line])
        return numpy.asarray(answer["z_m"], dtype=float).reshape(x_m.shape)

    return heights
