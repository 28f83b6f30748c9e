"""How a drive went, as simulation and trials have it alike: where it ended, and features of its path.

The way from start to goal has STAGES parts of equal length. A drive ends in one of ENDS: at the goal, or in a part of
the way, tipped or not. Features of each part that was driven to its end: the logarithm of the time that it took, the
car's place across the way and its heading there; of the whole drive the largest pitch and roll, and the logarithm of its
time if it reached the goal. A feature is NaN where a drive has none, or nobody saw it.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from foldcar.inference.calibration.parameters import FloatArray

STAGES = 4
PASSED, TIPPED = "passed", "tipped"
# The end of a drive: 0 passed, then by the part of the way and whether it tipped.
ENDS = 1 + 2 * STAGES
# What a feature speaks of, where simulation and trials differ in it.
SPEED, CLIMBING, TURNING, TIPPING = "speed", "climbing", "turning", "tipping"
FAMILIES = (
    *(family for stage in range(STAGES) for family in (SPEED if stage == 0 else CLIMBING, TURNING, TURNING)),
    CLIMBING, TIPPING, SPEED,
)  # fmt: skip
FEATURES = len(FAMILIES)
FAMILY_NAMES = tuple(dict.fromkeys(FAMILIES))
FAMILY_OF = tuple(FAMILY_NAMES.index(family) for family in FAMILIES)
PITCH, ROLL, TIME = FEATURES - 3, FEATURES - 2, FEATURES - 1
# Parts of the way are driven in at least this time (s), and angles below this one (rad) are as good as none.
LEAST_S, LEAST_RAD = 1e-3, 0.02


def drive_end(outcome: str, features: FloatArray) -> int:
    """The end of a drive whose path is known, as an index of ENDS."""
    if outcome == PASSED:
        return 0
    stage = min(int(np.count_nonzero(np.isfinite(features[: 3 * STAGES : 3]))), STAGES - 1)
    return 1 + 2 * stage + (outcome == TIPPED)


def possible_ends(outcome: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which of ENDS (ENDS,) a trial may have had of which only the outcome is known."""
    ends = np.arange(ENDS)
    if outcome == PASSED:
        return np.asarray(ends == 0)
    if outcome == "not_passed":
        return np.asarray(ends > 0)
    return np.asarray((ends > 0) & ((ends % 2 == 0) == (outcome == TIPPED)))


def path_features(rows: FloatArray, scene: Mapping[str, Any]) -> FloatArray:
    """The features (FEATURES,) of a path of rows (n, 7): time, x, y, z, heading, pitch, roll, in the scene as planned."""
    along, across, heading_rad = _in_the_way(rows, scene)
    furthest = np.maximum.accumulate(along)
    reached = int(np.searchsorted(furthest, 1.0))
    # After the goal a built car drives on, a simulated one does not.
    shown = rows[: reached + 1]
    features, before_s = np.full(FEATURES, np.nan), 0.0
    # A run ends when the goal is reached, and its last row may lie a rounding before it.
    places = np.append(np.arange(1, STAGES) / STAGES, 1 - 1e-3)
    for stage, place in enumerate(places):
        row = int(np.searchsorted(furthest, place))
        if row == len(rows):
            break
        span = slice(max(0, row - 1), row + 1)
        at = [np.interp(place, along[span], column[span]) for column in (rows[:, 0], across, heading_rad)]
        features[3 * stage : 3 * stage + 3] = math.log(max(at[0] - before_s, LEAST_S)), at[1], at[2]
        before_s = at[0]
    features[PITCH], features[ROLL] = (magnitude(float(np.abs(shown[:, column]).max())) for column in (5, 6))
    return features


def told_features(elapsed_s: float | None, passed: bool) -> FloatArray:
    """The features of a trial without a path: its time, if it passed."""
    features = np.full(FEATURES, np.nan)
    if passed and elapsed_s is not None and elapsed_s > 0:
        features[TIME] = math.log(elapsed_s)
    return features


def magnitude(angle_rad: float) -> float:
    """The feature of an angle's size (rad)."""
    return math.log(angle_rad + LEAST_RAD)


def _in_the_way(rows: FloatArray, scene: Mapping[str, Any]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Progress along the way, 0 at the start and 1 at the goal; place across it (m); heading off that at the start."""
    start, goal = scene["start"], scene["goal"]
    offset = np.array([goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]])
    bearing_rad = goal["heading_rad"] if goal["kind"] == "line" else math.atan2(offset[1], offset[0])
    ahead = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    length_m = float(offset @ ahead)
    if goal["kind"] == "disc":
        length_m -= goal["radius_m"]
    places = rows[:, 1:3] - [start["x_m"], start["y_m"]]
    along = places @ ahead / max(length_m, 1e-3)
    heading_rad = np.unwrap(rows[:, 4]) - start["heading_rad"]
    heading_rad -= 2 * math.pi * np.round(heading_rad[0] / (2 * math.pi))
    return along, places @ [-ahead[1], ahead[0]], heading_rad
