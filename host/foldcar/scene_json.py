"""Turns a sampled Scenic scene into the "scene" of docs/carsim.md, or says what cannot be simulated.

The one place where Scenic's headings (0 along +y) become the simulator's (0 along +x). Objects are recognised
by the class names of scenarios/model.scenic; a class derived from one of them in a program counts as what it
derives from.
"""

import math
from typing import Any

from foldcar.errors import FoldcarError

# Scenes are hashed and compared as text: rounding hides the last bits, in which machines may differ.
DECIMALS = 9
# `on` and the like leave a gap of Scenic's contact tolerance.
STANDING_TOLERANCE_M = 1e-3
LEVEL_TOLERANCE_RAD = 1e-6
COURSE_SIDES = ("x_min", "x_max", "y_min", "y_max")


def scene_object(scene: Any, where: str) -> dict[str, Any]:
    """The scene in metres and radians, without an id. ``where`` begins the message of a FoldcarError."""
    try:
        return _scene_object(scene)
    except _UnusableError as problem:
        raise FoldcarError(f"{where}: {problem}") from None


class _UnusableError(Exception):
    pass


def _scene_object(scene: Any) -> dict[str, Any]:
    terrain: list[dict[str, Any]] = []
    goals = []
    for thing in scene.objects:
        kinds = {ancestor.__name__ for ancestor in type(thing).__mro__}
        _check_standing(thing)
        if "Terrain" in kinds:
            terrain.extend(_boxes(thing))
        elif "Goal" in kinds:
            goals.append(thing)
        elif "Robot" in kinds:
            if thing is not scene.egoObject:
                raise _UnusableError(f"{_name(thing)} is a second Robot: only the ego drives")
        elif "Marker" not in kinds:
            raise _UnusableError(f"{_name(thing)} is none of model.scenic's Terrain, Marker, Goal or Robot")
    ego = scene.egoObject
    if not any(ancestor.__name__ == "Robot" for ancestor in type(ego).__mro__):
        raise _UnusableError(f"the ego is a {type(ego).__name__}, not a Robot")
    if len(goals) != 1:
        raise _UnusableError(f"{len(goals)} Goals: the program has to place exactly one")
    course = {f"{side}_m": _param(scene, f"course_{side}") for side in COURSE_SIDES}
    for axis in ("x", "y"):
        if course[f"{axis}_min_m"] >= course[f"{axis}_max_m"]:
            limit = course[f"{axis}_max_m"]
            raise _UnusableError(
                f"param course_{axis}_min: {course[f'{axis}_min_m']} is not below course_{axis}_max {limit}"
            )
    friction = _param(scene, "friction")
    if friction <= 0:
        raise _UnusableError(f"param friction: {friction} is not above 0")
    start, goal = _pose(ego), _goal(goals[0])
    _check_inside(course, "the start", start)
    _check_inside(course, "the goal", goal)
    _check_ahead(start, goal)
    return {"friction": friction, "terrain": terrain, "start": start, "goal": goal, "course": course}


def _boxes(thing: Any) -> list[dict[str, Any]]:
    try:
        parts = list(thing.boxes())
    except Exception as error:
        raise _UnusableError(f"{_name(thing)}: {type(error).__name__}: {error}") from error
    if not parts:
        raise _UnusableError(f"{_name(thing)} is made of no boxes")
    boxes = []
    for length, width, height in parts:
        sizes = {"length": length, "width": width, "height": height}
        for name, size in sizes.items():
            if _number(thing, name, size) <= 0:
                raise _UnusableError(f"{_name(thing)}: {name}: {size} is not above 0")
        boxes.append(
            {"kind": "box", **_pose(thing), **{f"{n}_m": _number(thing, n, s) for n, s in sizes.items()}}
        )
    return boxes


def _goal(thing: Any) -> dict[str, Any]:
    pose = _pose(thing)
    if thing.reach is None:
        return {"kind": "line", **pose}
    reach = _number(thing, "reach", thing.reach)
    if reach <= 0:
        raise _UnusableError(f"{_name(thing)}: reach: {thing.reach} is not above 0")
    return {"kind": "disc", "x_m": pose["x_m"], "y_m": pose["y_m"], "radius_m": reach}


def _pose(thing: Any) -> dict[str, float]:
    heading_rad = math.remainder(_number(thing, "heading", thing.heading) + math.pi / 2, 2 * math.pi)
    return {
        "x_m": _number(thing, "x", thing.position.x),
        "y_m": _number(thing, "y", thing.position.y),
        "heading_rad": _rounded(heading_rad),
    }


def _check_standing(thing: Any) -> None:
    """Everything stands upright on z = 0: no z is given, or that of the middle of a thing on the ground."""
    z, height = _number(thing, "z", thing.position.z), _number(thing, "height", thing.height)
    if abs(z) > STANDING_TOLERANCE_M and abs(z - height / 2) > STANDING_TOLERANCE_M:
        raise _UnusableError(f"{_name(thing)}: z: {z} m: everything stands on the ground, give x and y only")
    for name, angle in (("pitch", thing.orientation.pitch), ("roll", thing.orientation.roll)):
        if not abs(angle) <= LEVEL_TOLERANCE_RAD:
            raise _UnusableError(f"{_name(thing)}: {name}: {float(angle):.4g} rad: everything stands upright")


def _check_inside(course: dict[str, float], what: str, pose: dict[str, Any]) -> None:
    for axis in ("x", "y"):
        value, low, high = pose[f"{axis}_m"], course[f"{axis}_min_m"], course[f"{axis}_max_m"]
        if not low <= value <= high:
            raise _UnusableError(
                f"{what}: {axis}: {value} m is outside the course, {low} to {high} (param course_{axis}_…)"
            )


def _check_ahead(start: dict[str, Any], goal: dict[str, Any]) -> None:
    dx_m, dy_m = goal["x_m"] - start["x_m"], goal["y_m"] - start["y_m"]
    if goal["kind"] == "disc":
        if math.hypot(dx_m, dy_m) <= goal["radius_m"]:
            raise _UnusableError(f"the start is within the goal's reach of {goal['radius_m']} m")
    elif dx_m * math.cos(goal["heading_rad"]) + dy_m * math.sin(goal["heading_rad"]) <= STANDING_TOLERANCE_M:
        raise _UnusableError(
            "the start is not before the goal line: the Goal has to face the way the car crosses it"
        )


def _param(scene: Any, name: str) -> float:
    if name not in scene.params:
        raise _UnusableError(f"param {name} is missing: the program has to begin with `model model`")
    return _finite(f"param {name}", scene.params[name])


def _number(thing: Any, name: str, value: Any) -> float:
    try:
        return _finite(name, value)
    except _UnusableError as problem:
        raise _UnusableError(f"{_name(thing)}: {problem}") from None


def _finite(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise _UnusableError(f"{name}: {value} is no number") from None
    if not math.isfinite(number):
        raise _UnusableError(f"{name}: {number} is not finite")
    return _rounded(number)


def _rounded(number: float) -> float:
    return round(number, DECIMALS) + 0.0  # + 0.0 turns -0.0 into 0.0


def _name(thing: Any) -> str:
    place = (thing.position.x, thing.position.y)
    x, y = (f"{value:.4g}" if isinstance(value, int | float) else str(value) for value in place)
    return f"{type(thing).__name__} at ({x}, {y})"
