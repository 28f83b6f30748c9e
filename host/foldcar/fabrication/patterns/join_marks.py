"""Positions of texts on flat pieces: joins' numbers beside both edges of every join, names in parts' outlines.

Input: a FlatPiece and its FoldedCar. Output: EdgeMarks. The teeth of a rim share one number, which is written once on
the disc and once on the strip, not on a tooth. Where layers are laid onto a face, each place has the number.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from foldcar.car.folded.model import EdgeRef, FoldedCar, Join
from foldcar.car.folded.placed import place
from foldcar.fabrication.patterns.drawing import Point
from foldcar.fabrication.patterns.flat_piece import FlatFace, FlatPiece
from foldcar.fabrication.patterns.labels import EdgeMark

Edge = tuple[Point, Point]
# At most this many of several suitable edges are tried.
PLACES = 8
# How far above or below a face layers of film and tape lie at most.
LAYERS_MM = 3.0
# What the name of a part of a piece has between the piece's and its number.
PART = ", part "


def join_marks(piece: FlatPiece, car: FoldedCar, whole: FoldedCar) -> Iterator[EdgeMark]:
    """The numbers of all joins of the piece, those that it was parted at first; the names of parts laid onto it.

    ``car`` has pieces parted to fit the sheets, ``whole`` has them whole, as they are placed in the car.
    """
    yield from (EdgeMark(str(number), beside) for number, beside in piece.seams)
    faces = {face.name: face for face in piece.faces}
    seen: set[tuple[int, str]] = set()
    around: dict[tuple[int, bool], list[Edge]] = {}
    for join in car.joins:
        for name, ref, slot in ((join.piece_a, join.a, None), (join.piece_b, join.b, join.slot)):
            if name != piece.origin or ref.face not in faces:
                continue
            if join.kind == "laminate" and ref is join.b:
                if (join.number, ref.face) not in seen:
                    yield from (EdgeMark(str(join.number), edges) for edges in _under(faces[ref.face], join, whole))
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


def _under(face: FlatFace, join: Join, whole: FoldedCar) -> Iterator[tuple[Edge, ...]]:
    """For each layer that a join lays on a face: the edges of the opening that it surrounds, or of its own outline."""
    above, below = (name.partition(PART)[0] for name in (join.piece_a, join.piece_b))
    piece = next(one for one in whole.pieces if one.name == below)
    outline = next(one for one in piece.faces if one.name == face.name).outline_mm
    pairs = [((outline[i], outline[(i + 1) % len(outline)]), edge) for i, edge in face.edges.items() if i < len(outline)]
    # From the face's frame to the flat one, by its longest edge that is whole; a bend shortens one by less than 1 mm.
    kept = [pair for pair in pairs if abs(math.dist(*pair[0]) - math.dist(*pair[1])) < 1.0]
    if not kept:
        yield tuple(_edges(face, join.b, join, None))
        return
    (a, b), (to_a, to_b) = (
        (complex(*edge[0]), complex(*edge[1])) for edge in max(kept, key=lambda pair: math.dist(*pair[0]))
    )
    turn = (to_b - to_a) / (b - a)
    turn /= abs(turn)
    for layer in _layers(whole, above, join.a.face, below, face.name):
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
    """The outlines of what lies on a face, of one joined face and its like, in the face's frame (mm), each place once."""
    placed = [face for faces in place(car).values() for face in faces if face.piece.name in (piece_a, piece_b)]
    below = next(one for one in placed if (one.piece.name, one.face.name) == (piece_b, face_b))
    alike = {join.a.face for join in car.joins if (join.piece_a, join.kind) == (piece_a, "laminate")} | {face_a}
    found: dict[tuple[int, int], shapely.Polygon] = {}
    for one in placed:
        if one.piece.name != piece_a or one.face.name not in alike:
            continue
        points = below.in_face(one.corners_mm)
        area = shapely.Polygon(points[:, :2])
        if np.abs(points[:, 2]).max() < LAYERS_MM and below.polygon.envelope.intersection(area).area > 1.0:
            found.setdefault((round(area.centroid.x), round(area.centroid.y)), area)
    return tuple(found.values())


def _edges(face: FlatFace, ref: EdgeRef, join: Join, slot: str | None) -> list[Edge]:
    """The edges beside which the number may be written, with the film on their left."""
    if slot is not None and slot in face.holes:
        return list(face.holes[slot])
    if join.kind == "laminate":
        # Doublings are aligned by their holes.
        edges = [edge for ring in face.holes.values() for edge in ring] or list(face.edges.values())
        return sorted(edges, key=_slant)[:PLACES]
    if ref.index not in face.edges:
        return []
    a, b = face.edges[ref.index]
    return [(b, a)] if join.kind == "rim" and face.role == "tab" else [(a, b)]


def _slant(edge: Edge) -> float:
    """Deviation from the x and y directions: beside an edge along one of them (0) numbers are easiest to read."""
    (ax, ay), (bx, by) = edge
    return round(min(abs(bx - ax), abs(by - ay)) / (abs(bx - ax) + abs(by - ay)), 3)
