"""Places a piece's name and its joins' numbers: upright, inside the film, clear of cuts, folds and each other.

Input: a FlatPiece and its FoldedCar. Output: strokes on the layer LABEL in the piece's frame, and texts that did not fit.
A join has its number beside both edges; the teeth of a rim share one, which is written once on the disc and once on the
strip. Where layers are laid onto a face, each place has the number. Texts are single strokes for pens and engraving
beams, Hershey's simplex roman ("futural"); missing characters are drawn as "?".
"""

import itertools
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

    The text fits if its box lies within the area ``free``. It has the largest of ``heights`` (mm) with which it fits at
    any place.
    """
    if free.is_empty or not places:
        return None
    shapely.prepare(free)
    for height in heights:
        # The origin of the strokes is the start of the base line. Some letters reach below it, by the descent. These are
        # the corners of the text's box, and the origin relative to the centre of the box.
        strokes, width = text_strokes(text, height)
        descent = height * DESCENT
        corners = np.array([(0.0, -descent), (width, -descent), (width, height), (0.0, height)])
        origin = np.array((-width / 2, -height / 2 + descent / 2))
        # The distance of the box's centre from an edge that it stands beside.
        depth = CLEAR_MM + height * (1 + DESCENT) / 2
        boxes = shapely.polygons(_at_places(places, depth, corners + origin))
        fitting_indices = np.flatnonzero(shapely.contains(free, boxes))
        if len(fitting_indices) == 0:
            continue
        first = int(fitting_indices[0])
        paths = []
        for stroke in strokes:
            (line,) = _at_places([places[first]], depth, np.array(stroke) + origin)
            paths.append(Path("LABEL", tuple((x, y) for x, y in line.tolist())))
        return paths, boxes[first]
    return None


def _at_places(places: Sequence[_Place], depth_mm: float, points: Points) -> Points:
    """Return the points of a text at each of several places, turned along the place's angle.

    ``points``, (m, 2), are relative to the centre of the text's box, with x along the text. The result has the shape
    (places, m, 2). If the box stands beside an edge, its centre is ``depth_mm`` inwards from the place.
    """
    place_points = np.array([place.point for place in places])
    inward = np.array([place.inward for place in places])
    centres = place_points + depth_mm * inward
    # Arrays of the places have one column, so that numpy combines each place with each point.
    centre_x, centre_y = centres[:, :1], centres[:, 1:]
    cos = np.array([[math.cos(place.angle)] for place in places])
    sin = np.array([[math.sin(place.angle)] for place in places])
    along_text, across_text = points.T
    x = centre_x + cos * along_text - sin * across_text
    y = centre_y + sin * along_text + cos * across_text
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

    In each face, the places are the points of a grid, those near the face's middle first. The name is tried at all of
    them along the longer side of the face, and then at all of them across. A piece that bends smoothly counts as one
    face. ``turn`` is the angle (rad) by which the piece is turned on its sheet.
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


def join_marks(piece: FlatPiece, car: FoldedCar, unsplit_car: FoldedCar) -> Iterator[EdgeMark]:
    """Yield what is to be written on a piece: the numbers of its joins, and the names of parts that are laid onto it.

    The pieces of ``car`` are split to fit the sheets. Those of ``unsplit_car`` are whole, as they are placed in the car.
    """
    faces = {face.name: face for face in piece.faces}
    # The numbers of joins that are written on a face. Each is written there once, even if the join has several edges on
    # the face.
    written: set[tuple[int, str]] = set()
    # The edges of each join of a wheel's rim or disc, by the join's number and whether they are at its end a. They share
    # one number. A strip that is joined to itself has it at both ends.
    edges_around_wheel: dict[tuple[int, bool], list[Edge]] = {}
    for join, is_a in _join_ends(piece, car):
        face_name = join.a.face if is_a else join.b.face
        face, number = faces[face_name], str(join.number)
        is_written = (join.number, face_name) in written
        if join.kind == "laminate" and not is_a:
            # On the lower face of two layers, the number stands along the outline of the layer that is laid onto it.
            written.add((join.number, face_name))
            if not is_written:
                for edges_under_layer in _edges_under_layers(face, join, unsplit_car):
                    yield EdgeMark(number, edges_under_layer)
            continue
        edges = _edges(face, join, is_a)
        is_around_wheel = join.kind == "rim" or bool(piece.bends)
        if edges and is_around_wheel:
            edges_around_wheel.setdefault((join.number, is_a), []).extend(edges)
        elif edges and not is_written:
            written.add((join.number, face_name))
            yield EdgeMark(number, tuple(edges))
    for (join_number, _), edges in edges_around_wheel.items():
        # Edges along x or y come first. Of these, the edges in the middle of the list come first, which are far from the
        # ends of a strip. Sorting does not change the order of edges with the same slant.
        half = len(edges) // 2
        middle_first = [*edges[half:], *edges[:half]]
        yield EdgeMark(str(join_number), tuple(sorted(middle_first, key=_slant)[:PLACES]))
    # The names of the parts that are laid onto the piece, within the outlines of these parts.
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
    # A piece may be split into parts to fit the sheets, and ``face`` may be a part of a face. Where layers lie is known
    # for the whole pieces, whose names are without the number of a part.
    layer_name, _, _ = join.piece_a.partition(PART)
    host_name, _, _ = join.piece_b.partition(PART)
    whole_piece = next(piece for piece in unsplit_car.pieces if piece.name == host_name)
    whole_face = next(candidate for candidate in whole_piece.faces if candidate.name == face.name)
    to_flat = _motion_to_flat(whole_face.outline_mm, face)
    if to_flat is None:
        yield tuple(_edges(face, join, is_a=False))
        return
    for layer in _layers(
        unsplit_car, layer_piece=layer_name, layer_face=join.a.face, host_piece=host_name, host_face=face.name
    ):
        # The area of this part of the face that the layer covers.
        layer_in_flat = shapely.Polygon([to_flat(point) for point in layer.exterior.coords])
        covered = layer_in_flat.intersection(face.outline)
        if covered.is_empty or covered.geom_type != "Polygon":
            continue
        around_layer = covered.buffer(AROUND_LAYER_MM)
        edges: list[Edge] = []
        for hole in face.holes.values():
            edges += (edge for edge in hole if around_layer.covers(shapely.LineString(edge)))
        if not edges:
            corners = [(x, y) for x, y in shapely.geometry.polygon.orient(covered).exterior.coords]
            edges = list(pairwise(corners))
        # Numbers are easy to read beside edges along x or y, so these come first.
        yield tuple(sorted(edges, key=_slant)[:PLACES])


def _motion_to_flat(outline: Sequence[Point], face: FlatFace) -> Callable[[Point], Point] | None:
    """Return the function that maps points of a whole face, which has this outline, to the flat piece.

    ``face`` is the face in the flat piece, or the part of it that is on this piece if the piece was split. The function
    follows from the longest edge that was not split. The result is None if there is no such edge.
    """
    longest_edge: Edge | None = None
    longest_flat_edge: Edge | None = None
    max_length = 0.0
    for index, flat_edge in face.edges.items():
        # Splitting adds edges after those of the whole face.
        if index >= len(outline):
            continue
        edge = (outline[index], outline[(index + 1) % len(outline)])
        length = math.dist(*edge)
        is_whole = abs(length - math.dist(*flat_edge)) < SHORTENED_MM
        if is_whole and length > max_length:
            longest_edge, longest_flat_edge, max_length = edge, flat_edge, length
    if longest_edge is None or longest_flat_edge is None:
        return None
    # A point (x, y) is the complex number x + i y, so that a rotation is the product with a number of the absolute value
    # 1. The rotation turns the direction of the edge into that of the flat edge. The edge's middle is mapped to the
    # middle of the flat edge.
    start, end = (complex(*point) for point in longest_edge)
    flat_start, flat_end = (complex(*point) for point in longest_flat_edge)
    rotation = (flat_end - flat_start) / (end - start)
    rotation /= abs(rotation)
    middle, flat_middle = (start + end) / 2, (flat_start + flat_end) / 2

    def to_flat(point: Point) -> Point:
        flat_point = (complex(*point) - middle) * rotation + flat_middle
        return flat_point.real, flat_point.imag

    return to_flat


@lru_cache(maxsize=256)
def _layers(
    car: FoldedCar, layer_piece: str, layer_face: str, host_piece: str, host_face: str
) -> tuple[shapely.Polygon, ...]:
    """Return the outlines (mm) of the layers on the face ``host_face`` of a piece, in the frame of that face.

    The layers are faces of ``layer_piece``: the face ``layer_face``, and others that are laminated onto something. Layers
    on top of each other, at the same place, are returned once.
    """
    placed = list(itertools.chain.from_iterable(placed_faces(car).values()))
    host = next(face for face in placed if face.piece.name == host_piece and face.face.name == host_face)
    laminated_faces = {layer_face}
    for join in car.joins:
        if join.piece_a == layer_piece and join.kind == "laminate":
            laminated_faces.add(join.a.face)
    # The outlines by their middles, which are rounded to whole millimetres.
    outlines: dict[tuple[int, int], shapely.Polygon] = {}
    for face in placed:
        if face.piece.name != layer_piece or face.face.name not in laminated_faces:
            continue
        # A layer lies near the plane of the host's face, and within its bounds.
        corners = host.in_face(face.corners_mm)
        max_height = np.abs(corners[:, 2]).max()
        outline = shapely.Polygon(corners[:, :2])
        common_mm2 = host.polygon.envelope.intersection(outline).area
        if max_height < LAYERS_MM and common_mm2 > COMMON_MM2:
            middle = (round(outline.centroid.x), round(outline.centroid.y))
            outlines.setdefault(middle, outline)
    return tuple(outlines.values())


def _edges(face: FlatFace, join: Join, is_a: bool) -> list[Edge]:
    """Return the edges of a face beside which the number of a join may be written; the film is on their left.

    ``is_a`` says which end of the join is on the face. If the face has the slot of a tongue, the edges are those of the
    slot. If the join connects layers, they are the edges of the face's holes, by which the layers are aligned, or its
    outer edges if it has no holes; at most PLACES of them, and those along x or y first, because numbers beside them are
    easy to read. In all other cases there is one edge, the joined one.
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
