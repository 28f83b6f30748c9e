"""Places a piece's name and its joins' numbers: upright, inside the film, clear of cuts, folds and each other.

Input: a FlatPiece and its marks. Output: strokes on the layer LABEL in the piece's frame, and texts that did not fit.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry.base import BaseGeometry

from foldcar.fabrication.patterns.drawing import Path, Point
from foldcar.fabrication.patterns.flat_piece import FlatPiece
from foldcar.fabrication.patterns.stroke_font import text_strokes

# Heights of capitals to try, largest first: 1.6 mm is the least that is legible and can be drawn with a fine pen.
NAME_HEIGHTS_MM = (6.0, 5.0, 4.0, 3.2, 2.5, 2.0, 1.6)
NUMBER_HEIGHTS_MM = (3.2, 2.5, 2.0, 1.6)
# Distance of strokes from cuts and folds, and of two texts, so that they are not read as one.
CLEAR_MM = 0.6
APART_MM = 2.5
# Depth of letters below the base line, as a share of the height of capitals.
DESCENT = 0.35


@dataclass(frozen=True, slots=True)
class EdgeMark:
    """A number to be written beside one of several edges, the first with room on its left, and inside ``within``."""

    text: str
    edges: tuple[tuple[Point, Point], ...]
    within: BaseGeometry | None = None


def label_paths(
    flat: FlatPiece, name: str, marks: Iterable[EdgeMark], quarter_turns: int
) -> tuple[list[Path], list[str]]:
    """Strokes of name and numbers, upright after ``quarter_turns``; the texts that did not fit."""
    turn = quarter_turns * math.pi / 2
    taken: list[BaseGeometry] = [LineString([f.a, f.b]) for f in flat.folds]
    taken += [LineString(line) for line in (*flat.slits, *flat.marks)]
    taken += [ShapelyPoint(p).buffer(d / 2) for p, d in flat.circles]
    blocked = shapely.union_all([line.buffer(CLEAR_MM, quad_segs=2) for line in taken])
    free: BaseGeometry = flat.outline.buffer(-CLEAR_MM, quad_segs=2).difference(blocked)
    paths: list[Path] = []
    missing: list[str] = []

    # Numbers first, because they have fewer possible places than the name.
    for mark in marks:
        room = free if mark.within is None else free.intersection(mark.within)
        found = _first_fit(room, mark.text, _beside_edge(mark, turn), NUMBER_HEIGHTS_MM)
        if found is None:
            missing.append(mark.text)
            continue
        free = free.difference(found[1].buffer(APART_MM, join_style="mitre"))
        paths += found[0]
    found = _first_fit(free, name, _in_faces(flat, turn), NAME_HEIGHTS_MM)
    if found is None:
        missing.append(name)
    else:
        paths += found[0]
    return paths, missing


@dataclass(frozen=True, slots=True)
class _Place:
    """A place for a text: its box is centred on ``point`` or, with ``inward``, touches it on that side."""

    point: Point
    angle: float
    inward: Point | None = None


def _first_fit(
    free: BaseGeometry, text: str, places: list[_Place], heights: tuple[float, ...]
) -> tuple[list[Path], Polygon] | None:
    """The text at the largest height that fits at one of the places, with its box; None if none fits."""
    if free.is_empty:
        return None
    shapely.prepare(free)
    for height in heights:
        strokes, width = text_strokes(text, height)
        tall = height * (1 + DESCENT)
        for place in places:
            x, y = place.point
            if place.inward is not None:
                depth = CLEAR_MM + tall / 2
                x, y = x + place.inward[0] * depth, y + place.inward[1] * depth
            cos, sin = math.cos(place.angle), math.sin(place.angle)

            def put(
                p: Point, x: float = x, y: float = y, cos: float = cos, sin: float = sin,
                left: float = -width / 2, low: float = -height / 2 + height * DESCENT / 2,
            ) -> Point:  # fmt: skip
                u, v = p[0] + left, p[1] + low
                return x + cos * u - sin * v, y + sin * u + cos * v

            corners = [(0.0, -height * DESCENT), (width, -height * DESCENT), (width, height), (0.0, height)]
            box = Polygon([put(p) for p in corners])
            if free.contains(box):
                return [Path("LABEL", tuple(put(p) for p in stroke)) for stroke in strokes], box
    return None


def _upright(angle: float) -> float:
    """The line's direction, or its reverse, in which text is not upside down; vertical text is read from the right."""
    angle = math.remainder(angle, math.pi)
    return angle + math.pi if angle < -math.pi / 2 + 1e-6 else angle


def _beside_edge(mark: EdgeMark, turn: float) -> list[_Place]:
    """Places along each edge, from its middle outwards; then farther inside."""
    places = []
    for edge in mark.edges:
        places += _beside(edge, turn)
    return places


def _beside(edge: tuple[Point, Point], turn: float) -> list[_Place]:
    (ax, ay), (bx, by) = edge
    length = math.hypot(bx - ax, by - ay)
    inward = (-(by - ay) / length, (bx - ax) / length)
    angle = _upright(math.atan2(by - ay, bx - ax) + turn) - turn
    places = []
    for deeper in (1.2, 0.0, 3.0, 6.0):
        for share in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9):
            point = (
                ax + share * (bx - ax) + deeper * inward[0],
                ay + share * (by - ay) + deeper * inward[1],
            )
            places.append(_Place(point, angle, inward))
    return places


def _in_faces(flat: FlatPiece, turn: float) -> list[_Place]:
    """Places on the faces, largest face first, from its centre outwards, first along its longer side.

    A strip, which bends smoothly, counts as one face.
    """
    areas = [face.outline for face in sorted(flat.faces, key=lambda face: -float(face.outline.area))[:4]]
    if flat.bends:
        areas = [flat.outline]
    places = []
    for area in areas:
        x0, y0, x1, y1 = area.bounds
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        grid = [(x0 + (x1 - x0) * i / 12, y0 + (y1 - y0) * j / 12) for i in range(1, 12) for j in range(1, 12)]
        grid.sort(key=lambda p: (round(math.dist(p, middle), 6), p))
        tall = y1 - y0 > 1.2 * (x1 - x0)
        for angle in (math.pi / 2, 0.0) if tall else (0.0, math.pi / 2):
            places += [_Place(p, _upright(angle + turn) - turn) for p in grid]
    return places
