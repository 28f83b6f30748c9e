"""Positions of texts on flat pieces: joins' numbers beside both edges of every join, names in parts' outlines.

Input: a FlatPiece and joins. Output: EdgeMarks. The teeth of a rim share one number, which is written once on the disc
and once on the strip, not on a tooth.
"""

import math
from collections.abc import Iterable, Iterator

import shapely

from foldcar.car.folded.model import EdgeRef, Join
from foldcar.fabrication.patterns.drawing import Point
from foldcar.fabrication.patterns.flat_piece import FlatFace, FlatPiece
from foldcar.fabrication.patterns.labels import EdgeMark

Edge = tuple[Point, Point]
# At most this many of several suitable edges are tried.
PLACES = 8


def join_marks(piece: FlatPiece, joins: Iterable[Join]) -> Iterator[EdgeMark]:
    """The numbers of all joins of the piece, those that it was parted at first; the names of parts laid onto it."""
    yield from (EdgeMark(str(number), beside) for number, beside in piece.seams)
    faces = {face.name: face for face in piece.faces}
    seen: set[tuple[int, str]] = set()
    around: dict[tuple[int, bool], list[Edge]] = {}
    for join in joins:
        for name, ref, slot in ((join.piece_a, join.a, None), (join.piece_b, join.b, join.slot)):
            if name != piece.origin or ref.face not in faces:
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
