"""Places a piece's name and its joins' numbers: upright, inside the film, clear of cuts, folds and each other.

Input: a FlatPiece and its EdgeMarks (join_marks.py). Output: strokes on the layer LABEL in the piece's frame, and texts
that did not fit. Texts are single strokes for pens and engraving beams, Hershey's simplex roman ("futural"); missing
characters are drawn as "?".
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely
from HersheyFonts import HersheyFonts
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry.base import BaseGeometry

from foldcar.fabrication.patterns.drawing import Path, Point
from foldcar.fabrication.patterns.flat_piece import FlatPiece

Points = NDArray[np.float64]

# Heights of capitals to try, largest first: 1.6 mm is the least that is legible and can be drawn with a fine pen.
NAME_HEIGHTS_MM = (6.0, 5.0, 4.0, 3.2, 2.5, 2.0, 1.6)
NUMBER_HEIGHTS_MM = (3.2, 2.5, 2.0, 1.6)
# Distance of strokes from cuts and folds, and of two texts, so that they are not read as one.
CLEAR_MM = 0.6
APART_MM = 2.5
# Depth of letters below the base line, as a share of the height of capitals.
DESCENT = 0.35
# Where a number is tried beside an edge, in the order of preference: distances from the edge, and fractions of its
# length, from its middle outwards.
DEPTHS_MM = (1.2, 0.0, 3.0, 6.0)
FRACTIONS = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9)
# A name is tried in the largest faces, at the inner points of a grid of so many steps. A face that is higher than wide by
# more than this factor has the name upright.
NAME_FACES = 4
GRID_STEPS = 12
UPRIGHT_RATIO = 1.2
# Rounding errors of angles.
ROUNDING_RAD = 1e-6
# In the font's units: height of a capital, and the y of its base line.
CAP_UNITS = 21
BASE_LINE = 9


@dataclass(frozen=True, slots=True)
class EdgeMark:
    """A number to be written beside one of several edges, the first with room on its left, and inside ``within``."""

    text: str
    edges: tuple[tuple[Point, Point], ...]
    within: BaseGeometry | None = None


def label_paths(
    flat: FlatPiece, name: str, marks: Iterable[EdgeMark], quarter_turns: int
) -> tuple[list[Path], list[str]]:
    """Return the strokes of a piece's name and of its numbers, and the texts for which there is no room.

    A text is written at the first place where its box lies in free film. After that, the film around the box is not free
    any more. Texts are upright when the piece has been turned by ``quarter_turns`` · 90° on its sheet.
    """
    turn = quarter_turns * math.pi / 2
    free = _free_film(flat)
    paths: list[Path] = []
    missing: list[str] = []
    # Numbers first, because they have fewer possible places than the name.
    for mark in marks:
        allowed = free if mark.within is None else free.intersection(mark.within)
        number = _first_fit(allowed, mark.text, list(_beside_edges(mark, turn)), NUMBER_HEIGHTS_MM)
        if number is None:
            missing.append(mark.text)
        else:
            paths += number.paths
            free = free.difference(number.box.buffer(APART_MM, join_style="mitre"))
    written_name = _first_fit(free, name, _in_faces(flat, turn), NAME_HEIGHTS_MM)
    if written_name is None:
        missing.append(name)
    else:
        paths += written_name.paths
    return paths, missing


def _free_film(flat: FlatPiece) -> BaseGeometry:
    """Return the area of a piece on which texts may be written: the film that is not too near to a cut, fold or line."""
    shapes: list[BaseGeometry] = [LineString([fold.a, fold.b]) for fold in flat.folds]
    shapes += [LineString(line) for line in (*flat.slits, *flat.marks)]
    shapes += [ShapelyPoint(centre).buffer(diameter / 2) for centre, diameter in flat.circles]
    blocked = shapely.union_all([shape.buffer(CLEAR_MM, quad_segs=2) for shape in shapes])
    free: BaseGeometry = flat.outline.buffer(-CLEAR_MM, quad_segs=2).difference(blocked)
    return free


class _WrittenText(NamedTuple):
    """A text at its place: its strokes, and the box around it."""

    paths: list[Path]
    box: Polygon


@dataclass(frozen=True, slots=True)
class _Place:
    """A place for a text along ``angle`` (rad). Its box is centred on ``point``.

    With ``inward``, a unit vector, the box lies on that side of the point and touches it.
    """

    point: Point
    angle: float
    inward: Point = (0.0, 0.0)


def _first_fit(free: BaseGeometry, text: str, places: list[_Place], heights: tuple[float, ...]) -> _WrittenText | None:
    """Write a text at the first of ``places`` at which it fits; None if it fits nowhere.

    The text fits if its box lies within the area ``free``. It has the largest of ``heights`` (mm) with which it fits at
    any place.
    """
    if free.is_empty or not places:
        return None
    shapely.prepare(free)
    for height in heights:
        strokes, width = text_strokes(text, height)
        # The box around the text. The strokes start at (0, 0) on the base line, and some letters reach below it.
        descent = height * DESCENT
        corners = np.array([(0.0, -descent), (width, -descent), (width, height), (0.0, height)])
        # Adding this makes the centre of the box the origin.
        to_centre = np.array((-width / 2, -height / 2 + descent / 2))
        # The distance of the box's centre from an edge beside which the text is written.
        depth = CLEAR_MM + height * (1 + DESCENT) / 2
        boxes = shapely.polygons(_at_places(places, depth, corners + to_centre))
        fitting_indices = np.flatnonzero(shapely.contains(free, boxes))
        if len(fitting_indices) == 0:
            continue
        first = int(fitting_indices[0])
        paths = []
        for stroke in strokes:
            (line,) = _at_places([places[first]], depth, np.array(stroke) + to_centre)
            paths.append(Path("LABEL", tuple((x, y) for x, y in line.tolist())))
        return _WrittenText(paths, boxes[first])
    return None


def _at_places(places: Sequence[_Place], depth_mm: float, points: Points) -> Points:
    """Return where the points of a text would be on the piece if it were written at each of several places.

    ``points`` (m, 2) are points (x, y) of the unturned text, relative to the centre of its box. For each place, the text
    is turned by the place's angle, and its centre is moved to the place, or if this is beside an edge, ``depth_mm``
    inwards from the place. The result is (places, m, 2).
    """
    inward = np.array([place.inward for place in places])
    centres = np.array([place.point for place in places]) + depth_mm * inward
    # These arrays are (places, 1), and numpy combines each of their rows with each of the m points.
    centre_x, centre_y = centres[:, :1], centres[:, 1:]
    cos = np.array([[math.cos(place.angle)] for place in places])
    sin = np.array([[math.sin(place.angle)] for place in places])
    text_x, text_y = points.T
    x = centre_x + cos * text_x - sin * text_y
    y = centre_y + sin * text_x + cos * text_y
    return np.stack([x, y], axis=-1)


def _text_angle(line_rad: float, turn_rad: float) -> float:
    """Return the angle (rad) of a text along a line of a piece that is turned by ``turn_rad`` on its sheet.

    The text runs along the line in one of its two directions: the one in which it is not upside down on the sheet.
    Vertical text is read from the right.
    """
    # The direction on the sheet from -90° to 90°, because directions that differ by 180° are the same line.
    on_sheet_rad = math.remainder(line_rad + turn_rad, math.pi)
    is_downwards = on_sheet_rad < -math.pi / 2 + ROUNDING_RAD
    if is_downwards:
        on_sheet_rad += math.pi
    return on_sheet_rad - turn_rad


def _beside_edges(mark: EdgeMark, turn: float) -> Iterator[_Place]:
    """Yield places for a number beside the edges of a mark, the preferred ones first.

    They are at several fractions of an edge's length and at several depths inside the piece. ``turn`` is the angle (rad)
    by which the piece is turned on its sheet.
    """
    for (start_x, start_y), (end_x, end_y) in mark.edges:
        along_x, along_y = end_x - start_x, end_y - start_y
        length = math.hypot(along_x, along_y)
        # The inside of the piece is on the left of the edge.
        inward_x, inward_y = -along_y / length, along_x / length
        angle = _text_angle(math.atan2(along_y, along_x), turn)
        for depth_mm in DEPTHS_MM:
            for fraction in FRACTIONS:
                x = start_x + fraction * along_x + depth_mm * inward_x
                y = start_y + fraction * along_y + depth_mm * inward_y
                yield _Place((x, y), angle, inward=(inward_x, inward_y))


def _in_faces(flat: FlatPiece, turn: float) -> list[_Place]:
    """Return places for a name in the largest faces of a piece, the preferred ones first.

    In each face, the places are the points of a grid, those near the face's middle first. The name is tried at all of
    them along the longer side of the face, and then at all of them across. A piece that bends smoothly counts as one
    face. ``turn`` is the angle (rad) by which the piece is turned on the sheet of film from which it is cut. The text is
    turned so that it is not upside down on this sheet.
    """
    largest_first = sorted(flat.faces, key=lambda face: -float(face.outline.area))
    outlines = [flat.outline] if flat.bends else [face.outline for face in largest_first[:NAME_FACES]]
    steps = range(1, GRID_STEPS)
    places = []
    for outline in outlines:
        x0, y0, x1, y1 = outline.bounds
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        grid_xs = [x0 + (x1 - x0) * step / GRID_STEPS for step in steps]
        grid_ys = [y0 + (y1 - y0) * step / GRID_STEPS for step in steps]
        grid = list(itertools.product(grid_xs, grid_ys))
        # Distances are rounded, so that the order does not depend on errors of rounding.
        grid.sort(key=lambda point: (round(math.dist(point, middle), 6), point))
        is_upright = y1 - y0 > UPRIGHT_RATIO * (x1 - x0)
        angles = (math.pi / 2, 0.0) if is_upright else (0.0, math.pi / 2)
        for angle in angles:
            places += [_Place(point, _text_angle(angle, turn)) for point in grid]
    return places


@cache
def _font() -> HersheyFonts:
    font = HersheyFonts()
    font.load_default_font("futural")
    return font


class Strokes(NamedTuple):
    """A text as ``lines``, which are polylines of points (x, y) in mm, and its width."""

    lines: tuple[tuple[Point, ...], ...]
    width_mm: float


@cache
def text_strokes(text: str, height_mm: float) -> Strokes:
    """Return the strokes of ``text`` and its width. Capitals are ``height_mm`` high.

    The text starts at x = 0, and its base line is y = 0.
    """
    scale = height_mm / CAP_UNITS
    printable = "".join(character if " " <= character <= "~" else "?" for character in text)
    lines: list[list[Point]] = []
    for stroke in _font().strokes_for_text(printable):
        # In the font, y points down.
        line = [(x * scale, (BASE_LINE - y) * scale) for x, y in stroke]
        # A stroke of a single point draws nothing.
        if len(set(line)) > 1:
            lines.append(line)
    if not lines:
        return Strokes((), 0.0)
    all_x = [x for line in lines for x, _ in line]
    left, right = min(all_x), max(all_x)
    lines_from_0 = tuple(tuple((x - left, y) for x, y in line) for line in lines)
    return Strokes(lines_from_0, width_mm=right - left)
