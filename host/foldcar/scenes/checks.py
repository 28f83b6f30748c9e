"""Checks that a scene can be simulated: objects upright and on the course, a free start, a goal that can be reached.

Input: parts of the scene in the simulator's frame and their Scenic objects. Each function raises UnusableError if its
check fails, and returns nothing.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from shapely import affinity, box

from foldcar.scenes.reading import UnusableError, finite
from foldcar.scenes.terrain_kinds import bounds_m, kind_of, reach_m

# Scenic's specifiers such as `on` leave a gap of its contact tolerance.
STANDING_TOLERANCE_M = 1e-3
LEVEL_TOLERANCE_RAD = 1e-6
# Objects that only touch do not overlap.
ROUNDING_M2 = 1e-9
MAX_COORDINATE_M = 1000.0

Pose = Mapping[str, Any]


def check_standing(thing: Any) -> None:
    """Check that an object stands upright on the ground: z is 0 or half its height, pitch and roll are 0."""
    z, height = finite("z", thing.position.z, thing), finite("height", thing.height, thing)
    if abs(z) > STANDING_TOLERANCE_M and abs(z - height / 2) > STANDING_TOLERANCE_M:
        raise UnusableError(
            f"z: {z} m: everything stands on the ground: give x and y only, or a region of the ground such as "
            "RectangularRegion; `visible` and `in everywhere` mean a volume",
            thing,
        )
    for name, angle in (("pitch", thing.orientation.pitch), ("roll", thing.orientation.roll)):
        # NaN fulfils no comparison, so it is refused too.
        if not abs(angle) <= LEVEL_TOLERANCE_RAD:
            raise UnusableError(f"{name}: {float(angle):.4g} rad: everything stands upright", thing)


def check_course(course: Mapping[str, float]) -> None:
    """Check that the course has a positive area, and its sides are within the simulator's limits."""
    for axis in ("x", "y"):
        low, high = course[f"{axis}_min_m"], course[f"{axis}_max_m"]
        for side, value in (("min", low), ("max", high)):
            if abs(value) > MAX_COORDINATE_M:
                raise UnusableError(f"param course_{axis}_{side}: {value} is beyond ±{MAX_COORDINATE_M:g} m")
        if low >= high:
            raise UnusableError(f"param course_{axis}_min: {low} is not below course_{axis}_max {high}")


def check_inside(course: Mapping[str, float], place: Pose, thing: Any) -> None:
    """Check that the position of a start, a goal or a Marker is on the course."""
    _check_overlap(course, place, (place["x_m"], place["x_m"], place["y_m"], place["y_m"]), thing)


def check_on_course(course: Mapping[str, float], pieces: Iterable[Pose], thing: Any) -> None:
    """Check that every piece of a Terrain object overlaps the course, because cars do not leave it."""
    for piece in pieces:
        _check_overlap(course, piece, bounds_m(piece), thing)


def check_free_start(start: Pose, ego: Any, terrain: Sequence[Pose], owners: Sequence[Any]) -> None:
    """Check that the start is not across the edge of a block, where the car would not stand level.

    ``owners`` are the Scenic objects of the pieces of ``terrain``.
    """
    half_size_m = (finite("length", ego.length, ego) / 2, finite("width", ego.width, ego) / 2)
    for piece, owner in zip(terrain, owners, strict=True):
        if kind_of(piece).form != "block":
            continue
        half_piece_m = reach_m(piece)
        distance_m = math.hypot(piece["x_m"] - start["x_m"], piece["y_m"] - start["y_m"])
        # Farther apart than both half diagonals, car and piece cannot overlap.
        is_far = distance_m > math.hypot(*half_piece_m) + math.hypot(*half_size_m)
        if is_far or _stands_level(start, half_size_m, piece):
            continue
        edge = f"the edge of a {piece['kind']} at ({piece['x_m']:.4g}, {piece['y_m']:.4g})"
        raise UnusableError(f"the start is inside an obstacle: the car would stand across {edge}", owner)


def _stands_level(start: Pose, half: tuple[float, float], piece: Pose) -> bool:
    """Return whether a car with these half sizes (m) stands completely beside a piece, or completely on it."""
    car = rectangle(start, half)
    ground = rectangle(piece, reach_m(piece))
    shared_m2 = car.intersection(ground).area
    is_beside = shared_m2 < ROUNDING_M2
    is_on_it = shared_m2 > car.area - ROUNDING_M2
    return bool(is_beside or is_on_it)


def check_goal_ahead(start: Pose, goal: Pose, thing: Any) -> None:
    """Check that the start is outside the goal's disc, or before the goal's line."""
    dx_m, dy_m = goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]
    if goal["kind"] == "line":
        # The distance from the start to the line, negative behind it. The goal's heading is perpendicular to its line.
        distance_m = dx_m * math.cos(goal["heading_rad"]) + dy_m * math.sin(goal["heading_rad"])
        if distance_m <= STANDING_TOLERANCE_M:
            raise UnusableError(
                "the start is not before the goal line: the Goal must face the direction in which the car crosses it",
                thing,
            )
        return
    radius_m = goal["radius_m"]
    if math.hypot(dx_m, dy_m) <= radius_m:
        raise UnusableError(f"the start is within the goal's reach of {radius_m} m", thing)


def _check_overlap(course: Mapping[str, float], place: Pose, bounds: Sequence[float], thing: Any) -> None:
    """Check that ``bounds`` (x_min, x_max, y_min, y_max) of the object at ``place`` overlap the course."""
    x_min, x_max, y_min, y_max = bounds
    for axis, object_min, object_max in (("x", x_min, x_max), ("y", y_min, y_max)):
        course_min, course_max = course[f"{axis}_min_m"], course[f"{axis}_max_m"]
        if object_max < course_min or object_min > course_max:
            position = place[f"{axis}_m"]
            limits = f"{course_min} to {course_max} (param course_{axis}_…)"
            raise UnusableError(f"{axis}: {position} m is outside the course, {limits}", thing)


def rectangle(place: Pose, half: tuple[float, float]) -> Any:
    """Return a rectangle as a Shapely polygon: ``place`` is its middle and heading, ``half`` its half sizes (m).

    The first half size is along the heading, the second across it.
    """
    half_length_m, half_width_m = half
    unturned = box(-half_length_m, -half_width_m, half_length_m, half_width_m)
    turned = affinity.rotate(unturned, place["heading_rad"], (0, 0), use_radians=True)
    return affinity.translate(turned, place["x_m"], place["y_m"])
