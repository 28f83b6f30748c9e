"""Converts a sampled Scenic scene, its Terrain objects to pieces, to the "scene" object of docs/carsim.md.

Input: a Scenic scene. Output: JSON, or a FoldcarError of one line. Objects are recognised by the classes of
vocabulary/model.scenic, from which a program may derive its own.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from foldcar.errors import FoldcarError
from foldcar.scenes.checks import (
    check_course,
    check_free_start,
    check_goal_ahead,
    check_inside,
    check_on_course,
    check_standing,
)
from foldcar.scenes.obstacles import Obstacle, PlacedObject, obstacles_of
from foldcar.scenes.program import line_prefix
from foldcar.scenes.reading import UnusableError, finite, is_a, outer_step_s, param, pose, rounded
from foldcar.scenes.terrain_kinds import HEIGHT_M, KINDS, kind_of

if TYPE_CHECKING:
    from foldcar.scenes.native_program import NativeProgram

MAX_FRICTION = 5.0
PLACE_M = (-1000.0, 1000.0)
TURN_RAD = (-100.0, 100.0)

PLACE_KEYS = {"x_m": PLACE_M, "y_m": PLACE_M, "heading_rad": TURN_RAD}
MAX_PIECES = 10_000
MAX_HEIGHT_M = HEIGHT_M[1]
# The simulator represents rough ground as a grid with cells of an eighth of the correlation length.
GRID_FINENESS = 8
MAX_NODES = 4_000_000


class _Bound(NamedTuple):
    """The maximum of a size of a piece, computed from the piece's other sizes. ``meaning`` says what the maximum is."""

    key: str
    maximum: Callable[[Mapping[str, Any]], float]
    meaning: str


BOUNDED = {
    "half_round": _Bound("height_m", lambda piece: piece["length_m"] / 2, "half the length"),
    "pothole": _Bound("edge_m", lambda piece: piece["radius_m"], "the radius"),
    "rough": _Bound("correlation_m", lambda piece: min(piece["length_m"], piece["width_m"]), "the shorter side"),
}
COURSE_SIDES = ("x_min", "x_max", "y_min", "y_max")


def scene_with_obstacles(
    scene: Any, program: Path, where: str, needs_goal: bool = True, native: "NativeProgram | None" = None
) -> tuple[dict[str, Any], list[Obstacle]]:
    """Return the scene in metres and radians, without an id, and its obstacles.

    ``where`` follows the program's name in the messages of FoldcarErrors. Without ``needs_goal`` a program may have
    no Goal; the scene's goal is None then. ``native`` has the program's statements about runs, if carsim evaluates them.
    """
    try:
        scene_data, obstacles = _scene_with_obstacles(scene, needs_goal)
        if native is not None:
            scene_data["program"] = native.of_scene(scene)
        return scene_data, obstacles
    except UnusableError as problem:
        # The line where the program, or an imported one, creates the object.
        file, number = getattr(problem.thing, "creationLine", (None, 0))
        line = line_prefix(file, number, program) if number else ""
        raise FoldcarError(f"{program}: {where}: {line}{problem}") from None


def _scene_with_obstacles(scene: Any, needs_goal: bool) -> tuple[dict[str, Any], list[Obstacle]]:
    """Convert a sampled Scenic scene to the simulator's scene, as JSON data in metres and radians, and its obstacles.

    If ``needs_goal`` is True, the scene must have a Goal. Raises UnusableError if the scene cannot be simulated.
    """
    ego = scene.egoObject
    if not is_a(ego, "Robot"):
        raise UnusableError(f"the ego is a {type(ego).__name__}, not a Robot", ego)
    course = {f"{side}_m": param(scene, f"course_{side}") for side in COURSE_SIDES}
    check_course(course)
    friction = param(scene, "friction")
    if not 0 < friction <= MAX_FRICTION:
        raise UnusableError(f"param friction: {friction} is not above 0 and at most {MAX_FRICTION:g}")
    # This is called only for its check: it raises UnusableError if the time step is not valid.
    outer_step_s(scene.params)
    things = list(scene.objects)
    for thing in things:
        _check_thing(thing, ego, course)
    terrain, owners, objects = _terrain(things, course)
    start = pose(ego)
    check_free_start(start, ego, terrain, owners)
    goal = _only_goal(things, start, needs_goal)
    scene_data = {"friction": friction, "terrain": terrain, "start": start, "goal": goal, "course": course}
    return scene_data, obstacles_of(terrain, objects)


def _check_thing(thing: Any, ego: Any, course: Mapping[str, float]) -> None:
    """Raise UnusableError if an object of a scene is of a class that foldcar does not know, or is outside the course."""
    check_standing(thing)
    if is_a(thing, "Terrain"):
        # Its pieces are checked instead.
        return
    check_inside(course, pose(thing), thing)
    if is_a(thing, "Robot") and thing is not ego:
        raise UnusableError("is a second Robot: only the ego drives", thing)
    if not any(is_a(thing, name) for name in ("Robot", "Goal", "Marker")):
        raise UnusableError("is not one of model.scenic's Terrain, Marker, Goal or Robot", thing)


def _terrain(
    things: list[Any], course: Mapping[str, float]
) -> tuple[list[dict[str, Any]], list[Any], list[PlacedObject]]:
    """Return the pieces of all Terrain objects, the object that each piece belongs to, and the objects' places.

    Raises UnusableError if a piece is not valid or lies outside the course, or if there are too many pieces.
    """
    terrain: list[dict[str, Any]] = []
    owners: list[Any] = []
    objects: list[PlacedObject] = []
    for thing in things:
        if not is_a(thing, "Terrain"):
            continue
        pieces = terrain_pieces(thing)
        check_on_course(course, pieces, thing)
        first_index = len(terrain)
        terrain += pieces
        owners += [thing] * len(pieces)
        if len(terrain) > MAX_PIECES:
            raise UnusableError(f"the terrain has more than {MAX_PIECES} pieces", thing)
        indices = range(first_index, len(terrain))
        objects.append(PlacedObject(type(thing).__name__, pose(thing)["heading_rad"], indices))
    return terrain, owners, objects


def _only_goal(things: list[Any], start: dict[str, float], needs_goal: bool) -> dict[str, Any] | None:
    """Return the Goal of a scene as JSON, or None if there is none.

    Raises UnusableError if there are several, if the goal is not ahead of the start, or if ``needs_goal`` is True and
    there is none.
    """
    goals = [thing for thing in things if is_a(thing, "Goal")]
    if len(goals) > 1:
        raise UnusableError("is a second Goal: the program must place exactly one", goals[1])
    if not goals:
        if needs_goal:
            raise UnusableError("no Goal: the program must place one, or end the run: `terminate when …`")
        return None
    goal = _goal(goals[0])
    check_goal_ahead(start, goal, goals[0])
    return goal


def _goal(thing: Any) -> dict[str, Any]:
    """Return a Goal as JSON: a disc if it has a reach, otherwise a line that the car must cross."""
    place = pose(thing)
    if thing.reach is None:
        return {"kind": "line", **place}
    reach = finite("reach", thing.reach, thing)
    if reach <= 0:
        raise UnusableError(f"reach: {thing.reach} is not above 0", thing)
    return {"kind": "disc", "x_m": place["x_m"], "y_m": place["y_m"], "radius_m": reach}


def terrain_pieces(thing: Any) -> list[dict[str, Any]]:
    """Return the pieces of a Terrain object in the simulator's frame (m, rad). Raises UnusableError."""
    try:
        given_pieces = list(thing.pieces())
    except Exception as error:
        raise UnusableError(f"{type(error).__name__}: {error}", thing) from error
    if not given_pieces:
        raise UnusableError("has no pieces", thing)
    place_of_object = pose(thing)
    return [_placed(_checked(given_piece, thing), place_of_object) for given_piece in given_pieces]


def _checked(given_piece: Any, thing: Any) -> dict[str, Any]:
    """Check a piece of terrain and return it with all keys of its kind.

    ``given_piece`` is what the method `pieces` of the program's object ``thing`` has returned. Its place is relative to
    this object. Raises UnusableError if a key is unknown or missing, or if a value is outside its limits.
    """
    if not isinstance(given_piece, Mapping) or given_piece.get("kind") not in KINDS:
        kinds = ", ".join(KINDS)
        raise UnusableError(f"{given_piece!r} is not a piece of terrain; its kind must be one of {kinds}", thing)
    kind = given_piece["kind"]
    sizes = KINDS[kind].sizes
    unknown_keys = [key for key in given_piece if key != "kind" and key not in sizes and key not in PLACE_KEYS]
    if unknown_keys:
        raise UnusableError(f"{kind}: unknown key {unknown_keys[0]}; its keys are {', '.join(sizes)}", thing)
    piece: dict[str, Any] = {"kind": kind}
    for key, (minimum, maximum) in {**PLACE_KEYS, **sizes}.items():
        if key in sizes and key not in given_piece:
            raise UnusableError(f"{kind}: {key} is missing", thing)
        piece[key] = finite(f"{kind}: {key}", given_piece.get(key, 0.0), thing)
        if not minimum <= piece[key] <= maximum:
            # Of all limits, that of heights is the lowest. A value above it is probably in mm.
            hint = "; lengths are in metres" if maximum == MAX_HEIGHT_M else ""
            raise UnusableError(
                f"{kind}: {key}: {given_piece[key]} is not within {minimum:g} to {maximum:g}{hint}", thing
            )
    if kind in BOUNDED:
        bound = BOUNDED[kind]
        value, bound_value = piece[bound.key], bound.maximum(piece)
        if value > bound_value:
            raise UnusableError(f"{kind}: {bound.key}: {value:g} is above {bound.meaning}, {bound_value:g}", thing)
    if kind == "rough":
        _check_grid(piece, thing)
        piece["seed"] = int(piece["seed"])
    return piece


def _check_grid(piece: Mapping[str, Any], thing: Any) -> None:
    """Raise UnusableError if the simulator cannot draw the grid of random heights of a piece of rough ground."""
    cells_per_m = GRID_FINENESS / piece["correlation_m"]
    nodes = (piece["length_m"] * cells_per_m + 1) * (piece["width_m"] * cells_per_m + 1)
    if nodes > MAX_NODES:
        raise UnusableError(f"rough: correlation_m: makes {nodes:.3g} heights, the limit is {MAX_NODES:.3g}", thing)
    if piece["seed"] != int(piece["seed"]):
        raise UnusableError(f"rough: seed: {piece['seed']:g} is not an integer", thing)


def _placed(part: dict[str, Any], place: Mapping[str, float]) -> dict[str, Any]:
    """Return a piece of terrain with its position and heading in the world's frame.

    In ``part`` these are relative to the object to which the piece belongs; ``place`` is the pose of this object.
    """
    cos, sin = math.cos(place["heading_rad"]), math.sin(place["heading_rad"])
    ahead_m, left_m = part["x_m"], part["y_m"]
    piece = {
        **part,
        "x_m": rounded(place["x_m"] + ahead_m * cos - left_m * sin),
        "y_m": rounded(place["y_m"] + ahead_m * sin + left_m * cos),
        "heading_rad": rounded(math.remainder(place["heading_rad"] + part["heading_rad"], 2 * math.pi)),
    }
    if kind_of(piece).shape == "disc":
        del piece["heading_rad"]
    return piece
