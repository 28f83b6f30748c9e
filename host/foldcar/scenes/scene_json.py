"""Converts a sampled Scenic scene to the "scene" object of docs/carsim.md.

Input: a Scenic scene. Output: JSON, or a FoldcarError of one line. Objects are recognised by the classes of
vocabulary/model.scenic, from which a program may derive its own.
"""

import re
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
from foldcar.scenes.obstacles import Obstacle, obstacles_of
from foldcar.scenes.outer_step import OUTER_STEP_S, outer_step_s
from foldcar.scenes.reading import UnusableError, finite, is_a, param, pose
from foldcar.scenes.terrain import MOST_PIECES, terrain_pieces

MOST_FRICTION = 5.0
COURSE_SIDES = ("x_min", "x_max", "y_min", "y_max")


def scene_with_obstacles(
    scene: Any, program: Path, where: str, needs_goal: bool = True
) -> tuple[dict[str, Any], list[Obstacle]]:
    """The scene in metres and radians, without an id, and what of its terrain stands on the floor as one thing.

    ``where`` follows the program's name in the messages of FoldcarErrors. Without ``needs_goal`` a program may have
    no Goal, and the scene's goal is None then.
    """
    try:
        return _scene_with_obstacles(scene, needs_goal)
    except UnusableError as problem:
        line = _line(problem.thing, program) or _line_of_param(str(problem), program)
        raise FoldcarError(f"{program}: {where}: {line}{problem}") from None


def _scene_with_obstacles(scene: Any, needs_goal: bool) -> tuple[dict[str, Any], list[Obstacle]]:
    ego = scene.egoObject
    if not is_a(ego, "Robot"):
        raise UnusableError(f"the ego is a {type(ego).__name__}, not a Robot", ego)
    course = {f"{side}_m": param(scene, f"course_{side}") for side in COURSE_SIDES}
    check_course(course)
    friction = param(scene, "friction")
    if not 0 < friction <= MOST_FRICTION:
        raise UnusableError(f"param friction: {friction} is not above 0 and at most {MOST_FRICTION:g}")
    outer_step_s(scene.params.get("outer_step_s", OUTER_STEP_S))
    terrain: list[dict[str, Any]] = []
    owners: list[Any] = []
    objects: list[tuple[str, float, range]] = []
    goals = []
    for thing in scene.objects:
        check_standing(thing)
        if is_a(thing, "Terrain"):
            pieces = terrain_pieces(thing)
            check_on_course(course, pieces, thing)
            terrain.extend(pieces)
            owners.extend([thing] * len(pieces))
            indices = range(len(terrain) - len(pieces), len(terrain))
            objects.append((type(thing).__name__, pose(thing)["heading_rad"], indices))
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
            raise UnusableError("is not one of model.scenic's Terrain, Marker, Goal or Robot", thing)
    start = pose(ego)
    check_free_start(start, ego, terrain, owners)
    goal = _goal(goals[0]) if goals else None
    if len(goals) > 1:
        raise UnusableError("is a second Goal: the program must place exactly one", goals[1])
    if goal is not None:
        check_goal_ahead(start, goal, terrain, goals[0])
    elif needs_goal:
        raise UnusableError("no Goal: the program must place one, or end the run: `terminate when …`")
    described = {"friction": friction, "terrain": terrain, "start": start, "goal": goal, "course": course}
    return described, obstacles_of(terrain, objects)


def _goal(thing: Any) -> dict[str, Any]:
    place = pose(thing)
    if thing.reach is None:
        return {"kind": "line", **place}
    reach = finite("reach", thing.reach, thing)
    if reach <= 0:
        raise UnusableError(f"reach: {thing.reach} is not above 0", thing)
    return {"kind": "disc", "x_m": place["x_m"], "y_m": place["y_m"], "radius_m": reach}


def _line(thing: Any, program: Path) -> str:
    """The line, as a prefix of messages, on which the program or one that it imports creates ``thing``."""
    file, line = getattr(thing, "creationLine", ("", 0))
    if not line:
        return ""
    same = Path(file).resolve() == program.resolve()
    return f"line {line}: " if same else f"{file}: line {line}: "


def _line_of_param(message: str, program: Path) -> str:
    """The line, as a prefix of ``message``, on which the program declares the parameter that the message begins with."""
    named = re.match(r"param (\w+):", message)
    text = program.read_text(encoding="utf-8").splitlines() if named else []
    declared = re.compile(rf"\s*param\b.*\b{named[1]}\s*=") if named else None
    lines = [number for number, line in enumerate(text, 1) if declared and declared.match(line)]
    return f"line {lines[-1]}: " if lines else ""
