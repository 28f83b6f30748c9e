"""When a run is over: the rules of docs/carsim.md's ``outcome``, for states that another engine gives."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.simulation.carsim_limits import TrialRules


@dataclass(frozen=True, slots=True)
class State:
    """The car's origin, its angles, and the upward part of its up axis."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    up: float


def distance_to_target_m(scene: Mapping[str, Any], state: State) -> float | None:
    """From the car's middle to the target, in the ground plane; None without a goal."""
    goal = scene["goal"]
    return None if goal is None else math.hypot(state.x_m - goal["x_m"], state.y_m - goal["y_m"])


class Ending:
    """Made as the trial starts; then asked at every state. The rules are carsim's."""

    def __init__(self, scene: Mapping[str, Any], start: State, rules: TrialRules) -> None:
        self._scene = scene
        self._rules = rules
        self._was_short_of_goal = self._goal_distance_m(start) > 0
        self._moved_at = start
        self._moved_at_s = 0.0

    def check(self, state: State, elapsed_s: float) -> str | None:
        """The outcome, if this state ends the run."""
        if state.up < self._rules.tipped_up:
            return "tipped"
        short_of_goal = self._goal_distance_m(state) > 0
        if self._was_short_of_goal and not short_of_goal:
            return "passed"
        self._was_short_of_goal = short_of_goal
        course = self._scene["course"]
        inside_x = course["x_min_m"] <= state.x_m <= course["x_max_m"]
        if not (inside_x and course["y_min_m"] <= state.y_m <= course["y_max_m"]):
            return "off_course"
        moved_m = math.hypot(state.x_m - self._moved_at.x_m, state.y_m - self._moved_at.y_m)
        turned_rad = abs(math.remainder(state.heading_rad - self._moved_at.heading_rad, math.tau))
        if moved_m > self._rules.stuck_distance_m or turned_rad > self._rules.stuck_turn_rad:
            self._moved_at, self._moved_at_s = state, elapsed_s
        elif elapsed_s - self._moved_at_s >= self._rules.stuck_time_s:
            return "stuck"
        return None

    def _goal_distance_m(self, state: State) -> float:
        """To the goal; zero or negative once reached."""
        goal = self._scene["goal"]
        if goal is None:
            return math.inf
        dx, dy = goal["x_m"] - state.x_m, goal["y_m"] - state.y_m
        if goal["kind"] == "disc":
            return float(math.hypot(dx, dy) - goal["radius_m"])
        return float(dx * math.cos(goal["heading_rad"]) + dy * math.sin(goal["heading_rad"]))
