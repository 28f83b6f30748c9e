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
# A car that drives straight on reaches a goal line only if it comes nearer by more than this fraction of its way.
MIN_APPROACH = 1e-6
# Heights of rough ground rarely exceed this many standard deviations.
ROUGH_REACH_SD = 3.0


EARLY_DRAW = (
    "the program draws random values with `random` or numpy outside of Scenic's distributions: all samples have the same "
    "ones; Range, Normal and other distributions of Scenic give each sample its own"
)
ALIKE = (
    "samples 0 and 1 are the same course, and the cars do not vary: more samples say nothing new, and intervals that "
    "count them are too narrow"
)


def scene_notes(scene: Mapping[str, Any]) -> list[str]:
    """Return remarks, each once, on ground that a block hides, and on a start that does not face the goal.

    If several blocks hide ground, the remark names the first pair.

    Example: ["the rough ground at (1.2, 0) lies under the ramp at (1, 0): where both are, only the higher one counts"]
    """
    notes = []
    hidden = []
    for ground in scene["terrain"]:
        for block in scene["terrain"]:
            if _hides(block, ground):
                hidden.append(f"the {_place(ground)} lies under the {_place(block)}")
    # The blocks of a pyramid have one place, and so one remark.
    hidden = list(dict.fromkeys(hidden))
    if hidden:
        others = f" (and {len(hidden) - 1} more like it)" if len(hidden) > 1 else ""
        notes.append(f"{hidden[0]}{others}: where both are, only the higher one counts")
    goal = scene.get("goal")
    if goal is not None and not _is_straight_on(scene["start"], goal):
        notes.append("the start does not face the goal: a car that drives straight on never reaches it")
    return notes


def _is_straight_on(start: Mapping[str, Any], goal: Mapping[str, Any]) -> bool:
    """Return whether the straight line ahead of the start crosses the goal's line, or enters its disc."""
    # The unit vector ahead.
    ahead_x, ahead_y = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    if goal["kind"] == "line":
        # The line has no ends, and the start is before it: only the directions matter.
        approach = math.cos(goal["heading_rad"]) * ahead_x + math.sin(goal["heading_rad"]) * ahead_y
        return approach > MIN_APPROACH
    dx_m, dy_m = float(goal["x_m"] - start["x_m"]), float(goal["y_m"] - start["y_m"])
    distance_ahead_m = dx_m * ahead_x + dy_m * ahead_y
    distance_aside_m = abs(dx_m * ahead_y - dy_m * ahead_x)
    return distance_ahead_m > 0 and distance_aside_m <= goal["radius_m"]


def _hides(block: Mapping[str, Any], ground: Mapping[str, Any]) -> bool:
    """Return whether a piece of terrain is a block that hides a piece of smooth ground, such as a hill.

    A block hides the ground if it is higher, and covers most of the ground or stands on it with most of its own area.
    """
    are_ground_and_block = kind_of(ground).form == "smooth" and kind_of(block).form == "block"
    if not are_ground_and_block or block["height_m"] <= _height_m(ground):
        return False
    # Round ground has no heading.
    ground_area = rectangle({"heading_rad": 0.0, **ground}, reach_m(ground))
    block_area = rectangle(block, reach_m(block))
    shared_m2 = ground_area.intersection(block_area).area
    smaller_m2 = min(_bounding_area_m2(ground), _bounding_area_m2(block))
    return bool(shared_m2 > MIN_COVERED * smaller_m2)


def _bounding_area_m2(piece: Mapping[str, Any]) -> float:
    """Return the area of the rectangle around a piece of terrain, along its own axes."""
    half_length_m, half_width_m = reach_m(piece)
    return 4 * half_length_m * half_width_m


def _height_m(ground: Mapping[str, Any]) -> float:
    """Return about the greatest height (m) of a piece of smooth ground; a hole has none."""
    if ground["kind"] == "rough":
        return ROUGH_REACH_SD * float(ground["height_sd_m"])
    return float(ground.get("height_m", 0.0))


def _place(piece: Mapping[str, Any]) -> str:
    """Return what remarks call a piece: its kind and position in metres, such as "slope at (1, 0)"."""
    kind_name = KIND_NAMES.get(piece["kind"], piece["kind"])
    return f"{kind_name} at ({piece['x_m']:.3g}, {piece['y_m']:.3g})"
