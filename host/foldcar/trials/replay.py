"""A trial's pair: the same car as designed, in the scene as it stood on the floor, simulated.

Input: a store and the number of a trial. Output: what was simulated, and carsim's answer with the path. An
environment whose program decides while the car drives is simulated without its program.
"""

import json
from dataclasses import dataclass
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.reader import Store
from foldcar.store.writer import canonical_json

PATH_INTERVAL_S = 0.02


@dataclass(frozen=True, slots=True)
class Pair:
    """The simulated side of a trial, as docs/carsim.md has it."""

    body: dict[str, Any]
    scene: dict[str, Any]
    answer: dict[str, Any]


def simulate_pair(store: Store, number: int, carsim: Carsim) -> Pair:
    """Trial ``number`` simulated; FoldcarError if the store does not know what was driven."""
    store.trial(number)
    drive = store.trial_drive(number)
    if drive is None:
        raise FoldcarError(f"{store.path}: trial {number} was imported: its scene is not known, so it has no pair")
    body, settings, scene = drive
    with_path = canonical_json({**json.loads(settings), "path_interval_s": PATH_INTERVAL_S})
    request = RunRequest("car", "scene", with_path, f"trial {number}", 0)
    (answer,) = carsim.run({"car": body}, {"scene": scene}, [request])
    return Pair(json.loads(body), json.loads(scene), answer)


def agree(trial_outcome: str, simulated_outcome: str) -> bool:
    """Whether both passed or neither did."""
    return (trial_outcome == "passed") == (simulated_outcome == "passed")
