"""Compute where the runs that did not pass ended along the way from start to goal, and at which obstacle.

Input: counted runs, their designs' bodies, the sampled scenes. Output: counts and obstacles for the page. A run's place
is its progress (m): the distance from start to goal minus the final distance from the car's middle to the goal. A run
ended at an obstacle if the car stood over it. Of several such obstacles it is the one nearest to the middle.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.report.environment_values import objects_of_pieces, read_scenes
from foldcar.report.page_types import ObstacleRange, RunEnds
from foldcar.scenes.terrain_kinds import kind_of, reach_m
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.run_arrays import RunArrays
from foldcar.store.tables import BY_NAME, DESIGN

# Widths of bins (m): the narrowest that makes at most MAX_BINS is taken.
STEPS_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
MAX_BINS = 60
# With more objects no obstacles are named.
MAX_OBSTACLES = 60
# An obstacle's range omits this fraction of the environments at each end.
TAIL = 0.05
# Of equally near obstacles the shorter one counts, as a pothole in its ground: a metre of length counts as so many metres
# of distance.
LENGTH_WEIGHT = 0.001
# Wheels that press against a vertical face stand a millimetre or two before it, because contacts give way.
CONTACT_M = 0.005


@dataclass(frozen=True)
class Course:
    """The straight way from start to goal in each environment; its length is ``goal_m`` (environments,), NaN without.

    Obstacles, arrays (environments, obstacles), reach from ``first_m`` to ``last_m`` along the way. They are ``gap_m``
    beside it, 0 if they lie on it.
    """

    goal_m: NDArray[Any]
    names: Sequence[str]
    first_m: NDArray[Any]
    last_m: NDArray[Any]
    gap_m: NDArray[Any]

    def within(self, side_m: float) -> "Course":
        """Return the course with the obstacles that are at most ``side_m`` beside the way in any environment."""
        kept = numpy.flatnonzero((self.gap_m <= side_m).any(axis=0)).tolist()
        names = [self.names[index] for index in kept]
        return Course(self.goal_m, names, self.first_m[:, kept], self.last_m[:, kept], self.gap_m[:, kept])


@dataclass(frozen=True)
class CarExtents:
    """The extents of each design's body from its middle (m), arrays (designs,)."""

    front_m: NDArray[Any]
    back_m: NDArray[Any]
    side_m: NDArray[Any]


def read_run_ends(store: Store, info: ExperimentInfo, runs: RunArrays) -> RunEnds | None:
    """Return where counted ``runs`` that did not pass ended; None if there are none. Raises StoreError."""
    # Progress towards the goal is meaningless for a car that drives in circles.
    if not info.success_defined or info.yaw_rate_rad_s or not len(runs.design):
        return None
    course = read_course(info.terrain_objects, read_scenes(store, info), info.environments)
    return run_ends(course, read_car_extents(store, info), runs)


def run_ends(course: Course, extents: CarExtents, runs: RunArrays) -> RunEnds | None:
    """Return where counted ``runs`` that did not pass ended; None if none of them has a place."""
    # How far along the way to the goal each run came.
    progress_m = course.goal_m[runs.sample] - runs.metrics[:, NUMBERS.index("distance_to_target_m")]
    failed = (runs.outcome != OUTCOMES.index("passed")) & ~numpy.isnan(progress_m)
    if not failed.any():
        return None
    place_m, design, sample, outcome = progress_m[failed], runs.design[failed], runs.sample[failed], runs.outcome[failed]
    course = course.within(float(extents.side_m.max()))
    goal_m = float(numpy.nanmean(course.goal_m))
    low_m, high_m = min(0.0, float(place_m.min())), max(goal_m, float(place_m.max()))
    # One bin less, because the bins begin at a multiple of the step.
    step_m = next((step for step in STEPS_M if (high_m - low_m) / step < MAX_BINS - 1), STEPS_M[-1])
    bins = numpy.floor(place_m / step_m).astype(int)
    first, last = math.floor(low_m / step_m), math.floor(high_m / step_m)
    cells = numpy.column_stack([design, outcome, bins - first, met_obstacles(course, extents, place_m, design, sample)])
    cells, counts = numpy.unique(cells, axis=0, return_counts=True)
    cell_columns = cells.T.tolist()
    return {
        "from_m": round(first * step_m, 6),
        "step_m": step_m,
        "bins": last - first + 1,
        "goal_m": round(goal_m, 4),
        "obstacles": _obstacle_rows(course),
        "design": cell_columns[0],
        "outcome": cell_columns[1],
        "bin": cell_columns[2],
        "obstacle": cell_columns[3],
        "count": counts.tolist(),
    }


def met_obstacles(
    course: Course, extents: CarExtents, place_m: NDArray[Any], design: NDArray[Any], sample: NDArray[Any]
) -> NDArray[Any]:
    """Return the index of the obstacle that each car (cars,) touched with its middle at ``place_m``; -1 without one.

    If a car touched several obstacles, it is the nearest one, or the shorter one of two equally near ones.
    """
    front_m, back_m, side_m = (values[design] for values in (extents.front_m, extents.back_m, extents.side_m))
    nearest_m, obstacles = numpy.full(len(place_m), numpy.inf), numpy.full(len(place_m), -1)
    for obstacle in range(len(course.names)):
        first_m, last_m, gap_m = (values[sample, obstacle] for values in (course.first_m, course.last_m, course.gap_m))
        over = (place_m + front_m >= first_m - CONTACT_M) & (place_m - back_m <= last_m + CONTACT_M) & (gap_m <= side_m)
        # A small part of the length is added, so that of equally near obstacles the shorter one is nearer.
        distance_m = numpy.maximum(numpy.maximum(first_m - place_m, place_m - last_m), 0) + LENGTH_WEIGHT * (
            last_m - first_m
        )
        nearer = over & (distance_m < nearest_m)
        nearest_m[nearer], obstacles[nearer] = distance_m[nearer], obstacle
    return obstacles


def _obstacle_rows(course: Course) -> list[ObstacleRange]:
    """Return each obstacle's name, its mean ends (m), and the ends of the range that contains it in most environments."""
    return [
        {
            "name": name,
            "from_m": round(float(numpy.nanmean(first_m)), 4),
            "to_m": round(float(numpy.nanmean(last_m)), 4),
            "least_m": round(float(numpy.nanquantile(first_m, TAIL)), 4),
            "most_m": round(float(numpy.nanquantile(last_m, 1 - TAIL)), 4),
        }
        for name, first_m, last_m in zip(course.names, course.first_m.T, course.last_m.T, strict=True)
    ]


def read_course(objects: Sequence[tuple[str, int]], scenes: Mapping[int, Mapping[str, Any]], environments: int) -> Course:
    """Return the course of ``scenes`` by sample; ``objects`` are ExperimentInfo's ``terrain_objects``.

    Scenes with different pieces, or with more objects than MAX_OBSTACLES, have no obstacles.
    """
    named = objects_of_pieces(objects, scenes.values()) or []
    named = named if len(named) <= MAX_OBSTACLES else []
    goal_m = numpy.full(environments, numpy.nan)
    # (3, environments, obstacles): where they begin and end along the way, and how far beside it they are.
    ends_m = numpy.full((3, environments, len(named)), numpy.nan)
    for sample, scene in scenes.items():
        start, goal = scene.get("start"), scene.get("goal")
        if not start or not goal:
            continue
        way_m = goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]
        goal_m[sample], way_rad = math.hypot(*way_m), math.atan2(way_m[1], way_m[0])
        for index, (_, pieces) in enumerate(named):
            ends_m[:, sample, index] = _extent_m([scene["terrain"][piece] for piece in pieces], start, way_rad)
    return Course(goal_m, [name for name, _ in named], *ends_m)


def _extent_m(
    pieces: Sequence[Mapping[str, Any]], start: Mapping[str, float], way_rad: float
) -> tuple[float, float, float]:
    """Return where an object's pieces begin and end along the way, and how far beside it they are (m).

    The way is the straight line from the start in the direction ``way_rad``; an object on the way is 0 m beside it.
    """
    cos, sin = math.cos(way_rad), math.sin(way_rad)
    ends_m = []
    for piece in pieces:
        # A bell-shaped hill counts up to two standard deviations.
        fraction = 0.5 if kind_of(piece).shape == "bell" else 1.0
        length_m, width_m = (fraction * reach for reach in reach_m(piece))
        # Half the sides of the box around the turned piece, along and across the way.
        turn_rad = piece.get("heading_rad", 0.0) - way_rad
        turn_cos, turn_sin = abs(math.cos(turn_rad)), abs(math.sin(turn_rad))
        along_m, across_m = length_m * turn_cos + width_m * turn_sin, length_m * turn_sin + width_m * turn_cos
        x_m, y_m = piece["x_m"] - start["x_m"], piece["y_m"] - start["y_m"]
        ahead_m, left_m = x_m * cos + y_m * sin, y_m * cos - x_m * sin
        ends_m.append((ahead_m - along_m, ahead_m + along_m, left_m - across_m, left_m + across_m))
    first_m, last_m, right_m, left_m = (
        choose(ends) for choose, ends in zip((min, max, min, max), zip(*ends_m, strict=True), strict=True)
    )
    return first_m, last_m, max(0.0, right_m, -left_m)


def read_car_extents(store: Store, info: ExperimentInfo) -> CarExtents:
    """Return how far the bodies of the experiment's designs reach. Raises StoreError."""
    bodies = [row["body_id"] for row in store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", info.id)]
    body_ids = set(bodies)
    by_id = {row["id"]: _reach_m(json.loads(row["json"])) for row in store.rows(BY_NAME["body"]) if row["id"] in body_ids}
    unknown = (numpy.nan,) * 3
    front_m, back_m, side_m = numpy.array([by_id.get(body, unknown) for body in bodies]).reshape(-1, 3).T
    return CarExtents(front_m, back_m, side_m)


def _reach_m(body: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return how far a body of docs/carsim.md reaches ahead, behind and sideways (m)."""
    wheels, segments = ([part for part in body.get(kind, ()) if "x_m" in part] for kind in ("wheels", "segments"))
    ends_m = [(wheel["x_m"], wheel["radius_m"]) for wheel in wheels]
    ends_m += [(segment["x_m"], segment["length_m"] / 2) for segment in segments]
    sides_m = [(body["track_m"] + wheel["width_m"]) / 2 for wheel in wheels]
    sides_m += [segment["width_m"] / 2 for segment in segments]
    if not ends_m:
        return numpy.nan, numpy.nan, numpy.nan
    return max(x + reach for x, reach in ends_m), max(reach - x for x, reach in ends_m), max(sides_m)
