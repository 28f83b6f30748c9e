"""The scene of the tests of the camera: a course with four floor markers, a box, a camera beside it."""

from dataclasses import replace
from typing import Any

from filmed import Car, Film, Filming, Thing, boxes, floor_markers
from foldcar.trials.camera.markers import rectangle

COURSE = rectangle(1.1, 0.8)
# Where the film's trial begins (s), and the middle of each exposure after the frame's time.
START_S, EXPOSURE_S = 0.4, 0.004
BOX = {"kind": "box", "x_m": 0.5, "y_m": 0.09, "heading_rad": 0.2, "length_m": 0.15, "width_m": 0.15, "height_m": 0.025}
SCENE = {
    "friction": 0.7,
    "terrain": [BOX],
    "start": {"x_m": 0.1, "y_m": -0.02, "heading_rad": 0.03},
    "goal": {"kind": "line", "x_m": 1.0, "y_m": 0.0, "heading_rad": 0.0},
    "course": {"x_min_m": -0.5, "x_max_m": 2.0, "y_min_m": -1.0, "y_max_m": 1.0},
}
FILMING = Filming(
    960, 540, place_m=(0.5, -1.3, 1.2), aim_m=(0.55, 0.02, 0.0), k1=-0.02, exposure_s=EXPOSURE_S, readout_s=0.02
)


def floor_things(course: Any = COURSE, box: Any = BOX) -> list[Thing]:
    """The floor's markers and a box."""
    return [*floor_markers(course), *boxes([box], FILMING.place_m)]


def photo(course: Any, *more: Thing, pose: Any = None, **changes: Any) -> Any:
    """A picture of the course with things on it."""
    film = Film(replace(FILMING, readout_s=0.0, exposure_s=0.0, **changes), [*floor_things(course), *more],
                Car() if pose is not None else None, lambda at_s: pose)  # fmt: skip
    return film.frame(0.0)
