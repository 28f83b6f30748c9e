"""How a filmed drive ended, by the rules that end the simulator's runs (docs/carsim.md), as far as a film shows it.

Input: a track on the trial's clock, the scene as placed, the time limit. Output: a proposal; a person decides.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.camera.detection import Floats

# As in sim2d/lib/trial/ending.h.
TIPPED_UP = 0.26
STUCK_M, STUCK_RAD, STUCK_S = 0.010, 0.035, 4.0
HELD_M, HELD_S = 0.050, 8.0
# A marker that is last seen tilted like this, and never again, is under the car.
TIPPING_UP = 0.6
UNSEEN_S = 0.7


@dataclass(frozen=True)
class Ending:
    """``outcome`` is one of a trial's, None where the film does not tell; where and when (trial's time), and why."""

    outcome: str | None
    time_s: float
    x_m: float
    y_m: float
    why: str


def propose(
    times_s: Floats, poses: Floats, scene: Mapping[str, Any], time_limit_s: float, turns: bool, film_end_s: float
) -> Ending:
    """The end of the drive; ``turns``: it was told to turn on the spot, or nearly."""
    driving = numpy.flatnonzero((times_s >= 0) & (times_s <= time_limit_s))
    if not len(driving):
        return Ending(None, 0.0, float(poses[0, 0]), float(poses[0, 1]), "the film does not show the drive")
    was_short = True
    moved = left = int(driving[0])
    for at in driving.tolist():
        time_s, (x, y, _, heading, pitch, roll) = float(times_s[at]), poses[at]
        if math.cos(pitch) * math.cos(roll) < TIPPED_UP:
            return Ending("tipped", time_s, x, y, f"tilted by more than {math.degrees(math.acos(TIPPED_UP)):.0f}°")
        short = _short_of_goal(scene["goal"], x, y)
        if was_short and not short:
            return _passed(times_s, poses, scene["goal"], at)
        was_short = short
        course = scene["course"]
        if not (course["x_min_m"] <= x <= course["x_max_m"] and course["y_min_m"] <= y <= course["y_max_m"]):
            return Ending("off_course", time_s, x, y, "its middle left the course")
        if math.dist((x, y), poses[left, :2]) > HELD_M:
            left = at
        elif not turns and time_s - times_s[left] >= HELD_S:
            return Ending("stuck", time_s, x, y, f"less than {1000 * HELD_M:.0f} mm in {HELD_S:g} s")
        if math.dist((x, y), poses[moved, :2]) > STUCK_M or abs(heading - poses[moved, 3]) > STUCK_RAD:
            moved = at
        elif time_s - times_s[moved] >= STUCK_S:
            return Ending("stuck", time_s, x, y, f"less than {1000 * STUCK_M:.0f} mm in {STUCK_S:g} s")
    last = int(driving[-1])
    time_s, (x, y, _, _, pitch, roll) = float(times_s[last]), poses[last]
    end_s = min(film_end_s, time_limit_s)
    if end_s - time_s > UNSEEN_S:
        if math.cos(pitch) * math.cos(roll) < TIPPING_UP:
            return Ending("tipped", time_s, x, y, "last seen as it tipped")
        return Ending(None, time_s, x, y, "its marker is not seen any more")
    if film_end_s >= time_limit_s:
        return Ending("timeout", time_limit_s, x, y, f"the time limit of {time_limit_s:g} s")
    return Ending(None, time_s, x, y, "the film ends before the drive")


def _passed(times_s: Floats, poses: Floats, goal: Mapping[str, Any], at: int) -> Ending:
    """The moment between two frames in which the car reached the goal."""
    steps = numpy.linspace(0, 1, 21)
    before = max(at - 1, 0)
    share = next(
        s for s in steps if not _short_of_goal(goal, *(poses[before, :2] + s * (poses[at, :2] - poses[before, :2])))
    )
    x, y = poses[before, :2] + share * (poses[at, :2] - poses[before, :2])
    time_s = times_s[before] + share * (times_s[at] - times_s[before])
    return Ending("passed", float(time_s), float(x), float(y), "its middle reached the goal")


def _short_of_goal(goal: Mapping[str, Any] | None, x: float, y: float) -> bool:
    if goal is None:
        return True
    dx, dy = goal["x_m"] - x, goal["y_m"] - y
    if goal["kind"] == "disc":
        return math.hypot(dx, dy) > float(goal["radius_m"])
    return bool(dx * math.cos(goal["heading_rad"]) + dy * math.sin(goal["heading_rad"]) > 0)
