"""A car's real shape for pages on which it drives: the faces of its film as they are folded, bought parts as solids.

Input: a FoldedCar. Output: JSON that ``car.js`` reads: outlines in tenths of a millimetre in the car's frame, solids in
millimetres. Small holes and parts, such as screws, are left out; hinges are flat.
"""

from typing import Any

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, Piece, PlacedPiece
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.shape_files import without_small_holes
from foldcar.fabrication.assembly.solids import face_poses, mount_material, moved

UNIT_MM = 0.1
# Parts with no side as long are not seen on a car that drives, and neither are solids of parts that are as thin.
LEAST_PART_MM = 9.0
LEAST_SOLID_MM = 3.0
# A ring of more solids is meant to be round.
MOST_SOLIDS = 12
DECIMALS = 3


def scene_shape(folded: FoldedCar) -> dict[str, Any]:
    """``{"faces": [{"body", "rings"}], "solids": [{"body", "material", "kind", "size", "pose"}]}``.

    A ring is x, y, z of its points one after the other, the outline before its holes; a pose is the first three rows of
    its matrix.
    """
    pieces = {piece.name: without_small_holes(piece) for piece in folded.pieces}
    poses = {name: face_poses(piece) for name, piece in pieces.items()}
    faces = []
    for placed in folded.placed:
        pose, beyond = np.array(placed.pose), _beyond_hinge(folded, placed, pieces[placed.piece])
        for face in pieces[placed.piece].faces:
            place = pose @ poses[placed.piece][face.name]
            rings = [face.outline_mm, *(hole.outline_mm for hole in face.holes)]
            points = [np.rint(moved(place, np.array(ring)) / UNIT_MM).astype(int).ravel().tolist() for ring in rings]
            faces.append({"body": beyond.get(face.name, placed.body), "rings": points})
    return {"faces": faces, "solids": [one for mount in folded.mounts for one in _solids(mount)]}


def _beyond_hinge(folded: FoldedCar, placed: PlacedPiece, piece: Piece) -> dict[str, str]:
    """The faces of a hinge's strip, by name, that move with the segment at its other end."""
    crease = next((crease for crease in piece.creases if crease.flexure), None)
    if crease is None or not folded.hinges:
        return {}
    faces = {face.name: face for face in piece.faces}
    place = np.array(placed.pose) @ face_poses(piece)[crease.parent.face]
    (middle,) = moved(place, np.array([np.mean(edge(faces, crease.parent), axis=0)]))
    hinge = min(folded.hinges, key=lambda one: float(np.linalg.norm(middle - one.center_mm)))
    found = {crease.child.face: hinge.rear if placed.body == hinge.front else hinge.front}
    # Creases stand in the order from the root: each parent is placed before its children.
    for other in piece.creases:
        if other.parent.face in found:
            found[other.child.face] = found[other.parent.face]
    return found


def _solids(mount: Mount) -> list[dict[str, Any]]:
    if max(mount.size_mm) < LEAST_PART_MM:
        return []
    own = np.array(mount.pose)
    shapes: list[tuple[str, tuple[float, ...], Any]]
    shapes = [(one.kind, one.size_mm, own @ np.array(one.pose)) for one in mount.solids]
    if not shapes or len(shapes) > MOST_SOLIDS:
        shapes = [("ring" if shapes else "box", mount.size_mm, own)]
    material = mount_material(mount)
    return [
        {
            "body": mount.body,
            "material": material,
            "kind": kind,
            "size": [round(float(side), 2) for side in size],
            "pose": np.round(pose[:3], DECIMALS).ravel().tolist(),
        }
        for kind, size, pose in shapes
        if sorted(size)[1] >= LEAST_SOLID_MM
    ]
