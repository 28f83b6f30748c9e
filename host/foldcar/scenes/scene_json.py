"""Turns a sampled Scenic scene into the "scene" of docs/carsim.md, or says in one line why it cannot.

Objects are recognised by the class names of vocabulary/model.scenic; a class derived from one of them in a
program counts as what it derives from.
"""

from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.checks import (
    check_course,
    check_free_start,
    check_goal_ahead,
    check_inside,
    check_on_course,
    check_standing,
)
from foldcar.scenes.reading import UnusableError, finite, is_a, param, pose
from foldcar.scenes.terrain import MOST_PIECES, terrain_pieces

MOST_FRICTION = 5.0
COURSE_SIDES = ("x_min", "x_max", "y_min", "y_max")


def scene_object(scene: Any, program: Path, where: str, needs_goal: bool = True) -> dict[str, Any]:
    """The scene in metres and radians, without an id.

    ``where`` stands in a FoldcarError's message after the program's name. Without ``needs_goal`` the program
    may place no Goal, and the scene's is None then.
    """
    try:
        return _scene_object(scene, needs_goal)
    except UnusableError as problem:
        raise FoldcarError(f"{program}: {where}: {_line(problem.thing, program)}{problem}") from None


def _scene_object(scene: Any, needs_goal: bool) -> dict[str, Any]:
    ego = scene.egoObject
    if not is_a(ego, "Robot"):
        raise UnusableError(f"the ego is a {type(ego).__name__}, not a Robot", ego)
    course = {f"{side}_m": param(scene, f"course_{side}") for side in COURSE_SIDES}
    check_course(course)
    friction = param(scene, "friction")
    if not 0 < friction <= MOST_FRICTION:
        raise UnusableError(f"param friction: {friction} is not above 0 and at most {MOST_FRICTION:g}")
    terrain: list[dict[str, Any]] = []
    goals = []
    for thing in scene.objects:
        check_standing(thing)
        if is_a(thing, "Terrain"):
            pieces = terrain_pieces(thing)
            check_on_course(course, pieces, thing)
            terrain.extend(pieces)
            if len(terrain) > MOST_PIECES:
                raise UnusableError(f"the terrain has more than {MOST_PIECES} pieces", thing)
            continue
        check_inside(course, pose(thing), thing)
        if is_a(thing, "Goal"):
            goals.append(thing)
        elif is_a(thing, "Robot"):
            if thing is not ego:
                raise UnusableError("is a second Robot: only the ego drives", thing)
        elif not is_a(thing, "Marker"):
            raise UnusableError("is none of model.scenic's Terrain, Marker, Goal or Robot", thing)
    start = pose(ego)
    check_free_start(start, ego, terrain)
    goal = _goal(goals[0]) if goals else None
    if len(goals) > 1:
        raise UnusableError("is a second Goal: the program has to place exactly one", goals[1])
    if goal is not None:
        check_goal_ahead(start, goal, terrain, goals[0])
    elif needs_goal:
        raise UnusableError("no Goal: the program has to place one, or to say `terminate when …`")
    return {"friction": friction, "terrain": terrain, "start": start, "goal": goal, "course": course}


def _goal(thing: Any) -> dict[str, Any]:
    place = pose(thing)
    if thing.reach is None:
        return {"kind": "line", **place}
    reach = finite("reach", thing.reach, thing)
    if reach <= 0:
        raise UnusableError(f"reach: {thing.reach} is not above 0", thing)
    return {"kind": "disc", "x_m": place["x_m"], "y_m": place["y_m"], "radius_m": reach}


def _line(thing: Any, program: Path) -> str:
    """Where the program, or one it imports, creates ``thing``."""
    file, line = getattr(thing, "creationLine", ("", 0))
    # Scenic puts what is created behind `ego =` on line 1, where a program has its `model model`.
    if line <= 1:
        return ""
    same = Path(file).resolve() == program.resolve()
    return f"line {line}: " if same else f"{file}: line {line}: "
