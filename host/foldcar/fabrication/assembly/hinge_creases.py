"""Which crease of film bends when a hinge does, and which way.

Input: a FoldedCar. Output: for each copy of a piece with a flexure the hinge's index, and the sign of the crease's angle
for a positive one.
"""

from dataclasses import dataclass

import numpy as np

from foldcar.car.folded.model import FoldedCar, PlacedPiece
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.poses import face_poses, moved


@dataclass(frozen=True)
class HingeCrease:
    """The crease before face number ``face`` has ``sign`` times the angle (rad) of that ``hinge``, counted from 0."""

    face: int
    hinge: int
    sign: int


def hinge_crease(car: FoldedCar, placed: PlacedPiece) -> HingeCrease | None:
    """The flexure of that copy of a piece, or None."""
    piece = next(piece for piece in car.pieces if piece.name == placed.piece)
    crease = next((crease for crease in piece.creases if crease.flexure), None)
    if crease is None or not car.hinges:
        return None
    faces = {face.name: face for face in piece.faces}
    pose = np.array(placed.pose) @ face_poses(piece)[crease.parent.face]
    middle = moved(pose, np.array([np.mean(edge(faces, crease.parent), axis=0)]))[0]
    distances = [float(np.linalg.norm(middle - hinge.center_mm)) for hinge in car.hinges]
    # A positive angle of a crease lifts the child over the parent's printed side; one of a hinge lifts what is beyond it
    # in the car: the front by its nose, the rear by its tail.
    sign = 1 if pose[2, 2] > 0 else -1
    number = [face.name for face in piece.faces].index(crease.child.face)
    return HingeCrease(number, distances.index(min(distances)), sign)
