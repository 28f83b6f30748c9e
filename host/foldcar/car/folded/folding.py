"""The poses of a piece's faces: flat, folded or in between.

Input: a piece and the fraction of its fold angles, from 0 (the flat layout) to 1 (assembled). Output: poses by face
name, in the frame of the piece's first face.
"""

from collections.abc import Mapping

from foldcar.car.folded.model import EdgeRef, Face, Piece, Point, Pose
from foldcar.car.folded.pose import IDENTITY, across_crease, compose


def folded(piece: Piece, fraction: float = 1.0, flexures_rad: Mapping[str, float] | None = None) -> dict[str, Pose]:
    """The poses of all faces by name; ``flexures_rad`` overrides the assembled angles of flexures, by crease name."""
    faces = {face.name: face for face in piece.faces}
    poses = {piece.faces[0].name: IDENTITY}
    for crease in piece.creases:
        angle = crease.angle_rad * fraction
        if flexures_rad and crease.flexure and crease.name in flexures_rad:
            angle = flexures_rad[crease.name]
        parent, child = edge(faces, crease.parent), edge(faces, crease.child)
        poses[crease.child.face] = compose(poses[crease.parent.face], across_crease(parent, child, angle))
    return poses


def edge(faces: Mapping[str, Face], reference: EdgeRef) -> tuple[Point, Point]:
    """The ends of an edge (mm) in its face's frame."""
    outline = faces[reference.face].outline_mm
    return outline[reference.index], outline[(reference.index + 1) % len(outline)]
