"""A car's real shape for pages on which it drives: the faces of its film as they are folded, bought parts as solids.

Input: FoldedCars. Output: JSON that ``car.js`` reads: outlines in tenths of a millimetre, solids and poses in
millimetres. Small holes and parts, such as screws, are left out; hinges are flat.
"""

import json
from collections.abc import Sequence
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


class SceneShapes:
    """Shapes of cars that share their ``pieces``: each is there once, ``{"faces"}`` or ``{"solids"}`` in its frame.

    A face is a list of rings, the outline before its holes: x, y, z of its points one after the other. A solid is
    ``{"kind", "size", "pose"}``, a pose the first three rows of its matrix.
    """

    def __init__(self) -> None:
        self.pieces: list[dict[str, Any]] = []
        self._numbers: dict[str, int] = {}
        self._film: dict[Piece, int] = {}

    def add(self, folded: FoldedCar) -> list[dict[str, Any]]:
        """The parts of a car: ``{"piece": its number, "body", "pose"}``, of a hinge's strip ``"beyond"``, too.

        That is the body of each face by its number where it is another one.
        """
        pieces, parts = {piece.name: piece for piece in folded.pieces}, []
        for placed in folded.placed:
            piece = pieces[placed.piece]
            part = {"piece": self._faces(piece), "body": placed.body, "pose": _rows(np.array(placed.pose))}
            beyond = _beyond_hinge(folded, placed, piece)
            if beyond:
                part["beyond"] = {k: beyond[face.name] for k, face in enumerate(piece.faces) if face.name in beyond}
            parts.append(part)
        for mount in folded.mounts:
            solids = _solids(mount)
            if solids:
                number = self._number({"material": mount_material(mount), "solids": solids})
                parts.append({"piece": number, "body": mount.body, "pose": _rows(np.array(mount.pose))})
        return parts

    def _faces(self, piece: Piece) -> int:
        if piece not in self._film:
            plain, poses, faces = without_small_holes(piece), face_poses(piece), []
            for face in plain.faces:
                rings = [face.outline_mm, *(hole.outline_mm for hole in face.holes)]
                points = [moved(poses[face.name], np.array(ring)) / UNIT_MM for ring in rings]
                faces.append([np.rint(one).astype(int).ravel().tolist() for one in points])
            self._film[piece] = self._number({"faces": faces})
        return self._film[piece]

    def _number(self, piece: dict[str, Any]) -> int:
        text = json.dumps(piece)
        if text not in self._numbers:
            self._numbers[text] = len(self.pieces)
            self.pieces.append(piece)
        return self._numbers[text]


def _rows(pose: Any) -> list[float]:
    found: list[float] = np.round(pose[:3], DECIMALS).ravel().tolist()
    return found


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
    shapes = [(one.kind, one.size_mm, np.array(one.pose)) for one in mount.solids]
    if not shapes or len(shapes) > MOST_SOLIDS:
        return [{"kind": "ring" if shapes else "box", "size": _sides(mount.size_mm), "pose": _rows(np.eye(4))}]
    return [
        {"kind": kind, "size": _sides(size), "pose": _rows(pose)}
        for kind, size, pose in shapes
        if sorted(size)[1] >= LEAST_SOLID_MM
    ]


def _sides(size_mm: Sequence[float]) -> list[float]:
    return [round(float(side), 2) for side in size_mm]
