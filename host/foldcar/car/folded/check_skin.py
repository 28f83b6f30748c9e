"""Checks that the joined faces of a body leave no edge loose and enclose the designed volume.

Input: placed faces of one body and the car's joins. Output: findings and volumes. A body opens: its lid and what is
tucked into it need not be tight, but every edge must be folded, glued or tucked, but for those of notches.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from foldcar.car.folded.check_joins import CLOSURE_MM
from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import FoldedCar, Piece
from foldcar.car.folded.placed import PlacedFace

VOLUME_TOLERANCE = 1e-3


def check_skin(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], volumes_mm3: Mapping[str, float]
) -> Iterator[Finding]:
    """Findings for each body whose skin has a loose edge or, where ``volumes_mm3`` gives one, another volume."""
    for body, faces in bodies.items():
        # Wheels are open.
        if body.startswith("wheel"):
            continue
        skin = skin_of(car, faces)
        if not skin:
            yield Finding("skin", body, "has no faces that are glued to a skin")
            continue
        loose = _loose_edges(car, skin, faces)
        for face, index in loose[:3]:
            more = f" (and {len(loose) - 3} more)" if len(loose) > 3 else ""
            yield Finding("skin", f"{body}: {face.title}", f"edge {index} meets no other face{more}")
        volume = volume_mm3(skin)
        expected = volumes_mm3.get(body)
        if expected is not None and abs(volume - expected) > VOLUME_TOLERANCE * expected:
            yield Finding(
                "volume",
                body,
                f"encloses {volume:.0f} mm³ instead of {expected:.0f}, the limit is {VOLUME_TOLERANCE:.1%}",
            )


def skin_of(car: FoldedCar, faces: Sequence[PlacedFace]) -> list[PlacedFace]:
    """The panels of the pieces that tabs join, without those that hang inside on one fold, as a lid's flap.

    Laminated or inserted pieces are not part of the skin.
    """
    tabbed = {name for join in car.joins if join.kind in ("tab", "lap") for name in (join.piece_a, join.piece_b)}
    joined = {(piece, face) for piece, face, _ in _joined_edges(car)}
    return [
        face
        for face in faces
        if face.piece.name in tabbed
        and face.face.role != "tab"
        and ((face.piece.name, face.face.name) in joined or _folds(face.piece, face.face.name) != 1)
    ]


def volume_mm3(skin: Sequence[PlacedFace]) -> float:
    """The volume (mm³) of the convex hull of the faces: what a body, which is convex, encloses; 0 without faces."""
    if not skin:
        return 0.0
    return float(ConvexHull(np.concatenate([face.corners_mm for face in skin])).volume)


def _folds(piece: Piece, face: str) -> int:
    """The number of folds between a face and faces other than tabs."""
    tabs = {one.name for one in piece.faces if one.role == "tab"}
    ends = ({crease.parent.face, crease.child.face} for crease in piece.creases)
    return sum(face in pair and not pair & tabs for pair in ends)


def _joined_edges(car: FoldedCar) -> Iterator[tuple[str, str, int]]:
    """Edges that a tab is glued along, or that are tucked: (piece, face, index)."""
    for join in car.joins:
        if join.kind in ("tab", "tuck"):
            yield join.piece_b, join.b.face, join.b.index
        if join.kind == "tuck":
            yield join.piece_a, join.a.face, join.a.index


def _loose_edges(
    car: FoldedCar, skin: Sequence[PlacedFace], faces: Sequence[PlacedFace]
) -> list[tuple[PlacedFace, int]]:
    """Edges of the skin that are not joined and do not coincide with an edge of another face.

    Edges off the convex hull of their face are those of a notch, which is open like a hole.
    """
    held = set(_joined_edges(car))
    owners = [(face, i) for face in skin for i in range(len(face.face.outline_mm))]
    starts, ends = _edges(skin)
    other_starts, other_ends = _edges(faces)
    forward, backward = np.hstack([starts, ends]), np.hstack([other_ends, other_starts])
    loose = []
    hulls = {id(face): shapely.Polygon(face.face.outline_mm).convex_hull.exterior for face in skin}
    for (face, index), edge in zip(owners, forward, strict=True):
        if (face.piece.name, face.face.name, index) in held:
            continue
        outline = face.face.outline_mm
        side = shapely.LineString((outline[index], outline[(index + 1) % len(outline)]))
        if hulls[id(face)].distance(side.centroid) > CLOSURE_MM:
            continue
        if not (np.abs(backward - edge).max(axis=1) <= CLOSURE_MM).any():
            loose.append((face, index))
    return loose


def _edges(faces: Sequence[PlacedFace]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Starts and ends of all edges, each (n, 3) in mm."""
    starts = np.concatenate([face.corners_mm for face in faces])
    ends = np.concatenate([np.roll(face.corners_mm, -1, axis=0) for face in faces])
    return starts, ends
