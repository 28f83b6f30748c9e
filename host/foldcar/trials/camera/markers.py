"""The markers of a course, their sizes and positions: a table that is kept as a JSON file, which people edit.

Markers are AprilTags of the family 36h11: a black square of 8 × 8 modules on white. ``size`` is the side of the black
square. A marker's frame has its origin in the middle, x to the right and y to the top of the upright print, z towards the
reader. Floor markers lie with x along the course; the car's with its top to the car's front; an obstacle's card as
`card_of` has it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from foldcar.errors import FoldcarError
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.terrain_kinds import kind_of
from foldcar.typed import read_text

Read = TypeVar("Read")

FLOOR_IDS = (0, 1, 2, 3)
CAR_ID = 10
# Obstacles A, B, C, …
FIRST_OBSTACLE_ID = 20
MAX_OBSTACLES = 26
MODULES = 8

SIDE_MM = (300.0, 10_000.0)
# White margin around a marker on its card, as a fraction of its side: a detector needs one module.
CARD_MARGIN = 0.2


@dataclass(frozen=True, slots=True)
class FloorMarker:
    """A marker on the floor: its middle (m) in the scene's frame, and the angle from the course's x to the marker's x."""

    id: int
    x_m: float
    y_m: float
    turn_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Course:
    """Positions and sizes of the markers (m).

    The car's marker is ``car_x_m`` ahead of the car's middle and ``car_height_m`` above the lid.
    """

    floor: tuple[FloorMarker, ...]
    floor_size_m: float = 0.12
    car_size_m: float = 0.05
    car_x_m: float = 0.0
    car_height_m: float = 0.04
    obstacle_size_m: float = 0.06

    @property
    def card_reach_m(self) -> float:
        """Distance from the middle of an obstacle's marker to the edge of its card."""
        return self.obstacle_size_m * (0.5 + CARD_MARGIN)

    def printed(self, scale: float) -> "Course":
        """Return the course with markers that were printed larger by this factor."""
        return replace(
            self, **{name: getattr(self, name) * scale for name in ("floor_size_m", "car_size_m", "obstacle_size_m")}
        )


@dataclass(frozen=True, slots=True)
class Card:
    """Position of an obstacle's card: ``left_m`` to the left of the obstacle's middle, on it or on the floor.

    ``turns``: the obstacle has a heading, and the card has the same.
    """

    left_m: float
    on_ground: bool
    turns: bool


def card_of(obstacle: Obstacle, terrain: Sequence[Mapping[str, Any]], course: Course) -> Card:
    """Return where an obstacle's card lies.

    A solid's card has its lower edge at the middle of the left side; a card on a hill, hole or patch is centred on it.
    """
    pieces = [terrain[index] for index in obstacle.pieces]
    is_solid = any(kind_of(piece).form == "block" for piece in pieces)
    # A single round piece has no heading.
    turns = len(pieces) > 1 or "heading_rad" in pieces[0]
    left_m = obstacle.width_m / 2 + course.card_reach_m if is_solid else 0.0
    return Card(left_m, on_ground=not is_solid, turns=turns)


def rectangle(length_m: float = 1.5, width_m: float = 1.0) -> Course:
    """Return a course with four markers at the corners of a rectangle; x from 0 to the length, y = 0 in the middle."""
    corners = ((0.0, 1), (length_m, 1), (length_m, -1), (0.0, -1))
    return Course(tuple(FloorMarker(k, x, side * width_m / 2) for k, (x, side) in zip(FLOOR_IDS, corners, strict=True)))


Size = Annotated[float, Field(ge=20, le=500)]
Place = Annotated[float, Field(ge=-20_000, le=20_000)]


class _FloorFile(BaseModel, extra="forbid", strict=True):
    id: Annotated[int, Field(ge=FLOOR_IDS[0], le=FLOOR_IDS[-1])]
    x_mm: Place
    y_mm: Place
    turn_deg: Annotated[float, Field(ge=-360, le=360)]


class _CourseFile(BaseModel, extra="forbid", strict=True):
    """The file's form of a course, in millimetres and degrees."""

    floor: Annotated[list[_FloorFile], Field(min_length=3, max_length=len(FLOOR_IDS))]
    floor_size_mm: Size
    car_size_mm: Size
    car_x_mm: Annotated[float, Field(ge=-500, le=500)]
    car_height_mm: Annotated[float, Field(ge=0, le=200)]
    obstacle_size_mm: Size


def course_json(course: Course) -> dict[str, Any]:
    """Return the course in the file's form."""
    floor = [
        {
            "id": marker.id,
            "x_mm": _mm(marker.x_m),
            "y_mm": _mm(marker.y_m),
            "turn_deg": round(math.degrees(marker.turn_rad), 3),
        }
        for marker in course.floor
    ]
    # A field in metres, as ``floor_size_m``, is in millimetres in the file: ``floor_size_mm``.
    sizes = {f"{name}m": _mm(value) for name, value in asdict(course).items() if name != "floor"}
    return {"floor": floor, **sizes}


def read_course(file: Path) -> Course:
    """Read a course from a file. Raises FoldcarError that names file, key, value and limit."""
    data = read_json(file, TypeAdapter(_CourseFile))
    ids = [marker.id for marker in data.floor]
    if len(set(ids)) < len(ids):
        raise FoldcarError(f"{file}: floor: two markers have the id {max(ids, key=ids.count)}")
    floor = [
        FloorMarker(marker.id, marker.x_mm / 1000, marker.y_mm / 1000, math.radians(marker.turn_deg))
        for marker in data.floor
    ]
    sizes = data.model_dump(exclude={"floor"}).items()
    return Course(tuple(floor), **{name.replace("_mm", "_m"): value / 1000 for name, value in sizes})


def read_json(file: Path, adapter: "TypeAdapter[Read]") -> Read:
    """Read a JSON file with pydantic. Raises FoldcarError that names file, key, value and limit."""
    try:
        return adapter.validate_json(read_text(file))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        value_text = f", not {str(first['input'])[:80]}" if place and first["type"] != "missing" else ""
        raise FoldcarError(f"{file}: {f'{place}: ' if place else ''}{first['msg']}{value_text}") from None


def _mm(metres: float) -> float:
    return round(1000 * metres, 3)
