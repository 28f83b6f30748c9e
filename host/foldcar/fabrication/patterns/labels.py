"""Places a piece's name and its joins' numbers: upright, inside the film, clear of cuts, folds and each other.

Input: a FlatPiece and its FoldedCar. Output: strokes on the layer LABEL in the piece's frame, and texts that did not fit.
A join has its number beside both edges; the teeth of a rim share one, which is written once on the disc and once on the
strip. Where layers are laid onto a face, each place has the number. Texts are single strokes for pens and engraving
beams, Hershey's simplex roman ("futural"); missing characters are drawn as "?".
"""

import math
from collections.abc import Iterable, Iterator, Sequence
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

from foldcar.car.folded.model import EdgeRef, FoldedCar, Join
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
    cos, sin = (np.array([[turn(place.angle)] for place in places]) for turn in (math.cos, math.sin))
    for height in heights:
        strokes, width = text_strokes(text, height)
        # Distance of the box's centre from an edge that it stands beside.
        depth = CLEAR_MM + height * (1 + DESCENT) / 2
        centres = np.array([place.point for place in places]) + depth * np.array([place.inward for place in places])
        # The start of the base line, relative to the centre of the box.
        origin = -width / 2, -height / 2 + height * DESCENT / 2

        # The defaults keep the values of this height; without them, the function would use those of the last height.
        def placed(points: Sequence[Point], i: slice, at: Points = centres, origin: Point = origin) -> Points:
            """Return points of the text, (m, 2), turned and moved to the places with these indices: (n, m, 2)."""
            u, v = (np.array(points) + origin).T
            return np.stack([at[i, :1] + cos[i] * u - sin[i] * v, at[i, 1:] + sin[i] * u + cos[i] * v], axis=-1)

        corners = [(0.0, -height * DESCENT), (width, -height * DESCENT), (width, height), (0.0, height)]
        boxes = shapely.polygons(placed(corners, slice(None)))
        fitting = np.flatnonzero(shapely.contains(free, boxes))
        if len(fitting):
            i = int(fitting[0])
            lines = (placed(stroke, slice(i, i + 1))[0].tolist() for stroke in strokes)
            return [Path("LABEL", tuple((x, y) for x, y in line)) for line in lines], boxes[i]
    return None


def _upright(angle: float) -> float:
    """Return a line's angle (rad) or its reverse, so that text along it is not upside down.

    Vertical text is read from the right.
    """
    angle = math.remainder(angle, math.pi)
    return angle + math.pi if angle < -math.pi / 2 + 1e-6 else angle


def _beside_edges(mark: EdgeMark, turn: float) -> Iterator[_Place]:
    """Yield places for a number beside the edges of a mark: at several depths, from each edge's middle outwards.

    ``turn`` is the angle (rad) by which the piece is turned on its sheet.
    """
    for (ax, ay), (bx, by) in mark.edges:
        length = math.hypot(bx - ax, by - ay)
        inward = (-(by - ay) / length, (bx - ax) / length)
        angle = _upright(math.atan2(by - ay, bx - ax) + turn) - turn
        # Depths in the order of preference.
        for depth_mm in (1.2, 0.0, 3.0, 6.0):
            for fraction in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9):
                x = ax + fraction * (bx - ax) + depth_mm * inward[0]
                y = ay + fraction * (by - ay) + depth_mm * inward[1]
                yield _Place((x, y), angle, inward)


def _in_faces(flat: FlatPiece, turn: float) -> list[_Place]:
    """Return places for a name in the four largest faces: in each from its centre outwards, first along its longer side.

    A strip, which bends smoothly, counts as one face. ``turn`` is the angle (rad) by which the piece is turned.
    """
    outlines = [face.outline for face in sorted(flat.faces, key=lambda face: -float(face.outline.area))[:4]]
    if flat.bends:
        outlines = [flat.outline]
    places = []
    for outline in outlines:
        x0, y0, x1, y1 = outline.bounds
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        grid = [(x0 + (x1 - x0) * i / 12, y0 + (y1 - y0) * j / 12) for i in range(1, 12) for j in range(1, 12)]
        grid.sort(key=lambda p: (round(math.dist(p, middle), 6), p))
        is_upright = y1 - y0 > 1.2 * (x1 - x0)
        for angle in (math.pi / 2, 0.0) if is_upright else (0.0, math.pi / 2):
            places += [_Place(p, _upright(angle + turn) - turn) for p in grid]
    return places


def join_marks(piece: FlatPiece, car: FoldedCar, unsplit_car: FoldedCar) -> Iterator[EdgeMark]:
    """Yield what is to be written on a piece: the numbers of its joins, and the names of parts that are laid onto it.

    The pieces of ``car`` are split to fit the sheets. Those of ``unsplit_car`` are whole, as they are placed in the car.
    """
    faces = {face.name: face for face in piece.faces}
    done: set[tuple[int, str]] = set()
    edges_around_rim: dict[tuple[int, bool], list[Edge]] = {}
    for join in car.joins:
        for name, ref, slot in ((join.piece_a, join.a, None), (join.piece_b, join.b, join.slot)):
            if name != piece.name or ref.face not in faces:
                continue
            # On the lower face of two layers, the number stands along the outline of the layer that is laid onto it.
            if join.kind == "laminate" and ref is join.b:
                if (join.number, ref.face) not in done:
                    layers = _edges_under_layers(faces[ref.face], join, unsplit_car)
                    yield from (EdgeMark(str(join.number), edges) for edges in layers)
                done.add((join.number, ref.face))
                continue
            edges = _edges(faces[ref.face], ref, join, slot)
            if not edges:
                continue
            if join.kind == "rim" or piece.bends:
                # A strip that is joined to itself has its number at both ends.
                edges_around_rim.setdefault((join.number, ref is join.a), []).extend(edges)
            elif (join.number, ref.face) not in done:
                done.add((join.number, ref.face))
                yield EdgeMark(str(join.number), tuple(edges))
    for (number, _), edges in edges_around_rim.items():
        # The list begins with the edges half way round. Sorting keeps this order among edges with the same slant.
        half = len(edges) // 2
        yield EdgeMark(str(number), tuple(sorted((*edges[half:], *edges[:half]), key=_slant)[:PLACES]))
    for name, outline in (laid_part for face in piece.faces for laid_part in face.laid.items()):
        if not outline:
            continue
        longest = sorted(outline, key=lambda edge: -round(math.dist(*edge), 3))
        yield EdgeMark(name, tuple(longest), shapely.MultiLineString(outline).convex_hull)


def _edges_under_layers(face: FlatFace, join: Join, unsplit_car: FoldedCar) -> Iterator[tuple[Edge, ...]]:
    """Yield, for each layer that is laid onto a face, the edges beside which the number of the join may stand.

    These are the edges of the face's holes under the layer. If there are none, they are the edges of the layer's outline.
    """
    # The names of the whole pieces, without the number of a part.
    upper_piece, lower_piece = (name.partition(PART)[0] for name in (join.piece_a, join.piece_b))
    piece = next(other for other in unsplit_car.pieces if other.name == lower_piece)
    outline = next(other for other in piece.faces if other.name == face.name).outline_mm
    pairs = [((outline[i], outline[(i + 1) % len(outline)]), edge) for i, edge in face.edges.items() if i < len(outline)]
    # The longest edge that was not split gives the motion from the face's frame to the flat piece. Points are complex
    # numbers, so that a rotation is a product. A bend shortens an edge by less than 1 mm.
    unchanged = [pair for pair in pairs if abs(math.dist(*pair[0]) - math.dist(*pair[1])) < 1.0]
    if not unchanged:
        yield tuple(_edges(face, join.b, join, None))
        return
    (a, b), (to_a, to_b) = (
        (complex(*edge[0]), complex(*edge[1])) for edge in max(unchanged, key=lambda pair: math.dist(*pair[0]))
    )
    turn = (to_b - to_a) / (b - a)
    turn /= abs(turn)
    for layer in _layers(unsplit_car, upper_piece, join.a.face, lower_piece, face.name):
        layer_points = [(complex(*point) - (a + b) / 2) * turn + (to_a + to_b) / 2 for point in layer.exterior.coords]
        layer_area = shapely.Polygon([(point.real, point.imag) for point in layer_points]).intersection(face.outline)
        if layer_area.is_empty or layer_area.geom_type != "Polygon":
            continue
        under_layer = layer_area.buffer(1.0)
        edges = (edge for ring in face.holes.values() for edge in ring)
        hole_edges = [edge for edge in edges if under_layer.covers(shapely.LineString(edge))]
        ring = [(x, y) for x, y in shapely.geometry.polygon.orient(layer_area).exterior.coords]
        yield tuple(sorted(hole_edges or pairwise(ring), key=_slant)[:PLACES])


@lru_cache(maxsize=256)
def _layers(car: FoldedCar, piece_a: str, face_a: str, piece_b: str, face_b: str) -> tuple[shapely.Polygon, ...]:
    """Return the outlines (mm) of the faces of ``piece_a`` that lie as layers on ``face_b``, in the frame of ``face_b``.

    Of several layers at the same place, one is returned.
    """
    placed = [face for faces in placed_faces(car).values() for face in faces if face.piece.name in (piece_a, piece_b)]
    lower_face = next(face for face in placed if (face.piece.name, face.face.name) == (piece_b, face_b))
    same_faces = {join.a.face for join in car.joins if (join.piece_a, join.kind) == (piece_a, "laminate")} | {face_a}
    outlines: dict[tuple[int, int], shapely.Polygon] = {}
    for placed_face in placed:
        if placed_face.piece.name != piece_a or placed_face.face.name not in same_faces:
            continue
        points = lower_face.in_face(placed_face.corners_mm)
        area = shapely.Polygon(points[:, :2])
        if np.abs(points[:, 2]).max() < LAYERS_MM and lower_face.polygon.envelope.intersection(area).area > 1.0:
            outlines.setdefault((round(area.centroid.x), round(area.centroid.y)), area)
    return tuple(outlines.values())


def _edges(face: FlatFace, ref: EdgeRef, join: Join, slot: str | None) -> list[Edge]:
    """Return the edges beside which the number of a join may be written; the film is on their left.

    These are the edges of the slot, if the join has one; of the holes by which layers are aligned, if the join connects
    layers; and else the joined edge ``ref``.
    """
    if slot is not None and slot in face.holes:
        return list(face.holes[slot])
    if join.kind == "laminate":
        # Layers are aligned by their holes.
        edges = [edge for ring in face.holes.values() for edge in ring] or list(face.edges.values())
        return sorted(edges, key=_slant)[:PLACES]
    if ref.index not in face.edges:
        return []
    a, b = face.edges[ref.index]
    return [(b, a)] if join.kind == "rim" and face.role == "tab" else [(a, b)]


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
