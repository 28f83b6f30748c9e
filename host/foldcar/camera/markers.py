"""The markers of a course: which there are, how large, where they lie. One table, kept as a JSON file that people edit.

Markers are AprilTags of the family 36h11: a black square of 8 × 8 modules on white. ``size`` is the side of the black
square. A marker's frame has its origin in the middle, x to the right and y to the top of the upright print, z towards the
reader. Floor markers lie with x along the course; the car's with its top to the car's front; an obstacle's card as
`card_of` has it.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.terrain_kinds import kind_of

FLOOR_IDS = (0, 1, 2, 3)
CAR_ID = 10
# Obstacles A, B, C, …
FIRST_OBSTACLE_ID = 20
MOST_OBSTACLES = 26
MODULES = 8

SIZE_MM = (20.0, 500.0)
PLACE_MM = (-20_000.0, 20_000.0)
SIDE_MM = (300.0, 10_000.0)
HEIGHT_MM = (0.0, 200.0)
# White around a marker on its card, as a share of its side: a detector needs one module.
CARD_MARGIN = 0.2


@dataclass(frozen=True, slots=True)
class FloorMarker:
    """A marker on the floor: its middle (m) in the scene's frame and by how much its x is turned from the course's."""

    id: int
    x_m: float
    y_m: float
    turn_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Course:
    """Where markers lie and how large they are (m).

    ``car_x_m`` is where the car's marker is ahead of the car's middle, ``car_height_m`` how high it is above the lid.
    """

    floor: tuple[FloorMarker, ...]
    floor_size_m: float = 0.12
    car_size_m: float = 0.05
    car_x_m: float = 0.0
    car_height_m: float = 0.04
    obstacle_size_m: float = 0.06

    @property
    def card_reach_m(self) -> float:
        """From the middle of an obstacle's marker to the edge of its card."""
        return self.obstacle_size_m * (0.5 + CARD_MARGIN)

    def printed(self, scale: float) -> "Course":
        """The course whose markers came out of the printer by this factor larger."""
        return replace(
            self, **{name: getattr(self, name) * scale for name in ("floor_size_m", "car_size_m", "obstacle_size_m")}
        )


@dataclass(frozen=True, slots=True)
class Card:
    """Where an obstacle's card lies: its middle to the left of the obstacle's (m), on its ground or on the floor.

    ``turns``: its heading is that of the obstacle, which has one.
    """

    left_m: float
    on_ground: bool
    turns: bool


def card_of(thing: Obstacle, terrain: Sequence[Mapping[str, Any]], course: Course) -> Card:
    """Its lower edge at the middle of a solid's left side; its middle on that of hills, holes and patches."""
    pieces = [terrain[index] for index in thing.pieces]
    solid = any(kind_of(piece).form == "block" for piece in pieces)
    turns = len(pieces) > 1 or "heading_rad" in pieces[0]
    return Card(thing.width_m / 2 + course.card_reach_m if solid else 0.0, not solid, turns)


def rectangle(length_m: float = 1.5, width_m: float = 1.0) -> Course:
    """Four markers at the corners of a rectangle: x from 0 to the length, y to either side of the middle."""
    corners = ((0.0, 1), (length_m, 1), (length_m, -1), (0.0, -1))
    return Course(tuple(FloorMarker(k, x, side * width_m / 2) for k, (x, side) in zip(FLOOR_IDS, corners, strict=True)))


def course_json(course: Course) -> dict[str, Any]:
    """The course as its file has it: millimetres and degrees, as people measure."""
    floor = [
        {"id": one.id, "x_mm": _mm(one.x_m), "y_mm": _mm(one.y_m), "turn_deg": round(math.degrees(one.turn_rad), 3)}
        for one in course.floor
    ]
    return {
        "floor": floor,
        "floor_size_mm": _mm(course.floor_size_m),
        "car_size_mm": _mm(course.car_size_m),
        "car_x_mm": _mm(course.car_x_m),
        "car_height_mm": _mm(course.car_height_m),
        "obstacle_size_mm": _mm(course.obstacle_size_m),
    }


def read_course(file: Path) -> Course:
    """The course of a file; FoldcarError that names file, key, value and limit."""
    data = read_object(file)
    known = course_json(rectangle())
    _check_keys(f"{file}", data, known)
    sizes = {
        name.replace("_mm", "_m"): _number(f"{file}: {name}", data[name], limits) / 1000
        for name, limits in (
            ("floor_size_mm", SIZE_MM), ("car_size_mm", SIZE_MM), ("obstacle_size_mm", SIZE_MM),
            ("car_x_mm", (-500.0, 500.0)), ("car_height_mm", HEIGHT_MM),
        )
    }  # fmt: skip
    if not isinstance(data["floor"], list) or not 3 <= len(data["floor"]) <= len(FLOOR_IDS):
        raise FoldcarError(f"{file}: floor: is no list of 3 or {len(FLOOR_IDS)} markers")
    floor: list[FloorMarker] = []
    for at, one in enumerate(data["floor"]):
        where = f"{file}: floor[{at}]"
        if not isinstance(one, dict):
            raise FoldcarError(f"{where}: is no object")
        _check_keys(where, one, known["floor"][0])
        if one["id"] not in FLOOR_IDS or one["id"] in (other.id for other in floor):
            raise FoldcarError(
                f"{where}: id: {one['id']!r} is not a number of its own from {FLOOR_IDS[0]} to {FLOOR_IDS[-1]}"
            )
        x, y = (_number(f"{where}: {key}", one[key], PLACE_MM) / 1000 for key in ("x_mm", "y_mm"))
        floor.append(
            FloorMarker(one["id"], x, y, math.radians(_number(f"{where}: turn_deg", one["turn_deg"], (-360, 360))))
        )
    return Course(tuple(floor), **sizes)


def read_object(file: Path) -> dict[str, Any]:
    """The JSON object of a file; FoldcarError."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise FoldcarError(f"{file}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FoldcarError(f"{file}: is no JSON: {error}") from None
    if not isinstance(data, dict):
        raise FoldcarError(f"{file}: is no JSON object")
    return data


def _check_keys(where: str, data: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    for key in data:
        if key not in known:
            raise FoldcarError(f'{where}: unknown key "{str(key)[:80]}"; known: {", ".join(known)}')
    for key in known:
        if key not in data:
            raise FoldcarError(f"{where}: {key}: is missing")


def _number(where: str, value: Any, limits: tuple[float, float]) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FoldcarError(f"{where}: {str(value)[:80]!r} is no number")
    if not limits[0] <= value <= limits[1]:
        raise FoldcarError(f"{where}: {value:g} is not from {limits[0]:g} to {limits[1]:g}")
    return float(value)


def _mm(metres: float) -> float:
    return round(1000 * metres, 3)
