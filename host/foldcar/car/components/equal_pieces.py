"""Merges equal pieces of a component to one piece with a count, and numbers the joins.

Input: pieces with their places, and joins that refer to pieces by index. Output: distinct pieces, their placed copies,
and joins that refer to distinct pieces by name.
"""

import re
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

from foldcar.car.folded.model import EdgeRef, Face, Join, JoinKind, Piece, PlacedPiece, Pose


class PieceEdge(NamedTuple):
    """An edge of a piece: the index of the piece, the name of the face and the index of the edge."""

    piece: int
    edge: EdgeRef


class IndexedJoin(NamedTuple):
    """A join of edges of two pieces. Joins with an equal ``seam`` get the same number."""

    seam: object
    kind: JoinKind
    a: PieceEdge
    b: PieceEdge
    length_mm: float
    slot: str | None = None


class Place(NamedTuple):
    """The body of a piece, and the pose of its root face in the component's frame."""

    body: str
    pose: Pose


def merge_equal_pieces(
    pieces: list[Piece], places: list[Place], indexed_joins: list[IndexedJoin]
) -> tuple[list[Piece], list[PlacedPiece], list[Join]]:
    """Merge equal pieces to one piece with a count; return the pieces, their placed copies, and the numbered joins.

    Pieces are merged only if all their joins are laminations onto others. ``places`` are those of the pieces. Joins are
    numbered from 1, and those of one seam share a number.
    """
    unmergeable = {join.b.piece for join in indexed_joins}
    unmergeable |= {join.a.piece for join in indexed_joins if join.kind != "laminate"}
    distinct: list[Piece] = []
    # The index of each piece among the distinct ones.
    distinct_index: list[int] = []
    index_by_content: dict[Piece, int] = {}
    for number, piece in enumerate(pieces):
        anonymous = replace(piece, faces=tuple(_without_names(face) for face in piece.faces))
        index = len(distinct) if number in unmergeable else index_by_content.setdefault(anonymous, len(distinct))
        if index < len(distinct):
            distinct[index] = replace(distinct[index], count=distinct[index].count + 1)
        else:
            distinct.append(piece)
        distinct_index.append(index)
    titles = numbered_titles([piece.label for piece in distinct])
    distinct = [replace(piece, name=title, label=title) for piece, title in zip(distinct, titles, strict=True)]
    placed_pieces, copies = [], Counter[int]()
    for index, place in zip(distinct_index, places, strict=True):
        placed_pieces.append(PlacedPiece(distinct[index].name, copies[index], place.body, place.pose))
        copies[index] += 1

    def renamed(end: PieceEdge) -> EdgeRef:
        """Return the edge with the name that its face has in the distinct piece; a merged piece has other names."""
        own_names = [face.name for face in pieces[end.piece].faces]
        kept_face = distinct[distinct_index[end.piece]].faces[own_names.index(end.edge.face)]
        return EdgeRef(kept_face.name, end.edge.index)

    joins: list[Join] = []
    numbers: dict[object, int] = {}
    for join in indexed_joins:
        name_a, name_b = (distinct[distinct_index[end.piece]].name for end in (join.a, join.b))
        # Laminations of all copies of a piece share a number.
        seam = name_a if join.kind == "laminate" else join.seam
        number = numbers.setdefault((join.kind, seam), len(numbers) + 1)
        joins.append(Join(
            number, join.kind, piece_a=name_a, a=renamed(join.a), piece_b=name_b, b=renamed(join.b),
            length_mm=join.length_mm, slot=join.slot,
        ))  # fmt: skip
    return distinct, placed_pieces, joins


def numbered_titles(labels: list[str]) -> list[str]:
    """Return the labels. To a label that occurs more than once, " 1", " 2", … are appended."""
    counts, seen = Counter(labels), Counter[str]()
    numbered = []
    for label in labels:
        seen[label] += 1
        numbered.append(f"{label} {seen[label]}" if counts[label] > 1 else label)
    return numbered


def _without_names(face: Face) -> Face:
    return replace(face, name="", holes=tuple(replace(hole, name=re.sub(r".*\.", "", hole.name)) for hole in face.holes))
