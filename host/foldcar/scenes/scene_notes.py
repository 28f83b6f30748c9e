"""Remarks on a scene that can be simulated, but that its author probably did not mean.

Input: a scene of docs/carsim.md. Output: sentences for readers.
"""

import math
from collections.abc import Mapping
from typing import Any

from foldcar.scenes.checks import rectangle
from foldcar.scenes.terrain_kinds import KIND_NAMES, kind_of, reach_m

# A piece of ground is remarked on if a block covers more than this fraction of the smaller of both.
MIN_COVERED = 0.5
# Heights of rough ground rarely exceed this many standard deviations.
ROUGH_REACH_SD = 3.0


def scene_notes(scene: Mapping[str, Any]) -> list[str]:
    """Return remarks on ground that a block hides, and on a start that faces away from the goal.

    Example: ["the rough ground at (1.2, 0) lies under the ramp at (1, 0): the higher one counts, so it has no effect"]
    """
    notes = [note for ground in scene["terrain"] for block in scene["terrain"] if (note := _hidden(ground, block))]
    start, goal = scene["start"], scene.get("goal")
    if goal is not None:
        dx_m, dy_m = goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]
        if dx_m * math.cos(start["heading_rad"]) + dy_m * math.sin(start["heading_rad"]) < 0:
            notes.append("the start faces away from the goal: a car that drives straight on never reaches it")
    return notes


def _hidden(ground: Mapping[str, Any], block: Mapping[str, Any]) -> str | None:
    """Return a remark if most of a piece of ground, or of the block on it, is under the block's surface; else None."""
    if kind_of(ground).form != "smooth" or kind_of(block).form != "block" or block["height_m"] <= _height_m(ground):
        return None
    reaches = (reach_m(ground), reach_m(block))
    shared_m2 = rectangle({"heading_rad": 0.0, **ground}, reaches[0]).intersection(rectangle(block, reaches[1])).area
    if shared_m2 <= MIN_COVERED * min(4 * along * across for along, across in reaches):
        return None
    return f"the {_place(ground)} lies under the {_place(block)}: the higher one counts, so it has no effect there"


def _height_m(ground: Mapping[str, Any]) -> float:
    """Return about the greatest height (m) of a piece of smooth ground; a hole has none."""
    if ground["kind"] == "rough":
        return ROUGH_REACH_SD * float(ground["height_sd_m"])
    return float(ground.get("height_m", 0.0))


def _place(piece: Mapping[str, Any]) -> str:
    return f"{KIND_NAMES.get(piece['kind'], piece['kind'])} at ({piece['x_m']:.3g}, {piece['y_m']:.3g})"
