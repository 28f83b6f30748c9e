"""Compute where the runs that did not pass ended along the way from start to goal, and at which obstacle.

Input: counted runs, their designs' bodies, the sampled scenes. Output: counts and obstacles for the page. A run's place
is its progress (m): the distance from start to goal minus the final distance from the car's middle to the goal. A run
ended at an obstacle if the car stood over it. Of several such obstacles it is the one nearest to the middle.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from foldcar.report.environment_labels import objects_of_pieces
from foldcar.report.environment_values import read_scenes
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
        near = numpy.flatnonzero((self.gap_m <= side_m).any(axis=0)).tolist()
        return Course(
            goal_m=self.goal_m,
            names=[self.names[index] for index in near],
            first_m=self.first_m[:, near],
            last_m=self.last_m[:, near],
            gap_m=self.gap_m[:, near],
        )


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
    """Count the runs that did not pass by the place where they ended. Return None if no such run has a place.

    Places are bins along the way from start to goal. Runs of the same design that ended with the same outcome, in the
    same bin and at the same obstacle are counted together.
    """
    # How far along the way to the goal each run came.
    progress_m = course.goal_m[runs.sample] - runs.metrics[:, NUMBERS.index("distance_to_target_m")]
    has_failed = (runs.outcome != OUTCOMES.index("passed")) & ~numpy.isnan(progress_m)
    if not has_failed.any():
        return None
    place_m = progress_m[has_failed]
    design = runs.design[has_failed]
    # A car can only meet an obstacle that is not farther beside the way than the widest car reaches.
    course = course.within(float(extents.side_m.max()))
    obstacle = met_obstacles(course, extents, place_m, design, runs.sample[has_failed])
    goal_m = float(numpy.nanmean(course.goal_m))
    bins = _place_bins(place_m, goal_m)
    # A row for each run; then a row for each combination that occurs, with its number of runs.
    run_rows = numpy.column_stack([design, runs.outcome[has_failed], bins.bin_of(place_m), obstacle])
    combinations, counts = numpy.unique(run_rows, axis=0, return_counts=True)
    designs, outcomes, run_bins, obstacles = combinations.T.tolist()
    return {
        "from_m": round(bins.first * bins.step_m, 6),
        "step_m": bins.step_m,
        "bins": bins.number,
        "goal_m": round(goal_m, 4),
        "obstacles": _obstacle_rows(course),
        "design": designs,
        "outcome": outcomes,
        "bin": run_bins,
        "obstacle": obstacles,
        "count": counts.tolist(),
    }


class _PlaceBins(NamedTuple):
    """Bins of places along the way: so many of the width ``step_m``, from the place ``first`` times ``step_m`` on."""

    step_m: float
    first: int
    number: int

    def bin_of(self, place_m: NDArray[Any]) -> NDArray[Any]:
        """Return the index of the bin in which each place lies."""
        return numpy.asarray(numpy.floor(place_m / self.step_m).astype(int) - self.first)


def _place_bins(place_m: NDArray[Any], goal_m: float) -> _PlaceBins:
    """Return the bins of a histogram of the places at which runs ended.

    Places are distances (m) along the straight way from the start, at 0, to the goal, at ``goal_m``. The bins contain
    both and all places. Their width is the smallest of STEPS_M with which there are at most MAX_BINS bins.
    """
    low_m = min(0.0, float(place_m.min()))
    high_m = max(goal_m, float(place_m.max()))
    step_m = STEPS_M[-1]
    for step in STEPS_M:
        # Bins begin at multiples of the step, so there may be one bin more than the length divided by the step.
        if (high_m - low_m) / step < MAX_BINS - 1:
            step_m = step
            break
    first, last = math.floor(low_m / step_m), math.floor(high_m / step_m)
    return _PlaceBins(step_m, first, last - first + 1)


def met_obstacles(
    course: Course, extents: CarExtents, place_m: NDArray[Any], design: NDArray[Any], sample: NDArray[Any]
) -> NDArray[Any]:
    """Return the index of the obstacle that each car touched where its run ended, or -1 if it touched none.

    The last three arguments and the result have the shape (cars,). ``design`` and ``sample`` are indices, of the car's
    design and of its environment. ``place_m`` is how far the car's middle was along the straight way from start to goal.
    If a car touched several obstacles, the result is the one nearest to its middle. Of two equally near ones it is the
    shorter one.
    """
    car_first_m = place_m - extents.back_m[design]
    car_last_m = place_m + extents.front_m[design]
    car_side_m = extents.side_m[design]
    nearest_m, nearest_obstacle = numpy.full(len(place_m), numpy.inf), numpy.full(len(place_m), -1)
    for obstacle in range(len(course.names)):
        # The obstacle's ends along the way, in the environment of each car.
        first_m, last_m = course.first_m[sample, obstacle], course.last_m[sample, obstacle]
        touches_along = (car_last_m >= first_m - CONTACT_M) & (car_first_m <= last_m + CONTACT_M)
        touches = touches_along & (course.gap_m[sample, obstacle] <= car_side_m)
        # The distance is 0 if the middle of the car is over the obstacle.
        distance_m = numpy.maximum(numpy.maximum(first_m - place_m, place_m - last_m), 0)
        # A small part of the length is added, so that of equally near obstacles the shorter one is nearer.
        distance_m = distance_m + LENGTH_WEIGHT * (last_m - first_m)
        is_nearest = touches & (distance_m < nearest_m)
        nearest_m[is_nearest] = distance_m[is_nearest]
        nearest_obstacle[is_nearest] = obstacle
    return nearest_obstacle


def _obstacle_rows(course: Course) -> list[ObstacleRange]:
    """Return for each obstacle where it begins and ends on the way from the start to the goal, in m.

    ``from_m`` and ``to_m`` are means over the environments. In nearly all environments, the obstacle lies between
    ``least_m`` and ``most_m``: at each end of this range, it exceeds the range in a fraction TAIL of them.
    """
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
    """Return where the goal and the obstacles lie along the way from the start, in each environment.

    ``scenes`` are the environments' scenes by sample. ``objects`` are the names of the terrain's objects, each with its
    number of pieces. An environment without a stored scene, or whose scene has no start or goal, has NaN. The course has
    no obstacles if the scenes consist of different pieces, or if there are more objects than MAX_OBSTACLES.
    """
    obstacles = objects_of_pieces(objects, scenes.values()) or []
    if len(obstacles) > MAX_OBSTACLES:
        obstacles = []
    goal_m = numpy.full(environments, numpy.nan)
    first_m, last_m, gap_m = numpy.full((3, environments, len(obstacles)), numpy.nan)
    for sample, scene in scenes.items():
        start, goal = scene.get("start"), scene.get("goal")
        if not start or not goal:
            continue
        to_goal_x_m, to_goal_y_m = goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]
        goal_m[sample] = math.hypot(to_goal_x_m, to_goal_y_m)
        way_rad = math.atan2(to_goal_y_m, to_goal_x_m)
        for index, obstacle in enumerate(obstacles):
            pieces = [scene["terrain"][piece] for piece in obstacle.pieces]
            extent = _extent_along_way(pieces, start, way_rad)
            first_m[sample, index] = extent.first_m
            last_m[sample, index] = extent.last_m
            gap_m[sample, index] = extent.gap_m
    return Course(
        goal_m=goal_m,
        names=[obstacle.name for obstacle in obstacles],
        first_m=first_m,
        last_m=last_m,
        gap_m=gap_m,
    )


class _ExtentAlongWay(NamedTuple):
    """Where an obstacle begins and ends along the way, and how far beside it the obstacle is, 0 if on it (m)."""

    first_m: float
    last_m: float
    gap_m: float


def _extent_along_way(pieces: Sequence[Mapping[str, Any]], start: Mapping[str, float], way_rad: float) -> _ExtentAlongWay:
    """Return how far an object reaches along the way, and how far beside the way it lies.

    ``pieces`` are the object's pieces. The way is the straight line from the start in the direction ``way_rad``.
    """
    boxes = [_box_around(piece, start, way_rad) for piece in pieces]
    right_m = min(box.right_m for box in boxes)
    left_m = max(box.left_m for box in boxes)
    # The way is at 0. An object on its left has a right side above 0; one on its right has a left side below 0.
    gap_m = max(0.0, right_m, -left_m)
    return _ExtentAlongWay(min(box.first_m for box in boxes), max(box.last_m for box in boxes), gap_m)


class _BoxAlongWay(NamedTuple):
    """A rectangle: from ``first_m`` to ``last_m`` along the way, from ``right_m`` to ``left_m`` across, left positive."""

    first_m: float
    last_m: float
    right_m: float
    left_m: float


def _box_around(piece: Mapping[str, Any], start: Mapping[str, float], way_rad: float) -> _BoxAlongWay:
    """Return the rectangle around a piece whose sides are parallel to the way. See :func:`_extent_along_way`."""
    half_length_m, half_width_m = reach_m(piece)
    # A bell-shaped hill reaches four standard deviations, of which it counts up to two.
    if kind_of(piece).shape == "bell":
        half_length_m, half_width_m = half_length_m / 2, half_width_m / 2
    # Half the sides of the rectangle, along and across the way.
    turn_rad = piece.get("heading_rad", 0.0) - way_rad
    cos, sin = abs(math.cos(turn_rad)), abs(math.sin(turn_rad))
    half_along_m = half_length_m * cos + half_width_m * sin
    half_across_m = half_length_m * sin + half_width_m * cos
    # The middle of the piece: how far ahead of the start, and how far left of the way.
    x_m, y_m = piece["x_m"] - start["x_m"], piece["y_m"] - start["y_m"]
    ahead_m = x_m * math.cos(way_rad) + y_m * math.sin(way_rad)
    left_m = y_m * math.cos(way_rad) - x_m * math.sin(way_rad)
    return _BoxAlongWay(
        first_m=ahead_m - half_along_m,
        last_m=ahead_m + half_along_m,
        right_m=left_m - half_across_m,
        left_m=left_m + half_across_m,
    )


def read_car_extents(store: Store, info: ExperimentInfo) -> CarExtents:
    """Return how far the bodies of the experiment's designs reach. Raises StoreError."""
    body_ids = [row["body_id"] for row in store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", info.id)]
    own_body_ids = set(body_ids)
    extent_by_id = {}
    for row in store.rows(BY_NAME["body"]):
        if row["id"] in own_body_ids:
            extent_by_id[row["id"]] = _body_extent_m(json.loads(row["json"]))
    unknown = (numpy.nan, numpy.nan, numpy.nan)
    extents_m = [extent_by_id.get(body_id, unknown) for body_id in body_ids]
    front_m, back_m, side_m = numpy.array(extents_m).reshape(-1, 3).T
    return CarExtents(front_m, back_m, side_m)


def _body_extent_m(body: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return how far a body of docs/carsim.md reaches ahead, behind and sideways (m); NaN without any part."""
    fronts_m, backs_m, sides_m = [], [], []
    for wheel in body.get("wheels", ()):
        if "x_m" in wheel:
            fronts_m.append(wheel["x_m"] + wheel["radius_m"])
            backs_m.append(wheel["radius_m"] - wheel["x_m"])
            sides_m.append((body["track_m"] + wheel["width_m"]) / 2)
    for segment in body.get("segments", ()):
        if "x_m" in segment:
            half_length_m = segment["length_m"] / 2
            fronts_m.append(segment["x_m"] + half_length_m)
            backs_m.append(half_length_m - segment["x_m"])
            sides_m.append(segment["width_m"] / 2)
    if not fronts_m:
        return numpy.nan, numpy.nan, numpy.nan
    return max(fronts_m), max(backs_m), max(sides_m)
