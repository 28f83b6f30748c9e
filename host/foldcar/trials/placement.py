"""Placement of obstacles and car on the floor for a trial: instructions, and deviations from them.

Input: a scene of docs/carsim.md, measured deviations. Output: lettered obstacles, rows of instructions (mm and degrees),
the scene with the deviations applied. Positions are measured in the scene's frame, which is marked on the floor by a
point at its origin and a line along x; y is to the left of x, headings are counter-clockwise.
"""

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from string import ascii_uppercase
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.terrain_kinds import description, kind_of

CAR = "car"
MOST_DEVIATION_MM = 1000.0

Deviations = Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """One object to put on the floor: its pose, and the indices in the scene of its terrain pieces."""

    letter: str
    pieces: tuple[int, ...]
    x_m: float
    y_m: float
    heading_rad: float


def obstacles(scene: Mapping[str, Any]) -> list[Obstacle]:
    """The scene's obstacles in the order of its terrain, lettered A, B, …, Z, AA, …; pieces with one centre are one."""
    groups: dict[tuple[float, float], list[int]] = {}
    for index, piece in enumerate(scene["terrain"]):
        if not kind_of(piece).is_floor:
            groups.setdefault((piece["x_m"], piece["y_m"]), []).append(index)
    return [
        Obstacle(_letters(number), tuple(indices), x, y, scene["terrain"][indices[0]].get("heading_rad", 0.0))
        for number, ((x, y), indices) in enumerate(groups.items())
    ]


def instructions(scene: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str, str]]:
    """Rows of name, x (mm), y (mm), heading (°) and description: the car, the obstacles, the goal, the floor."""
    start = scene["start"]
    yield CAR, *_place(start["x_m"], start["y_m"], start["heading_rad"]), "its middle"
    for thing in obstacles(scene):
        what = "; ".join(description(scene["terrain"][index]) for index in thing.pieces)
        yield thing.letter, *_place(thing.x_m, thing.y_m, thing.heading_rad), what
    goal = scene["goal"]
    if goal is not None:
        line = goal["kind"] == "line"
        what = "a line across, to be crossed" if line else f"a disc of radius {1000 * goal['radius_m']:.0f} mm"
        yield "goal", *_place(goal["x_m"], goal["y_m"], goal.get("heading_rad", 0.0)), what
    yield "floor", "", "", "", f"friction {scene['friction']:g} in the simulation"


def parse_deviation(text: str, names: list[str]) -> tuple[str, tuple[float, float, float]]:
    """Parse a name and deviations in x (mm), y (mm) and heading (°) to (name, (m, m, rad)); FoldcarError.

    ``"A 5 -3 1.5"`` gives ("A", (0.005, -0.003, 0.026…)).
    """
    words = text.split()
    if not words or words[0] not in names:
        raise FoldcarError(f'deviation "{text}": does not begin with one of {", ".join(names)}')
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise FoldcarError(
            f'deviation "{text}": not NAME X_MM Y_MM [HEADING_DEG], as in "{names[0]} 5 -3 1.5"'
        )
    limits = ((MOST_DEVIATION_MM, "mm"), (MOST_DEVIATION_MM, "mm"), (180.0, "°"))
    for number, (limit, unit) in zip(numbers, limits, strict=False):
        if abs(number) > limit:
            raise FoldcarError(f'deviation "{text}": {number:g} is beyond ±{limit:g} {unit}')
    x_mm, y_mm, turned_deg = (*numbers, 0.0)[:3]
    return words[0], (x_mm / 1000, y_mm / 1000, math.radians(turned_deg))


def placed(scene: Mapping[str, Any], deviations: Deviations) -> dict[str, Any]:
    """The scene as built on the floor: the car and each obstacle moved by its deviation (m, m, rad)."""
    moved: dict[str, Any] = copy.deepcopy(dict(scene))
    things = {CAR: [moved["start"]]}
    things |= {o.letter: [moved["terrain"][index] for index in o.pieces] for o in obstacles(scene)}
    for name, (x_m, y_m, turned_rad) in deviations.items():
        for thing in things[name]:
            thing["x_m"] += x_m
            thing["y_m"] += y_m
            if "heading_rad" in thing:
                thing["heading_rad"] += turned_rad
    return moved


def names_of(scene: Mapping[str, Any]) -> list[str]:
    """The names that may deviate: the car and the obstacles' letters."""
    return [CAR, *(obstacle.letter for obstacle in obstacles(scene))]


def _place(x_m: float, y_m: float, heading_rad: float) -> tuple[str, str, str]:
    return f"{1000 * x_m:.0f}", f"{1000 * y_m:.0f}", f"{_degrees(heading_rad):.1f}"


def _degrees(angle_rad: float) -> float:
    """The angle in degrees, from -180 to 180; never -0."""
    return round(math.degrees(math.remainder(angle_rad, math.tau)), 1) + 0.0


def _letters(number: int) -> str:
    text = ""
    number += 1
    while number:
        number, digit = divmod(number - 1, 26)
        text = ascii_uppercase[digit] + text
    return text
