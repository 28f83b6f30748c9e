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
    """Return a function that asks ``carsim`` for the heights of a scene's ground at points (Heights).

    It raises CarsimError if carsim refuses the scene.
    """

    def heights(scene: Mapping[str, Any], x_m: Floats, y_m: Floats) -> Floats:
        question = {"id": "h", "scene": "s", "x_m": x_m.ravel().tolist(), "y_m": y_m.ravel().tolist()}
        lines = [json.dumps({"scene": {**scene, "id": "s"}}), json.dumps({"heights": question})]
        (answer,) = carsim.answers(lines)
        return numpy.asarray(answer["z_m"], dtype=float).reshape(x_m.shape)

    return heights
