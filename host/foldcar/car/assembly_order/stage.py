"""Where everything stands while the folds of a car are partly closed.

Input: a FoldedCar and the fractions of its fold angles. Output: poses of faces and mounts in the car's frame. What is
fixed to a piece follows the face it is fixed to; the root of a beam stays where it is in the finished car.
"""

from collections.abc import Mapping

from foldcar.car.assembly_order.roles import Roles
from foldcar.car.folded.folding import edge
from foldcar.car.folded.model import Mount, Piece, PlacedPiece, Pose
from foldcar.car.folded.pose import IDENTITY, across_crease, compose, inverse

Folds = Mapping[str, Mapping[str, float]]


def partly_folded(piece: Piece, fractions: Mapping[str, float]) -> dict[str, Pose]:
    """The poses of a piece's faces in its root's frame; ``fractions`` of the angles by crease, 0 if not named."""
    faces = {face.name: face for face in piece.faces}
    poses = {piece.faces[0].name: IDENTITY}
    for crease in piece.creases:
        angle = crease.angle_rad * fractions.get(crease.name, 0.0)
        turn = across_crease(edge(faces, crease.parent), edge(faces, crease.child), angle)
        poses[crease.child.face] = compose(poses[crease.parent.face], turn)
    return poses


class Stage:
    """The car with its folds closed by fractions, by piece and crease."""

    def __init__(self, roles: Roles, folds: Folds) -> None:
        self.roles, self._folds = roles, folds
        self._local: dict[str, dict[str, Pose]] = {}

    def faces(self, one: PlacedPiece) -> dict[str, Pose]:
        """The poses of the faces of a copy of a piece."""
        root = compose(self._shift(self.roles.host(one)), one.pose)
        return {face: compose(root, pose) for face, pose in self._folded(one.piece).items()}

    def mount(self, mount: Mount) -> Pose:
        """The pose of a mount."""
        return compose(self._shift(self.roles.mount_host(mount)), mount.pose)

    def _folded(self, name: str) -> dict[str, Pose]:
        if name not in self._local:
            self._local[name] = partly_folded(self.roles.pieces[name], self._folds.get(name, {}))
        return self._local[name]

    def _shift(self, host: tuple[PlacedPiece, str] | None) -> Pose:
        """The motion of a face from its place in the finished car."""
        if host is None:
            return IDENTITY
        one, face = host
        above = self._shift(self.roles.host(one))
        now, then = self._folded(one.piece)[face], self.roles.finished[one.piece][face]
        if now == then:
            return above
        return compose(above, one.pose, now, inverse(then), inverse(one.pose))
