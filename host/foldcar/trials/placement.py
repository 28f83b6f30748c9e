"""Placement of obstacles and car on the floor for a trial: instructions, a picture, and measured deviations.

Input: a scene of docs/carsim.md, its obstacles, measured deviations. Output: lettered obstacles, rows of instructions
(mm and degrees), the scene with the deviations applied. Positions are measured in the scene's frame, which is marked on
the floor by a point at its origin and a line along x; y is to the left of x, headings are counter-clockwise. Deviations
are those of an obstacle's middle. For a tape, the instructions give the edge nearest to the mark, and the distances of
its ends from the mark. An obstacle of several pieces has a row for each piece.
"""

import copy
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from string import ascii_uppercase
from typing import Any, NamedTuple

from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.outputs import make_output_folder
from foldcar.scenes.obstacles import CAR, Obstacle, footprint
from foldcar.scenes.terrain_kinds import description
from foldcar.shown_console import ResultTable, shown_console
from foldcar.simulation.carsim import Carsim
from foldcar.trials.person import PersonAnswers, print_line
from foldcar.typed import decimal_number

# Titles of the instructions' columns; x, y and turned are those of the middle. The last column is a description.
HEADS = ("place", "x (mm)", "y (mm)", "turned (°)", "")
# Width of the instructions in characters, if they are not printed on a terminal.
PLAIN_WIDTH = 80
FRAME_TEXT = "x counts along the course from the mark on the floor, y to the left, turns counter-clockwise."
HEIGHT_TEXT = "Heights count from the floor, also those of pieces that lie on or in other pieces."
MAX_DEVIATION_MM = 1000.0
MAX_TURN_DEG = 180.0


class Deviation(NamedTuple):
    """How far an obstacle or the car stands from its planned place: along x and y, and by which angle it is turned."""

    x_m: float
    y_m: float
    turned_rad: float


NO_DEVIATION = Deviation(x_m=0.0, y_m=0.0, turned_rad=0.0)
# Measured deviations by the letter of the obstacle; that of the car has the name CAR.
Deviations = Mapping[str, Deviation]


class PlannedScene(NamedTuple):
    """A scene of docs/carsim.md, and its obstacles by their letters."""

    scene: dict[str, Any]
    obstacles: dict[str, Obstacle]


class Instruction(NamedTuple):
    """A row of the table that says where a person places things; the cells are texts. HEADS are its columns."""

    place: str
    x_mm: str
    y_mm: str
    turned_deg: str
    description: str


def lettered(obstacles: Iterable[Obstacle]) -> dict[str, Obstacle]:
    """Return the obstacles in their order, by letter: A, B, …, Z, AA, …"""
    return {_letters(number): obstacle for number, obstacle in enumerate(obstacles)}


def instructions(scene: Mapping[str, Any], obstacles: Mapping[str, Obstacle]) -> Iterator[Instruction]:
    """Yield the rows of the table that says where a person places everything.

    The rows are the car, the obstacles with their pieces, rough ground, the goal and the floor.
    """
    start = scene["start"]
    yield Instruction(CAR, *_place(start["x_m"], start["y_m"], start["heading_rad"]), "its middle")
    for letter, obstacle in obstacles.items():
        yield from _obstacle_rows(scene, letter, obstacle)
    # Pieces that belong to no obstacle, such as rough ground, are pieces of the floor.
    pieces_of_obstacles = {index for obstacle in obstacles.values() for index in obstacle.pieces}
    for index in range(len(scene["terrain"])):
        if index not in pieces_of_obstacles:
            yield from _obstacle_rows(scene, "floor", _piece(scene, index))
    goal = scene["goal"]
    if goal is not None:
        if goal["kind"] == "line":
            text = "a line across, to be crossed"
        else:
            text = f"a disc of radius {1000 * goal['radius_m']:.0f} mm"
        yield Instruction("goal", *_place(goal["x_m"], goal["y_m"], goal.get("heading_rad", 0.0)), text)
    # The floor has no position.
    yield Instruction("floor", "", "", "", f"friction {scene['friction']:g} in the simulation")


def _obstacle_rows(scene: Mapping[str, Any], name: str, obstacle: Obstacle) -> Iterator[Instruction]:
    """Yield the row of an obstacle and, if it has several pieces, a row for each of them."""
    lines = [_whole(scene, obstacle), *_by_tape(scene, obstacle)]
    yield Instruction(name, *_obstacle_place(obstacle), "\n".join(lines))
    if len(obstacle.pieces) > 1:
        for number, index in enumerate(obstacle.pieces, 1):
            place = _obstacle_place(_piece(scene, index))
            yield Instruction(f"{name} piece {number}", *place, description(scene["terrain"][index]))


def _piece(scene: Mapping[str, Any], index: int) -> Obstacle:
    """Return a single piece of the terrain as an obstacle without a name."""
    return footprint("", scene["terrain"], index)


def _whole(scene: Mapping[str, Any], obstacle: Obstacle) -> str:
    """Return a description of the whole obstacle, whose pieces have rows of their own if it has several."""
    if len(obstacle.pieces) == 1:
        return description(scene["terrain"][obstacle.pieces[0]])
    sizes = f"{1000 * obstacle.length_m:.0f} × {1000 * obstacle.width_m:.0f} mm"
    return f"{obstacle.name} {sizes} of {len(obstacle.pieces)} pieces"


def what_it_is(scene: Mapping[str, Any], obstacle: Obstacle) -> str:
    """Return a description of the obstacle with its sizes."""
    text = "; ".join(description(scene["terrain"][index]) for index in obstacle.pieces)
    if len(obstacle.pieces) > 1:
        return f"{obstacle.name} {1000 * obstacle.length_m:.0f} × {1000 * obstacle.width_m:.0f} mm: {text}"
    return text


def _by_tape(scene: Mapping[str, Any], obstacle: Obstacle) -> Iterator[str]:
    """Yield lines for measuring by tape: the coordinates of the near edge, and how far it is from the mark (mm).

    A round obstacle has a near point instead of an edge.
    """
    ends = obstacle.near_edge_m(scene["terrain"])
    if ends:
        coordinates = [f"{_mm(x_m)}, {_mm(y_m)}" for x_m, y_m in ends]
        distances = [_mm(math.hypot(x_m, y_m)) for x_m, y_m in ends]
        yield "near edge: " + " to ".join(coordinates)
        start = "its ends from the mark: " if len(ends) > 1 else "from the mark: "
        yield start + " and ".join(distances)


def show_placement(scene: Mapping[str, Any], obstacles: Mapping[str, Obstacle]) -> None:
    """Print the :func:`instructions` as a table, and from where lengths count."""
    table = ResultTable(*HEADS, left=("place", ""))
    for row in instructions(scene, obstacles):
        table.add_row(*row)
    console = shown_console(PLAIN_WIDTH)
    table.print_on(console)
    console.print(FRAME_TEXT)
    if scene["terrain"]:
        console.print(HEIGHT_TEXT)


def draw_placement(
    scene: Mapping[str, Any], obstacles: Mapping[str, Obstacle], design: Design, carsim: Carsim, picture: Path,
    title: str,
) -> None:  # fmt: skip
    """Draw the scene and the car into ``picture``, whose folder is created if missing. Raises FoldcarError."""
    from foldcar.figures.placement import draw_placement as draw_figure
    from foldcar.simulation.heights import carsim_heights

    make_output_folder(picture.parent)
    length_m, width_m = design.length_mm / 1000, design.width_mm / 1000
    draw_figure(scene, obstacles, length_m, width_m, carsim_heights(carsim), picture, title)


def ask_deviations(
    answers: PersonAnswers | None, obstacles: Mapping[str, Obstacle], option_texts: list[str] | None
) -> dict[str, Deviation]:
    """Return the measured deviations by name. What is missing stands at its planned place.

    They are parsed from the options ``option_texts``. If these are None, the person is asked; if nobody may be asked
    (``answers`` is None), there are no deviations. Raises FoldcarError for an option that cannot be parsed.
    """
    names = [CAR, *obstacles]
    if option_texts is not None:
        return _deviations_in_options(option_texts, names)
    if answers is not None:
        return _typed_deviations(answers, names)
    return {}


def _deviations_in_options(option_texts: Sequence[str], names: Sequence[str]) -> dict[str, Deviation]:
    """Return the deviations of the options. Raises FoldcarError if two options are about the same thing."""
    deviations: dict[str, Deviation] = {}
    for text in option_texts:
        name, deviation = parse_deviation(text, names)
        if name in deviations:
            raise FoldcarError(f'--deviation "{text}": {name} is given twice')
        deviations[name] = deviation
    return deviations


def _typed_deviations(answers: PersonAnswers, names: Sequence[str]) -> dict[str, Deviation]:
    """Return the deviations that a person types, one a line until an empty line; a later one replaces an earlier one."""
    deviations: dict[str, Deviation] = {}
    print_line("Measured deviations, one a line: NAME X_MM Y_MM [HEADING_DEG]; Enter to finish.")
    while typed := answers.line("deviation: "):
        try:
            name, deviation = parse_deviation(typed, names)
            deviations[name] = deviation
        except FoldcarError as error:
            print_line(f"  {error}")
    return deviations


def parse_deviation(text: str, names: Sequence[str]) -> tuple[str, Deviation]:
    """Parse a name and its deviation in x (mm), y (mm) and heading (°). Raises FoldcarError.

    Example: ``"A 5 -3 1.5"`` gives "A" and a deviation of 0.005 m, -0.003 m and 0.026 rad.
    """
    words = text.split()
    if not words or words[0] not in names:
        raise FoldcarError(f'deviation "{text}": does not begin with one of {", ".join(names)}')
    name, *number_words = words
    try:
        numbers = [decimal_number(word) for word in number_words]
    except ValueError:
        numbers = []
    if len(numbers) == 2:
        # The heading may be left out.
        numbers.append(0.0)
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise FoldcarError(f'deviation "{text}": not NAME X_MM Y_MM [HEADING_DEG], as in "{names[0]} 5 -3 1.5"')
    x_mm, y_mm, turned_deg = numbers
    for length_mm in (x_mm, y_mm):
        if abs(length_mm) > MAX_DEVIATION_MM:
            raise FoldcarError(f'deviation "{text}": {length_mm:g} is beyond ±{MAX_DEVIATION_MM:g} mm')
    if abs(turned_deg) > MAX_TURN_DEG:
        raise FoldcarError(f'deviation "{text}": {turned_deg:g} is beyond ±{MAX_TURN_DEG:g} °')
    return name, Deviation(x_m=x_mm / 1000, y_m=y_mm / 1000, turned_rad=math.radians(turned_deg))


def scene_as_placed(
    scene: Mapping[str, Any], obstacles: Mapping[str, Obstacle], deviations: Deviations
) -> dict[str, Any]:
    """Return the scene as built on the floor: car and obstacles are moved by their measured deviations.

    An obstacle turns around the middle of its footprint.
    """
    placed_scene: dict[str, Any] = copy.deepcopy(dict(scene))
    for name, deviation in deviations.items():
        if name == CAR:
            start = placed_scene["start"]
            _move(start, (start["x_m"], start["y_m"]), deviation)
        else:
            obstacle = obstacles[name]
            for index in obstacle.pieces:
                piece = placed_scene["terrain"][index]
                _move(piece, (obstacle.x_m, obstacle.y_m), deviation)
    return placed_scene


def _move(piece: dict[str, Any], middle_m: tuple[float, float], deviation: Deviation) -> None:
    """Move a piece of an obstacle by the obstacle's deviation, turning it around the obstacle's middle (x, y)."""
    middle_x_m, middle_y_m = middle_m
    from_middle_x_m, from_middle_y_m = piece["x_m"] - middle_x_m, piece["y_m"] - middle_y_m
    cos, sin = math.cos(deviation.turned_rad), math.sin(deviation.turned_rad)
    # Written as a change of the planned position, so that a piece in the middle keeps its exact coordinates.
    piece["x_m"] += deviation.x_m + from_middle_x_m * (cos - 1) - from_middle_y_m * sin
    piece["y_m"] += deviation.y_m + from_middle_x_m * sin + from_middle_y_m * (cos - 1)
    if "heading_rad" in piece:
        piece["heading_rad"] += deviation.turned_rad


def _obstacle_place(obstacle: Obstacle) -> tuple[str, str, str]:
    """Return the cells of an obstacle's position (mm) and heading (°) in the instructions."""
    return _place(obstacle.x_m, obstacle.y_m, obstacle.heading_rad)


def _place(x_m: float, y_m: float, heading_rad: float) -> tuple[str, str, str]:
    """Return the cells of a position (mm) and a heading (°) in the instructions."""
    return _mm(x_m), _mm(y_m), f"{_degrees(heading_rad):.1f}"


def _mm(length_m: float) -> str:
    """Return a length in whole millimetres as a text; never -0."""
    return f"{round(1000 * length_m) + 0}"


def _degrees(angle_rad: float) -> float:
    """Return the angle in degrees, from -180 to 180; never -0."""
    return round(math.degrees(math.remainder(angle_rad, math.tau)), 1) + 0.0


def _letters(number: int) -> str:
    """Return the letters of obstacle ``number`` (from 0), like the columns of a spreadsheet: A, …, Z, AA, AB, …"""
    text = ""
    number += 1
    while number:
        number, digit = divmod(number - 1, 26)
        text = ascii_uppercase[digit] + text
    return text
