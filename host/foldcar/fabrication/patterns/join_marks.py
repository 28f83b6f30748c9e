"""Finds what is to be written on a piece, and beside which of its edges: join numbers, and names of parts laid onto it.

Input: a FlatPiece and its FoldedCar, split to fit the sheets and whole. Output: EdgeMarks, which labels.py places. A join
has its number beside both edges; the teeth of a rim share one, which is written once on the disc and once on the strip.
Where layers are laid onto a face, each place has the number.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from foldcar.car.folded.model import FoldedCar, Join
from foldcar.car.folded.placed import placed_faces
from foldcar.fabrication.patterns.drawing import Point
from foldcar.fabrication.patterns.flat_piece import Edge, FlatFace, FlatPiece
from foldcar.fabrication.patterns.labels import EdgeMark

# At most this many of several suitable edges are tried.
PLACES = 8
# A layer covers a face if they have more in common than this. Edges of holes may lie this far outside of a layer, and a
# bend shortens an edge by less than this.
COMMON_MM2 = 1.0
AROUND_LAYER_MM = 1.0
SHORTENED_MM = 1.0
# Maximum distance of layers of film and tape from the face they are glued to.
LAYERS_MM = 3.0
# The text between a piece's name and the number of its part.
PART = ", part "


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
    ``unsplit_car`` is the car whose pieces were not split to fit the sheets.
    """
    # Where layers lie is known for whole pieces. But this piece and its face may be parts of a whole piece and its face.
    # The name of a part is that of the whole piece with a number.
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
        edges = _hole_edges_within(face, covered.buffer(AROUND_LAYER_MM))
        if not edges:
            corners = [(x, y) for x, y in shapely.geometry.polygon.orient(covered).exterior.coords]
            edges = list(pairwise(corners))
        # Numbers are easy to read beside edges along x or y, so these come first.
        yield tuple(sorted(edges, key=_slant)[:PLACES])


def _hole_edges_within(face: FlatFace, area: shapely.Polygon) -> list[Edge]:
    """Return the edges of a face's holes that lie within an area."""
    edges = []
    for hole in face.holes.values():
        for edge in hole:
            if area.covers(shapely.LineString(edge)):
                edges.append(edge)
    return edges


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
    """Return the outlines (mm) of the layers of film that are glued onto a face, in the frame of that face.

    The face is ``host_face`` of the piece ``host_piece``. The layers are faces of ``layer_piece``: ``layer_face``, and
    others that are laminated onto something. Layers on top of each other, at the same place, are returned once.
    """
    # All faces of the car, where they are in the folded car.
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
        # The corners in the frame of the host's face, whose third axis is at right angles to the face.
        corners = host.in_face(face.corners_mm)
        outline = shapely.Polygon(corners[:, :2])
        # A face of the layer's piece is on the host's face if it is near its plane and covers some of it.
        is_near = np.abs(corners[:, 2]).max() < LAYERS_MM
        common_mm2 = host.polygon.envelope.intersection(outline).area
        if is_near and common_mm2 > COMMON_MM2:
            middle = (round(outline.centroid.x), round(outline.centroid.y))
            outlines.setdefault(middle, outline)
    return tuple(outlines.values())


def _edges(face: FlatFace, join: Join, is_a: bool) -> list[Edge]:
    """Return the edges of a face beside which the number of a join may be written; the number stands on their left.

    ``is_a`` is whether the end ``a`` of the join is on the face, and not its end ``b``. Usually there is one edge, which
    is joined. The number of a tongue's slot stands beside the edges of the slot, and that of two layers of film beside
    several edges.
    """
    if not is_a and join.slot is not None and join.slot in face.holes:
        return list(face.holes[join.slot])
    if join.kind == "laminate":
        # Layers are aligned by their holes, so their edges are best. Numbers beside edges along x or y are easy to read.
        hole_edges = [edge for ring in face.holes.values() for edge in ring]
        edges = hole_edges or list(face.edges.values())
        return sorted(edges, key=_slant)[:PLACES]
    index = join.a.index if is_a else join.b.index
    if index not in face.edges:
        return []
    start, end = face.edges[index]
    # A rim is the strip around a wheel. Its tabs are so narrow that their number is written on the face beside them. This
    # face is on the other side of the edge.
    if join.kind == "rim" and face.role == "tab":
        return [(end, start)]
    return [(start, end)]


def _slant(edge: Edge) -> float:
    """Return how much an edge deviates from the directions x and y; 0 for an edge along x or y.

    Numbers beside an edge with a small slant are easy to read.
    """
    (ax, ay), (bx, by) = edge
    return round(min(abs(bx - ax), abs(by - ay)) / (abs(bx - ax) + abs(by - ay)), 3)
