"""Unfolds a piece for cutting to one outline with its openings and folds.

Input: a Piece of the folded car and Options. Output: a FlatPiece in millimetres, printed side up, in the frame of its
root face. Bends shorten the flat (bend deduction), the free edges of tabs move inwards by the tab clearance. Kerf is
compensated when the sheets are drawn.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, partial
from typing import Any, Literal, NamedTuple

import shapely.affinity
from shapely.geometry import LineString, MultiPoint, Polygon

from foldcar.car.folded.model import Crease, Face, Piece, Pose
from foldcar.car.folded.pose import edge, folded
from foldcar.fabrication.patterns.drawing import Point
from foldcar.fabrication.patterns.options import OptionError, Options

# Outlines are united on a grid of 0.1 µm, so that common corners of two faces become one point.
GRID_MM = 1e-4
# Corners closer than this to the line through their neighbours are removed.
STRAIGHT_MM = 1e-3
# A remainder of a face's edge shorter than this is a rounding error, not a slit between two faces.
MIN_SLIT_MM = 0.05
# Beyond this fold angle faces lie on each other, and there is no bend deduction.
MAX_BEND_RAD = math.radians(150)

# Outlines of parts are drawn as corners with sides so long.
CORNER_MM = 6.0

FoldKind = Literal["mountain", "valley", "flexure"]
Edge = tuple[Point, Point]
# Two edges with a smaller sine of their angle are collinear.
PARALLEL = 1e-6


@dataclass(frozen=True, slots=True)
class Fold:
    """A fold line from ``a`` to ``b`` (mm). A flexure is neither cut nor scored."""

    kind: FoldKind
    a: Point
    b: Point


@dataclass(frozen=True, slots=True)
class FlatFace:
    """A face in the flat, for labels. ``edges`` are numbered as in the face, ``holes`` has the edges of holes by name.

    ``laid`` has the edges of the outlines of parts that are laid onto it. Edges run counter-clockwise, those of holes
    clockwise, so that the film is on their left.
    """

    name: str
    role: str
    outline: Polygon
    edges: Mapping[int, Edge]
    holes: Mapping[str, tuple[Edge, ...]]
    laid: Mapping[str, tuple[Edge, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FlatPiece:
    """A piece to cut; all lengths in mm.

    ``outline`` has the polygonal openings as its holes; ``circles`` are (centre, diameter); ``slits`` are open cuts.
    ``marks`` are lines that another part is laid against. ``bends`` are the lines between facets of a smooth
    bend, which are not drawn. ``thickness_mm`` is the film's.
    """

    name: str
    label: str
    outline: Polygon
    circles: tuple[tuple[Point, float], ...]
    slits: tuple[tuple[Point, ...], ...]
    folds: tuple[Fold, ...]
    faces: tuple[FlatFace, ...]
    count: int = 1
    marks: tuple[Edge, ...] = ()
    bends: tuple[Edge, ...] = ()
    thickness_mm: float = 0.0

    @property
    def area_mm2(self) -> float:
        """Area of the film, without openings (mm²)."""
        return float(self.outline.area) - sum(math.pi / 4 * d * d for _, d in self.circles)


@lru_cache(maxsize=256)
def flat_piece(piece: Piece, options: Options) -> FlatPiece:
    """Unfold a piece: its faces, shortened at bends, are placed in the plane and united to one outline.

    Raises ValueError if the faces are not one connected area.
    """
    thickness = piece.thickness_mm
    faces = {face.name: face for face in piece.faces}
    inward = {face.name: [_free_edge_mm(face, options)] * len(face.outline_mm) for face in piece.faces}
    for crease in piece.creases:
        shortening_mm = _saved_mm(crease, thickness, options) / 2
        inward[crease.parent.face][crease.parent.index] = shortening_mm
        inward[crease.child.face][crease.child.index] = shortening_mm
    corners = {name: offset_edges(face.outline_mm, inward[name]) for name, face in faces.items()}
    placings = _placings(piece, thickness, options)
    flat = tuple(_flat_face(face, corners[face.name], placings[face.name]) for face in piece.faces)
    by_name = {face.name: face for face in flat}
    lines = [(_fold(crease, by_name), crease.bend) for crease in piece.creases]
    folds = tuple(fold for fold, bent in lines if fold is not None and not bent)
    bends = tuple((fold.a, fold.b) for fold, bent in lines if fold is not None and bent)
    # Rounding to the grid would move a corner off another face's edge, so both edges get the fold's ends as points.
    ends = MultiPoint([end for fold, _ in lines if fold is not None for end in (fold.a, fold.b)])
    try:
        outline = shapely.union_all([shapely.snap(face.outline, ends, GRID_MM) for face in flat], grid_size=GRID_MM)
    except shapely.errors.GEOSException:
        # Folds that are wider than a face turn its outline inside out.
        reason = f"the folds of {piece.name} are wider than its faces; choose a smaller one"
        raise OptionError(f"bend_radius_mm {options.bend_radius_mm:g}: {reason}") from None
    outline = shapely.simplify(outline, STRAIGHT_MM)
    if not isinstance(outline, Polygon):
        raise ValueError(f"piece {piece.name} is not one connected area")
    slits = _slits(outline, flat, [fold for fold, _ in lines if fold is not None])
    circles, openings = [], []
    for face in piece.faces:
        place = placings[face.name]
        for hole in face.holes:
            if hole.diameter_mm is not None and hole.center_mm is not None:
                circles.append((place(hole.center_mm), hole.diameter_mm))
            else:
                openings.append([place(p) for p in hole.outline_mm])
    outline = Polygon(outline.exterior, [*outline.interiors, *openings])
    return FlatPiece(
        piece.name,
        piece.label or piece.name,
        shapely.geometry.polygon.orient(outline),
        tuple(circles),
        slits,
        folds,
        flat,
        piece.count,
        marks=tuple(corner for face in flat for edges in face.laid.values() for corner in _corners(edges)),
        bends=bends,
        thickness_mm=piece.thickness_mm,
    )


def bend_deduction_mm(angle_rad: float, thickness_mm: float, options: Options) -> float:
    """Return the bend deduction (mm): by how much a bend's flat length is shorter than that of a sharp corner.

    Of a bend by the angle a, the inner radius is r, the thickness t and the k-factor k. The sharp corner is that of the
    middle surfaces. The two setbacks, from this corner to the ends of the bend, have the length 2 (r + t/2) tan(a/2). The
    arc of the neutral line has the length a (r + k t). The deduction is the difference. It is 0 if faces are folded onto
    each other, by more than MAX_BEND_RAD.
    """
    angle = abs(angle_rad)
    if angle > MAX_BEND_RAD:
        return 0.0
    radius = options.bend_radius_mm
    setbacks = 2 * (radius + thickness_mm / 2) * math.tan(angle / 2)
    neutral_arc = angle * (radius + options.k_factor * thickness_mm)
    return setbacks - neutral_arc


def _saved_mm(crease: Crease, thickness_mm: float, options: Options) -> float:
    """Return the bend deduction (mm) of a fold; a smooth bend's facets are as long as the film's middle."""
    return 0.0 if crease.bend else bend_deduction_mm(crease.angle_rad, thickness_mm, options)


def _free_edge_mm(face: Face, options: Options) -> float:
    if face.role != "tab":
        return 0.0
    # A small tab keeps half of its width.
    x0, y0, x1, y1 = Polygon(face.outline_mm).bounds
    return min(options.tab_clearance_mm, float(min(x1 - x0, y1 - y0)) / 4)


def _placings(piece: Piece, thickness_mm: float, options: Options) -> dict[str, Callable[[Point], Point]]:
    """Return, by face, the function that maps a point of the face (mm) into the flat piece.

    A bend is shorter in the flat than the sharp corner of the model, by the *bend deduction*. So a child is moved towards
    its parent by this length, with all its own children.
    """
    faces = {face.name: face for face in piece.faces}
    poses = folded(piece, 0.0)
    shifts = {piece.faces[0].name: (0.0, 0.0)}
    # Creases of parents precede those of their children.
    for crease in piece.creases:
        (ax, ay), (bx, by) = edge(faces, crease.parent)
        # The shift in the parent's frame. It is as long as the bend deduction, and points inwards, at right angles to the
        # edge: this is the edge's vector, turned by 90° counter-clockwise and scaled.
        scale = _saved_mm(crease, thickness_mm, options) / math.hypot(bx - ax, by - ay)
        inward_x, inward_y = -(by - ay) * scale, (bx - ax) * scale
        # The first two rows of the parent's pose turn this shift into the frame of the flat piece. The child also moves
        # along with its parent.
        x_row, y_row, *_ = poses[crease.parent.face]
        parent_x, parent_y = shifts[crease.parent.face]
        child_x = parent_x + x_row[0] * inward_x + x_row[1] * inward_y
        child_y = parent_y + y_row[0] * inward_x + y_row[1] * inward_y
        shifts[crease.child.face] = (child_x, child_y)
    return {name: partial(_placed, pose=pose, shift=shifts[name]) for name, pose in poses.items()}


def _placed(p: Point, pose: Pose, shift: Point) -> Point:
    (cos, _, _, x), (sin, _, _, y), *_ = pose
    return cos * p[0] - sin * p[1] + (x + shift[0]), sin * p[0] + cos * p[1] + (y + shift[1])


def _flat_face(face: Face, corners: list[list[Point]], place: Callable[[Point], Point]) -> FlatFace:
    """Return a face with its edges and holes in the flat piece; ``place`` maps points of the face there.

    ``corners`` has the points of each corner of the face, in order. A corner usually has one point. It has two points
    where the edges that meet there do not touch: the end of one edge and the start of the next.
    """
    placed_corners = [[place(point) for point in corner] for corner in corners]
    edges = {}
    for index, corner in enumerate(placed_corners):
        next_corner = placed_corners[(index + 1) % len(placed_corners)]
        edges[index] = (corner[-1], next_corner[0])
    outline = Polygon([point for corner in placed_corners for point in corner])

    def ring(points: Iterable[Point]) -> tuple[Edge, ...]:
        """Return the edges of a closed outline of the face, in the flat piece."""
        placed = [place(point) for point in points]
        return tuple(zip(placed, [*placed[1:], placed[0]], strict=True))

    # Holes run clockwise, so that the material is on the left of their edges, as it is for the outline.
    holes = {hole.name: ring(reversed(hole.outline_mm)) for hole in face.holes}
    # The marks of a face are the outlines of parts that are laid onto it.
    laid = {mark.name: ring(mark.outline_mm) for mark in face.marks}
    return FlatFace(face.name, face.role, outline, edges, holes, laid)


def _corners(edges: Sequence[Edge]) -> Iterator[Edge]:
    """Yield short lines at both ends of every edge, with the film of the outline on their left."""
    for a, b in edges:
        fraction = min(CORNER_MM / math.dist(a, b), 0.5)
        for start, end in ((0.0, fraction), (1 - fraction, 1.0)):
            near, far = ((a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])) for s in (start, end))
            yield near, far


def _fold(crease: Crease, faces: dict[str, FlatFace]) -> Fold | None:
    """Return the fold of a crease in the flat piece; None if it is too short.

    It is the part that the edge of the parent face and the edge of the child face have in common.
    """
    start, end = faces[crease.parent.face].edges[crease.parent.index]
    child_start, child_end = faces[crease.child.face].edges[crease.child.index]
    length = math.dist(start, end)
    direction = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)

    def distance_along(point: Point) -> float:
        """Return the distance of a point from the start of the parent's edge, along this edge."""
        return (point[0] - start[0]) * direction[0] + (point[1] - start[1]) * direction[1]

    def point_at(distance: float) -> Point:
        return start[0] + distance * direction[0], start[1] + distance * direction[1]

    # The parent's edge reaches from 0 to its length. The edges run in opposite directions.
    child_low, child_high = sorted((distance_along(child_start), distance_along(child_end)))
    low, high = max(0.0, child_low), min(length, child_high)
    if high - low < MIN_SLIT_MM:
        return None
    kind: FoldKind = "valley" if crease.angle_rad > 0 else "mountain"
    if crease.flexure:
        kind = "flexure"
    return Fold(kind, point_at(low), point_at(high))


def _slits(outline: Polygon, faces: Sequence[FlatFace], folds: Sequence[Fold]) -> tuple[tuple[Point, ...], ...]:
    """Return the slits: lines where two faces touch without a fold between them."""
    edges = shapely.union_all([face.outline.exterior for face in faces], grid_size=GRID_MM)
    known_lines: Any = shapely.union_all([outline.boundary, *(LineString([f.a, f.b]) for f in folds)])
    uncovered = shapely.difference(edges, shapely.buffer(known_lines, 2 * STRAIGHT_MM, quad_segs=1))
    parts = shapely.get_parts(shapely.line_merge(uncovered))
    return tuple(tuple(part.coords) for part in parts if part.length > MIN_SLIT_MM)


def moved_to_origin(flat: FlatPiece) -> FlatPiece:
    """Return the piece with its lower left corner at the origin."""
    x0, y0, *_ = flat.outline.bounds
    result: FlatPiece = _shifted(flat, -x0, -y0)
    return result


def _shifted(value: Any, x: float, y: float) -> Any:
    """Return a copy of a flat piece, or of any value in it, in which all points are moved by (x, y).

    Points are also those in the containers, polygons, faces and folds of which the value consists. Other values, such as
    names, are returned unchanged.
    """
    match value:
        case (float(point_x), float(point_y)):
            return point_x + x, point_y + y
        case tuple():
            return tuple(_shifted(item, x, y) for item in value)
        case dict():
            return {key: _shifted(item, x, y) for key, item in value.items()}
        case Polygon():
            return shapely.affinity.translate(value, x, y)
        case FlatPiece() | FlatFace() | Fold():
            shifted_fields = {}
            for dataclass_field in fields(value):
                shifted_fields[dataclass_field.name] = _shifted(getattr(value, dataclass_field.name), x, y)
            return replace(value, **shifted_fields)
    return value


class OffsetEdge(NamedTuple):
    """An edge after it was moved: its ends, and its direction as a unit vector."""

    start: Point
    end: Point
    direction: Point


def offset_edges(outline_mm: Sequence[Point], inward_mm: Sequence[float]) -> list[list[Point]]:
    """Move the edges of a counter-clockwise outline inwards, and return the new points of each corner.

    Edge i leads from corner i to corner i + 1, and is moved by ``inward_mm[i]``. A corner's new point is the intersection
    of the lines of its two moved edges. Where two edges in a line are moved by different distances, there is no
    intersection. Then the corner has two points: the end of one edge and the start of the next.
    """
    next_corners = [*outline_mm[1:], outline_mm[0]]
    edges = []
    for corner, next_corner, distance_mm in zip(outline_mm, next_corners, inward_mm, strict=True):
        edges.append(_moved_edge(corner, next_corner, distance_mm))
    # The first corner lies between the last edge and the first one.
    return [_corner_points(edges[index - 1], after) for index, after in enumerate(edges)]


def _moved_edge(start: Point, end: Point, inward_mm: float) -> OffsetEdge:
    """Return the edge from ``start`` to ``end``, moved to its left, which is inwards."""
    (ax, ay), (bx, by) = start, end
    length = math.hypot(bx - ax, by - ay)
    direction_x, direction_y = (bx - ax) / length, (by - ay) / length
    # The direction turned by 90° counter-clockwise.
    shift_x, shift_y = -direction_y * inward_mm, direction_x * inward_mm
    return OffsetEdge(
        start=(ax + shift_x, ay + shift_y),
        end=(bx + shift_x, by + shift_y),
        direction=(direction_x, direction_y),
    )


def _corner_points(before: OffsetEdge, after: OffsetEdge) -> list[Point]:
    """Return the points of the corner between two edges: the intersection of their lines, or two points without one."""
    sine = _cross(before.direction, after.direction)
    if abs(sine) < PARALLEL:
        is_same_point = math.dist(before.end, after.start) < PARALLEL
        return [before.end] if is_same_point else [before.end, after.start]
    # The intersection is before.end + distance · before.direction. Its vector to after.start is parallel to
    # after.direction, so their cross product is 0. This is an equation for the distance.
    to_next_start = (after.start[0] - before.end[0], after.start[1] - before.end[1])
    distance = _cross(to_next_start, after.direction) / sine
    return [(before.end[0] + distance * before.direction[0], before.end[1] + distance * before.direction[1])]


def _cross(a: Point, b: Point) -> float:
    """Return the cross product of two vectors: the sine of their angle, if both are unit vectors."""
    return a[0] * b[1] - a[1] * b[0]
