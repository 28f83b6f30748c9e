"""The car between two steps of its assembly: closed folds, parts in place, and poses.

Input: a FoldedCar and the steps so far. Output: poses and Shapes in the car's frame.
"""

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.folded.pose import apply
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.scene import Stage
from foldcar.car.proof.step import Added, AssemblyStep, Folds
from foldcar.fabrication.assembly.faces import Matrix
from foldcar.fabrication.assembly.facets import Shape, film_shape, mount_shape
from foldcar.fabrication.assembly.hidden_surfaces import Vector

Part = PlacedPiece | Mount


class State:
    """The car after some steps; ``apply_step`` adds a step. ``before`` is the stage before the last step."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.roles = car, roles_of(car)
        self.pieces, self.mounts = self.roles.pieces, self.roles.mounts
        self.stage = self.before = Stage(self.roles, {})
        self.in_place: list[Part] = []
        self._units: dict[tuple[str, str], list[Part]] = {}
        self._shapes: dict[object, Shape] = {}

    def close(self, folds: Folds) -> None:
        """Close folds by fractions, by piece and crease."""
        self.before, self.stage = self.stage, self.stage.closed(folds)

    @property
    def closed(self) -> Folds:
        """The folds that are closed now."""
        return self.stage.folds

    def apply_step(self, step: AssemblyStep) -> None:
        """Advance to the state after ``step``. Parts of a unit come into the car with the unit."""
        self.close(step.folds)
        for added in step.adds:
            if step.unit:
                self._units.setdefault((step.unit, added.body), []).extend(self.parts(added))
            else:
                self.in_place.extend(self.parts(added))

    def parts(self, added: Added) -> list[Part]:
        """Return the copies of pieces and the mounts that come in with ``added``."""
        if added.kind == "unit":
            return list(self._units.get((added.name, added.body), []))
        if added.kind == "mount":
            return [self.mounts[added.name]]
        return [p for p in self.car.placed if (p.piece, p.copy) == (added.name, added.copy)]

    def unit_bodies(self, name: str) -> list[str]:
        """Return the bodies that have a unit of that name, in the order in which they were begun."""
        return [body for unit, body in self._units if unit == name]

    def unit(self, name: str, body: str) -> list[Part]:
        """Return the parts of a unit so far."""
        return list(self._units.get((name, body), []))

    def face_centres(self, placed: PlacedPiece, stage: Stage) -> dict[str, Vector]:
        """Return the middle of each face of a copy at a stage, (3,) in mm."""
        poses = stage.faces(placed)
        middles = {face.name: np.mean(face.outline_mm, axis=0) for face in self.pieces[placed.piece].faces}
        return {name: np.array(apply(poses[name], *middle)) for name, middle in middles.items()}

    def pose(self, part: Part) -> Matrix:
        """Return the pose of a mount, or of a piece's root face."""
        return np.array(self.stage.mount(part) if isinstance(part, Mount) else self.stage.root(part))

    def shape(self, part: Part, shift: Vector | None = None, creases: bool = False) -> Shape:
        """Return a part as it is now, moved by ``shift`` (mm); ``creases`` does not matter for a mount."""
        pose = self.pose(part)
        if shift is not None:
            pose[:3, 3] += shift
        folds = {} if isinstance(part, Mount) else self.closed.get(part.piece, {})
        # Most parts stay as they are from step to step.
        cache_key = part, pose.tobytes(), tuple(folds.items()), creases
        if cache_key not in self._shapes:
            self._shapes[cache_key] = (
                mount_shape(part, pose)
                if isinstance(part, Mount)
                else film_shape(self.pieces[part.piece], pose, folds, key(part), creases=creases)
            )
        return self._shapes[cache_key]


def key(placed: PlacedPiece) -> str:
    """The prefix of the keys of a copy's facets."""
    return f"{placed.piece} {placed.copy} "
