"""Merge equal pieces, name the pieces and number the joins.

Input: pieces, the (body, pose) of each one, joins with the indices of their two pieces. Output: each distinct piece
with its count, the poses of its copies, joins with piece names and numbers.
"""

import re
from collections import Counter
from dataclasses import replace

from foldcar.car.folded.model import EdgeRef, Face, Join, Piece, PlacedPiece, Pose


def counted(
    pieces: list[Piece], places: list[tuple[str, Pose]], joins: list[tuple[Join, int, int]]
) -> tuple[list[Piece], list[PlacedPiece], list[Join]]:
    """Distinct pieces with counts, their placed copies, and the joins.

    Only pieces that are laminated onto others and nothing else are merged; every other piece has its own name.
    """
    bound = {index for join, *pair in joins for index in pair if join.kind != "laminate"}
    bound |= {pair[1] for join, *pair in joins}
    kept: list[Piece] = []
    index_of: dict[int, int] = {}
    same: dict[Piece, int] = {}
    for i, piece in enumerate(pieces):
        anonymous = replace(piece, faces=tuple(_without_names(face) for face in piece.faces))
        if i not in bound and anonymous in same:
            index_of[i] = same[anonymous]
            kept[same[anonymous]] = replace(kept[same[anonymous]], count=kept[same[anonymous]].count + 1)
            continue
        if i not in bound:
            same[anonymous] = len(kept)
        index_of[i] = len(kept)
        kept.append(piece)
    names = titles([piece.label for piece in kept])
    kept = [replace(piece, name=title, label=title) for piece, title in zip(kept, names, strict=True)]
    placed, copies = [], dict[int, int]()
    for i, (body, pose) in enumerate(places):
        index = index_of[i]
        placed.append(PlacedPiece(kept[index].name, copies.get(index, 0), body, pose))
        copies[index] = copies.get(index, 0) + 1
    numbered: list[Join] = []
    numbers: dict[tuple[object, ...], int] = {}
    for join, a, b in joins:
        named = replace(
            join, piece_a=kept[index_of[a]].name, a=_same_face(join.a, pieces[a], kept[index_of[a]]),
            piece_b=kept[index_of[b]].name, b=_same_face(join.b, pieces[b], kept[index_of[b]]),
        )  # fmt: skip
        # Laminations of all copies of a piece share a number; numbers are consecutive from 1.
        key = ("laminate", named.piece_a) if join.kind == "laminate" else (join.kind, join.number)
        numbers.setdefault(key, len(numbers) + 1)
        numbered.append(replace(named, number=numbers[key]))
    return kept, placed, numbered


def _same_face(ref: EdgeRef, piece: Piece, copied: Piece) -> EdgeRef:
    """The edge of ``copied``, which equals ``piece``, that corresponds to the edge ``ref`` of ``piece``."""
    place = next(i for i, face in enumerate(piece.faces) if face.name == ref.face)
    return EdgeRef(copied.faces[place].name, ref.index)


def _without_names(face: Face) -> Face:
    return replace(face, name="", holes=tuple(replace(hole, name=re.sub(r".*\.", "", hole.name)) for hole in face.holes))


def titles(labels: list[str]) -> list[str]:
    """The labels; those that occur more than once get " 1", " 2", … appended."""
    counts = Counter(labels)
    seen: Counter[str] = Counter()
    numbered = []
    for label in labels:
        seen[label] += 1
        numbered.append(f"{label} {seen[label]}" if counts[label] > 1 else label)
    return numbered
