"""Places a piece's name and its joins' numbers: upright, inside the film, clear of cuts, folds and each other.

Input: a FlatPiece and its FoldedCar. Output: strokes on the layer LABEL in the piece's frame, and texts that did not fit.
A join has its number beside both edges; the teeth of a rim share one, which is written once on the disc and once on the
strip. Where layers are laid onto a face, each place has the number. Texts are single strokes for pens and engraving
beams, Hershey's simplex roman ("futural"); missing characters are drawn as "?".
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
import shapely
from HersheyFonts import HersheyFonts
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry.base import BaseGeometry

from foldcar.car.folded.model import FoldedCar, Join
from foldcar.car.folded.placed import placed_faces
from foldcar.fabrication.patterns.drawing import Path, Point
from foldcar.fabrication.patterns.flat_piece import Edge, FlatFace, FlatPiece

Points = NDArray[np.float64]

# Heights of capitals to try, largest first: 1.6 mm is the least that is legible and can be drawn with a fine pen.
NAME_HEIGHTS_MM = (6.0, 5.0, 4.0, 3.2, 2.5, 2.0, 1.6)
NUMBER_HEIGHTS_MM = (3.2, 2.5, 2.0, 1.6)
# Distance of strokes from cuts and folds, and of two texts, so that they are not read as one.
CLEAR_MM = 0.6
APART_MM = 2.5
# Depth of letters below the base line, as a share of the height of capitals.
DESCENT = 0.35
# At most this many of several suitable edges are tried.
PLACES = 8
# Where a number is tried beside an edge, in the order of preference: distances from the edge, and fractions of its
# length, from its middle outwards.
DEPTHS_MM = (1.2, 0.0, 3.0, 6.0)
FRACTIONS = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9)
# A name is tried in the largest faces, at the inner points of a grid of so many steps. A face that is higher than wide by
# more than this factor has the name upright.
NAME_FACES = 4
GRID_STEPS = 12
UPRIGHT_RATIO = 1.2
# A layer covers a face if they have more in common than this. Edges of holes may lie this far outside of a layer, and a
# bend shortens an edge by less than this.
COMMON_MM2 = 1.0
AROUND_LAYER_MM = 1.0
SHORTENED_MM = 1.0
# Maximum distance of layers of film and tape from the face they are glued to.
LAYERS_MM = 3.0
# The text between a piece's name and the number of its part.
PART = ", part "
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
    line_shapes: list[BaseGeometry] = [LineString([f.a, f.b]) for f in flat.folds]
    line_shapes += [LineString(line) for line in (*flat.slits, *flat.marks)]
    line_shapes += [ShapelyPoint(p).buffer(d / 2) for p, d in flat.circles]
    blocked = shapely.union_all([line.buffer(CLEAR_MM, quad_segs=2) for line in line_shapes])
    free: BaseGeometry = flat.outline.buffer(-CLEAR_MM, quad_segs=2).difference(blocked)
    paths: list[Path] = []
    missing: list[str] = []

    # Numbers first, because they have fewer possible places than the name.
    for mark in marks:
        allowed = free if mark.within is None else free.intersection(mark.within)
        fit = _first_fit(allowed, mark.text, list(_beside_edges(mark, turn)), NUMBER_HEIGHTS_MM)
        if fit is None:
            missing.append(mark.text)
            continue
        strokes, box = fit
        free = free.difference(box.buffer(APART_MM, join_style="mitre"))
        paths += strokes
    fit = _first_fit(free, name, _in_faces(flat, turn), NAME_HEIGHTS_MM)
    if fit is None:
        missing.append(name)
    else:
        paths += fit[0]
    return paths, missing


@dataclass(frozen=True, slots=True)
class _Place:
    """A place for a text along ``angle`` (rad). Its box is centred on ``point``.

    With ``inward``, a unit vector, the box lies on that side of the point and touches it.
    """

    point: Point
    angle: float
    inward: Point = (0.0, 0.0)


def _first_fit(
    free: BaseGeometry, text: str, places: list[_Place], heights: tuple[float, ...]
) -> tuple[list[Path], Polygon] | None:
    """Return the strokes and the box of a text at the first of ``places`` at which it fits; None if it fits nowhere.

    The text has the largest of ``heights`` (mm) with which it fits anywhere.
    """
    if free.is_empty or not places:
        return None
    shapely.prepare(free)
    for height in heights:
        strokes, width = text_strokes(text, height)
        # The start of the base line, relative to the centre of the box.
        start = np.array((-width / 2, -height / 2 + height * DESCENT / 2))
        # The distance of the box's centre from an edge that it stands beside.
        depth = CLEAR_MM + height * (1 + DESCENT) / 2
        corners = np.array([(0.0, -height * DESCENT), (width, -height * DESCENT), (width, height), (0.0, height)])
        boxes = shapely.polygons(_at_places(places, depth, corners + start))
        fitting = np.flatnonzero(shapely.contains(free, boxes))
        if len(fitting):
            first = int(fitting[0])
            paths = []
            for stroke in strokes:
                (line,) = _at_places([places[first]], depth, np.array(stroke) + start)
                paths.append(Path("LABEL", tuple((x, y) for x, y in line.tolist())))
            return paths, boxes[first]
    return None


def _at_places(places: Sequence[_Place], depth_mm: float, points: Points) -> Points:
    """Return points of a text, (m, 2), turned and moved to each of the places: (n, m, 2).

    The points are relative to the centre of the text's box. If the box stands beside an edge, its centre is ``depth_mm``
    inwards from the place.
    """
    centres = np.array([place.point for place in places]) + depth_mm * np.array([place.inward for place in places])
    cos = np.array([[math.cos(place.angle)] for place in places])
    sin = np.array([[math.sin(place.angle)] for place in places])
    u, v = points.T
    x = centres[:, :1] + cos * u - sin * v
    y = centres[:, 1:] + sin * u + cos * v
    return np.stack([x, y], axis=-1)


def _text_angle(line_rad: float, turn_rad: float) -> float:
    """Return the angle (rad) of a text along a line of a piece that is turned by ``turn_rad`` on its sheet.

    It is the angle of the line or its reverse, so that the text is not upside down on the sheet. Vertical text is read
    from the right.
    """
    on_sheet = math.remainder(line_rad + turn_rad, math.pi)
    if on_sheet < -math.pi / 2 + 1e-6:
        on_sheet += math.pi
    return on_sheet - turn_rad


def _beside_edges(mark: EdgeMark, turn: float) -> Iterator[_Place]:
    """Yield places for a number beside the edges of a mark, the preferred ones first.

    ``turn`` is the angle (rad) by which the piece is turned on its sheet.
    """
    for (ax, ay), (bx, by) in mark.edges:
        length = math.hypot(bx - ax, by - ay)
        inward = (-(by - ay) / length, (bx - ax) / length)
        angle = _text_angle(math.atan2(by - ay, bx - ax), turn)
        for depth_mm in DEPTHS_MM:
            for fraction in FRACTIONS:
                x = ax + fraction * (bx - ax) + depth_mm * inward[0]
                y = ay + fraction * (by - ay) + depth_mm * inward[1]
                yield _Place((x, y), angle, inward)


def _in_faces(flat: FlatPiece, turn: float) -> list[_Place]:
    """Return places for a name in the largest faces of a piece, the preferred ones first.

    In each face the name is tried along its longer side, from the face's centre outwards, and then across. A strip, which
    bends smoothly, counts as one face. ``turn`` is the angle (rad) by which the piece is turned on its sheet.
    """
    largest_first = sorted(flat.faces, key=lambda face: -float(face.outline.area))
    outlines = [flat.outline] if flat.bends else [face.outline for face in largest_first[:NAME_FACES]]
    steps = range(1, GRID_STEPS)
    places = []
    for outline in outlines:
        x0, y0, x1, y1 = outline.bounds
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        grid = [(x0 + (x1 - x0) * i / GRID_STEPS, y0 + (y1 - y0) * j / GRID_STEPS) for i in steps for j in steps]
        grid.sort(key=lambda point: (round(math.dist(point, middle), 6), point))
        is_upright = y1 - y0 > UPRIGHT_RATIO * (x1 - x0)
        angles = (math.pi / 2, 0.0) if is_upright else (0.0, math.pi / 2)
        for angle in angles:
            places += [_Place(point, _text_angle(angle, turn)) for point in grid]
    return places


def join_marks(piece: FlatPiece, car: FoldedCar, unsplit_car: FoldedCar) -> Iterator[EdgeMark]:
    """Yield what is to be written on a piece: the numbers of its joins, and the names of parts that are laid onto it.

    The pieces of ``car`` are split to fit the sheets. Those of ``unsplit_car`` are whole, as they are placed in the car.
    """
    faces = {face.name: face for face in piece.faces}
    # A face has the number of a join once, even if the join has several edges on it.
    written: set[tuple[int, str]] = set()
    # The edges of each join around a rim or a strip, by the number of the join and whether they are its end a.
    edges_of_rims: dict[tuple[int, bool], list[Edge]] = {}
    for join, is_a in _join_ends(piece, car):
        ref = join.a if is_a else join.b
        face, number = faces[ref.face], str(join.number)
        is_written = (join.number, ref.face) in written
        if join.kind == "laminate" and not is_a:
            # On the lower face of two layers, the number stands along the outline of the layer that is laid onto it.
            written.add((join.number, ref.face))
            if not is_written:
                yield from (EdgeMark(number, edges) for edges in _edges_under_layers(face, join, unsplit_car))
            continue
        edges = _edges(face, join, is_a)
        if edges and (join.kind == "rim" or piece.bends):
            # A strip that is joined to itself has its number at both ends.
            edges_of_rims.setdefault((join.number, is_a), []).extend(edges)
        elif edges and not is_written:
            written.add((join.number, ref.face))
            yield EdgeMark(number, tuple(edges))
    for (join_number, _), edges in edges_of_rims.items():
        # The edges half way round are preferred. Sorting keeps this order among edges with the same slant.
        half = len(edges) // 2
        from_half_way = [*edges[half:], *edges[:half]]
        yield EdgeMark(str(join_number), tuple(sorted(from_half_way, key=_slant)[:PLACES]))
    for flat_face in piece.faces:
        for name, outline in flat_face.laid.items():
            if outline:
                longest_first = sorted(outline, key=lambda edge: -round(math.dist(*edge), 3))
                yield EdgeMark(name, tuple(longest_first), within=shapely.MultiLineString(outline).convex_hull)


def _join_ends(piece: FlatPiece, car: FoldedCar) -> Iterator[tuple[Join, bool]]:
    """Yield the ends of joins that are on faces of a piece: each join, and whether its end ``a`` is meant."""
    names = {face.name for face in piece.faces}
    for join in car.joins:
        if join.piece_a == piece.name and join.a.face in names:
            yield join, True
        if join.piece_b == piece.name and join.b.face in names:
            yield join, False


def _edges_under_layers(face: FlatFace, join: Join, unsplit_car: FoldedCar) -> Iterator[tuple[Edge, ...]]:
    """Yield, for each layer that is laid onto a face, the edges beside which the number of the join may stand.

    These are the edges of the face's holes under the layer. If there are none, they are the edges of the layer's outline.
    """
    # The names of the whole pieces, without the number of a part.
    upper_piece, lower_piece = (name.partition(PART)[0] for name in (join.piece_a, join.piece_b))
    piece = next(other for other in unsplit_car.pieces if other.name == lower_piece)
    outline = next(other for other in piece.faces if other.name == face.name).outline_mm
    to_flat = _motion_to_flat(outline, face)
    if to_flat is None:
        yield tuple(_edges(face, join, is_a=False))
        return
    for layer in _layers(unsplit_car, upper_piece, join.a.face, lower_piece, face.name):
        layer_in_flat = shapely.Polygon([to_flat(point) for point in layer.exterior.coords])
        area = layer_in_flat.intersection(face.outline)
        if area.is_empty or area.geom_type != "Polygon":
            continue
        around_layer = area.buffer(AROUND_LAYER_MM)
        edges = [edge for ring in face.holes.values() for edge in ring]
        hole_edges = [edge for edge in edges if around_layer.covers(shapely.LineString(edge))]
        ring = [(x, y) for x, y in shapely.geometry.polygon.orient(area).exterior.coords]
        yield tuple(sorted(hole_edges or pairwise(ring), key=_slant)[:PLACES])


def _motion_to_flat(outline: Sequence[Point], face: FlatFace) -> Callable[[Point], Point] | None:
    """Return the function that maps points of a whole face, which has this outline, to the flat piece.

    It follows from the longest edge that has not been split. None if there is no such edge.
    """
    best: tuple[Edge, Edge] | None = None
    for index, flat_edge in face.edges.items():
        if index >= len(outline):
            continue
        edge = (outline[index], outline[(index + 1) % len(outline)])
        is_whole = abs(math.dist(*edge) - math.dist(*flat_edge)) < SHORTENED_MM
        if is_whole and (best is None or math.dist(*edge) > math.dist(*best[0])):
            best = (edge, flat_edge)
    if best is None:
        return None
    # Points are complex numbers, so that a rotation is a product. The edge's middle is mapped to that of the flat edge.
    start, end = (complex(*point) for point in best[0])
    flat_start, flat_end = (complex(*point) for point in best[1])
    turn = (flat_end - flat_start) / (end - start)
    turn /= abs(turn)

    def to_flat(point: Point) -> Point:
        moved = (complex(*point) - (start + end) / 2) * turn + (flat_start + flat_end) / 2
        return moved.real, moved.imag

    return to_flat


@lru_cache(maxsize=256)
def _layers(car: FoldedCar, piece_a: str, face_a: str, piece_b: str, face_b: str) -> tuple[shapely.Polygon, ...]:
    """Return the outlines (mm) of the faces of ``piece_a`` that lie as layers on ``face_b``, in the frame of ``face_b``.

    Layers on top of each other, at the same place, are returned once.
    """
    placed = [face for faces in placed_faces(car).values() for face in faces]
    lower_face = next(face for face in placed if face.piece.name == piece_b and face.face.name == face_b)
    # The face of the join stands for all faces of its piece that are laminated.
    laminated = {face_a}
    laminated |= {join.a.face for join in car.joins if join.piece_a == piece_a and join.kind == "laminate"}
    outlines: dict[tuple[int, int], shapely.Polygon] = {}
    for face in placed:
        if face.piece.name != piece_a or face.face.name not in laminated:
            continue
        points = lower_face.in_face(face.corners_mm)
        area = shapely.Polygon(points[:, :2])
        heights = np.abs(points[:, 2])
        common_mm2 = lower_face.polygon.envelope.intersection(area).area
        if heights.max() < LAYERS_MM and common_mm2 > COMMON_MM2:
            place = (round(area.centroid.x), round(area.centroid.y))
            outlines.setdefault(place, area)
    return tuple(outlines.values())


def _edges(face: FlatFace, join: Join, is_a: bool) -> list[Edge]:
    """Return the edges of a face beside which the number of a join may be written; the film is on their left.

    ``is_a`` says which end of the join is on the face. The edges are those of the slot, if a tongue goes through one
    there; of the holes by which layers are aligned, if the join connects layers; and else the joined edge. If there are
    many, those along x or y are preferred, because numbers beside them are easy to read.
    """
    if not is_a and join.slot is not None and join.slot in face.holes:
        return list(face.holes[join.slot])
    if join.kind == "laminate":
        hole_edges = [edge for ring in face.holes.values() for edge in ring]
        edges = hole_edges or list(face.edges.values())
        return sorted(edges, key=_slant)[:PLACES]
    index = join.a.index if is_a else join.b.index
    if index not in face.edges:
        return []
    start, end = face.edges[index]
    # The tab of a rim is so narrow that its number is written on the face beside it, on the other side of the edge.
    is_rim_tab = join.kind == "rim" and face.role == "tab"
    return [(end, start)] if is_rim_tab else [(start, end)]


def _slant(edge: Edge) -> float:
    """Return how much an edge deviates from the directions x and y; 0 for an edge along x or y.

    Numbers beside an edge with a small slant are easy to read.
    """
    (ax, ay), (bx, by) = edge
    return round(min(abs(bx - ax), abs(by - ay)) / (abs(bx - ax) + abs(by - ay)), 3)


@cache
def _font() -> HersheyFonts:
    font = HersheyFonts()
    font.load_default_font("futural")
    return font


@cache
def text_strokes(text: str, height_mm: float) -> tuple[tuple[tuple[Point, ...], ...], float]:
    """Return the strokes of ``text`` and its width (mm); it starts at x = 0, its base line is y = 0.

    Each stroke is a polyline of points (x, y) in mm. Capitals are ``height_mm`` high.
    """
    scale = height_mm / CAP_UNITS
    printable = "".join(c if " " <= c <= "~" else "?" for c in text)
    strokes = [
        tuple((x * scale, (BASE_LINE - y) * scale) for x, y in stroke) for stroke in _font().strokes_for_text(printable)
    ]
    strokes = [stroke for stroke in strokes if len(set(stroke)) > 1]
    if not strokes:
        return (), 0.0
    left = min(x for stroke in strokes for x, _ in stroke)
    width = max(x for stroke in strokes for x, _ in stroke) - left
    return tuple(tuple((x - left, y) for x, y in stroke) for stroke in strokes), width
