"""Simulates a trial's counterpart: the design of its car in the scene as built on the floor.

Input: a store and the number of a trial. Output: the simulated body and scene, and carsim's answer with the path. The
dynamic parts of a Scenic program are not simulated.
"""

import json
from dataclasses import dataclass
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import PATH_INTERVAL_S, RunRequest
from foldcar.store.reader import Store
from foldcar.store.writer import canonical_json


@dataclass(frozen=True, slots=True)
class Pair:
    """The simulated counterpart of a trial: body, scene and answer of docs/carsim.md."""

    body: dict[str, Any]
    scene: dict[str, Any]
    answer: dict[str, Any]


def simulate_pair(store: Store, number: int, carsim: Carsim) -> Pair:
    """Simulate trial ``number``; FoldcarError if the store lacks it, or lacks the scene of an imported one."""
    store.trial(number)
    drive = store.trial_drive(number)
    if drive is None:
        raise FoldcarError(f"{store.path}: trial {number} was imported without a scene and cannot be simulated")
    body, settings, scene = drive
    with_path = canonical_json({**json.loads(settings), "path_interval_s": PATH_INTERVAL_S})
    request = RunRequest("car", "scene", with_path, f"trial {number}", 0)
    (answer,) = carsim.run({"car": body}, {"scene": scene}, [request])
    return Pair(json.loads(body), json.loads(scene), answer)
