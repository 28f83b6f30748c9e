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
from foldcar.car.folded.placed import place as placed_faces
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
    """Return the strokes of name and numbers, upright after ``quarter_turns``, and the texts that did not fit."""
    turn = quarter_turns * math.pi / 2
    occupied: list[BaseGeometry] = [LineString([f.a, f.b]) for f in flat.folds]
    occupied += [LineString(line) for line in (*flat.slits, *flat.marks)]
    occupied += [ShapelyPoint(p).buffer(d / 2) for p, d in flat.circles]
    blocked = shapely.union_all([line.buffer(CLEAR_MM, quad_segs=2) for line in occupied])
    free: BaseGeometry = flat.outline.buffer(-CLEAR_MM, quad_segs=2).difference(blocked)
    paths: list[Path] = []
    missing: list[str] = []

    # Numbers first, because they have fewer possible places than the name.
    for mark in marks:
        room = free if mark.within is None else free.intersection(mark.within)
        fit = _first_fit(room, mark.text, list(_beside_edges(mark, turn)), NUMBER_HEIGHTS_MM)
        if fit is None:
            missing.append(mark.text)
            continue
        free = free.difference(fit[1].buffer(APART_MM, join_style="mitre"))
        paths += fit[0]
    fit = _first_fit(free, name, _in_faces(flat, turn), NAME_HEIGHTS_MM)
    if fit is None:
        missing.append(name)
    else:
        paths += fit[0]
    return paths, missing


@dataclass(frozen=True, slots=True)
class _Place:
    """A place for a text: its box is centred on ``point`` or, with ``inward``, touches it on that side."""

    point: Point
    angle: float
    inward: Point = (0.0, 0.0)


def _first_fit(
    free: BaseGeometry, text: str, places: list[_Place], heights: tuple[float, ...]
) -> tuple[list[Path], Polygon] | None:
    """Return the text at the largest height that fits at one of the places, with its box; None if none fits."""
    if free.is_empty or not places:
        return None
    shapely.prepare(free)
    cos, sin = (np.array([[turn(place.angle)] for place in places]) for turn in (math.cos, math.sin))
    for height in heights:
        strokes, width = text_strokes(text, height)
        depth = CLEAR_MM + height * (1 + DESCENT) / 2
        middles = np.array(
            [[at + depth * to for at, to in zip(place.point, place.inward, strict=True)] for place in places]
        )
        corner = -width / 2, -height / 2 + height * DESCENT / 2

        def put(points: Sequence[Point], i: slice, at: Points = middles, corner: Point = corner) -> Points:
            u, v = (np.array(points) + corner).T
            return np.stack([at[i, :1] + cos[i] * u - sin[i] * v, at[i, 1:] + sin[i] * u + cos[i] * v], axis=-1)

        corners = [(0.0, -height * DESCENT), (width, -height * DESCENT), (width, height), (0.0, height)]
        boxes = shapely.polygons(put(corners, slice(None)))
        for i in np.flatnonzero(shapely.contains(free, boxes))[:1].tolist():
            moved = (put(stroke, slice(i, i + 1))[0].tolist() for stroke in strokes)
            return [Path("LABEL", tuple((x, y) for x, y in line)) for line in moved], boxes[i]
    return None


def _upright(angle: float) -> float:
    """Return the line's direction or its reverse, so that text is not upside down; vertical text reads from the right."""
    angle = math.remainder(angle, math.pi)
    return angle + math.pi if angle < -math.pi / 2 + 1e-6 else angle


def _beside_edges(mark: EdgeMark, turn: float) -> Iterator[_Place]:
    """Yield places along each edge, from its middle outwards; then farther inside."""
    for (ax, ay), (bx, by) in mark.edges:
        length = math.hypot(bx - ax, by - ay)
        inward = (-(by - ay) / length, (bx - ax) / length)
        angle = _upright(math.atan2(by - ay, bx - ax) + turn) - turn
        for deep in (1.2, 0.0, 3.0, 6.0):
            for fraction in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9):
                point = (ax + fraction * (bx - ax) + deep * inward[0], ay + fraction * (by - ay) + deep * inward[1])
                yield _Place(point, angle, inward)


def _in_faces(flat: FlatPiece, turn: float) -> list[_Place]:
    """Return places on the faces, largest face first, from its centre outwards, first along its longer side.

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


def join_marks(piece: FlatPiece, car: FoldedCar, unsplit_car: FoldedCar) -> Iterator[EdgeMark]:
    """Yield the numbers of all joins of the piece, and the names of parts laid onto it.

    ``car`` has pieces split to fit the sheets, ``unsplit_car`` has whole pieces, as they are placed in the car.
    """
    faces = {face.name: face for face in piece.faces}
    seen: set[tuple[int, str]] = set()
    around: dict[tuple[int, bool], list[Edge]] = {}
    for join in car.joins:
        for name, ref, slot in ((join.piece_a, join.a, None), (join.piece_b, join.b, join.slot)):
            if name != piece.name or ref.face not in faces:
                continue
            if join.kind == "laminate" and ref is join.b:
                if (join.number, ref.face) not in seen:
                    yield from (EdgeMark(str(join.number), edges) for edges in _under(faces[ref.face], join, unsplit_car))
                seen.add((join.number, ref.face))
                continue
            edges = _edges(faces[ref.face], ref, join, slot)
            if not edges:
                continue
            if join.kind == "rim" or piece.bends:
                # A strip that is joined to itself has its number at both ends.
                around.setdefault((join.number, ref is join.a), []).extend(edges)
            elif (join.number, ref.face) not in seen:
                seen.add((join.number, ref.face))
                yield EdgeMark(str(join.number), tuple(edges))
    for (number, _), edges in around.items():
        half = len(edges) // 2
        yield EdgeMark(str(number), tuple(sorted((*edges[half:], *edges[:half]), key=_slant)[:PLACES]))
    for name, outline in (laid for face in piece.faces for laid in face.laid.items() if laid[1]):
        longest = sorted(outline, key=lambda edge: -round(math.dist(*edge), 3))
        yield EdgeMark(name, tuple(longest), shapely.MultiLineString(outline).convex_hull)


def _under(face: FlatFace, join: Join, unsplit_car: FoldedCar) -> Iterator[tuple[Edge, ...]]:
    """Yield, for each layer that a join lays on a face, the edges of the opening in it, or of its own outline."""
    above, below = (name.partition(PART)[0] for name in (join.piece_a, join.piece_b))
    piece = next(other for other in unsplit_car.pieces if other.name == below)
    outline = next(other for other in piece.faces if other.name == face.name).outline_mm
    pairs = [((outline[i], outline[(i + 1) % len(outline)]), edge) for i, edge in face.edges.items() if i < len(outline)]
    # The motion from the face's frame to the flat, by its longest unsplit edge; a bend shortens it by less than 1 mm.
    kept = [pair for pair in pairs if abs(math.dist(*pair[0]) - math.dist(*pair[1])) < 1.0]
    if not kept:
        yield tuple(_edges(face, join.b, join, None))
        return
    (a, b), (to_a, to_b) = (
        (complex(*edge[0]), complex(*edge[1])) for edge in max(kept, key=lambda pair: math.dist(*pair[0]))
    )
    turn = (to_b - to_a) / (b - a)
    turn /= abs(turn)
    for layer in _layers(unsplit_car, above, join.a.face, below, face.name):
        flat = [(complex(*point) - (a + b) / 2) * turn + (to_a + to_b) / 2 for point in layer.exterior.coords]
        area = shapely.Polygon([(point.real, point.imag) for point in flat]).intersection(face.outline)
        if area.is_empty or area.geom_type != "Polygon":
            continue
        room = area.buffer(1.0)
        around = [edge for ring in face.holes.values() for edge in ring if room.covers(shapely.LineString(edge))]
        ring = [(x, y) for x, y in shapely.geometry.polygon.orient(area).exterior.coords]
        yield tuple(sorted(around or pairwise(ring), key=_slant)[:PLACES])


@lru_cache(maxsize=256)
def _layers(car: FoldedCar, piece_a: str, face_a: str, piece_b: str, face_b: str) -> tuple[shapely.Polygon, ...]:
    """Return the outlines (mm) of laminated faces like ``face_a`` on ``face_b``, in its frame, each place once."""
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
    """Return the edges beside which the number may be written, with the film on their left."""
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
    """Deviation of an edge from the x and y directions: numbers beside an edge along x or y (0) are easiest to read."""
    (ax, ay), (bx, by) = edge
    return round(min(abs(bx - ax), abs(by - ay)) / (abs(bx - ax) + abs(by - ay)), 3)


@cache
def _font() -> HersheyFonts:
    font = HersheyFonts()
    font.load_default_font("futural")
    return font


@cache
def text_strokes(text: str, height_mm: float) -> tuple[tuple[tuple[Point, ...], ...], float]:
    """Return the strokes of ``text`` with capitals ``height_mm`` high, from x = 0 on the base line, and its width."""
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
