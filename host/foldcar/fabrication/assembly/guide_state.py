"""The car between two steps of its assembly: closed folds, parts in place, and poses.

Input: a FoldedCar and the steps so far. Output: poses and Shapes in the car's frame.
"""

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.folded.pose import apply
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.scene import Stage
from foldcar.car.proof.step import AddedPart, AssemblyStep, Folds
from foldcar.fabrication.assembly.faces import Matrix
from foldcar.fabrication.assembly.facets import PictureContent, film_shape, mount_shape
from foldcar.fabrication.assembly.hidden_surfaces import Vector

Part = PlacedPiece | Mount


class AssemblyState:
    """The car after some steps of its assembly.

    At first it is the car before the first step; ``advance`` goes one step on.

    ``previous_stage`` has the folds before the last step. ``_units`` has the parts of each unit, by (unit, body); a
    unit, such as a wheel, is put together outside the car.
    """

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.roles = car, roles_of(car)
        self.pieces, self.mounts = self.roles.pieces, self.roles.mounts
        self.stage = self.previous_stage = Stage(self.roles, {})
        self.in_place: list[Part] = []
        self._units: dict[tuple[str, str], list[Part]] = {}
        self._shapes: dict[object, PictureContent] = {}

    def close_folds(self, folds: Folds) -> None:
        """Close folds. ``folds`` has the fraction to which each is closed, by piece and crease."""
        self.previous_stage, self.stage = self.stage, self.stage.closed(folds)

    @property
    def fold_fractions(self) -> Folds:
        """The fraction to which each crease is folded now, by piece and crease."""
        return self.stage.folds

    def advance(self, step: AssemblyStep) -> None:
        """Fold the step's creases, and add its parts to its unit or, in a step without a unit, to the car."""
        self.close_folds(step.folds)
        for added in step.adds:
            target = self._units.setdefault((step.unit, added.body), []) if step.unit else self.in_place
            target.extend(self.parts_of(added))

    def parts_of(self, added: AddedPart) -> list[Part]:
        """Return the parts that ``added`` brings in: those of a unit, a mount, or the copy of a piece."""
        if added.kind == "unit":
            return list(self._units.get((added.name, added.body), []))
        if added.kind == "mount":
            return [self.mounts[added.name]]
        return [p for p in self.car.placed if (p.piece, p.copy) == (added.name, added.copy)]

    def unit_bodies(self, name: str) -> list[str]:
        """Return the bodies (such as wheels) that have a unit of that name, in the order of their first parts."""
        return [body for unit, body in self._units if unit == name]

    def unit_parts(self, name: str, body: str) -> list[Part]:
        """Return the parts that the unit of a body has so far."""
        return list(self._units.get((name, body), []))

    def face_centres(self, placed: PlacedPiece, stage: Stage) -> dict[str, Vector]:
        """Return the centre of each face of a copy at a stage of folding: (3,) in the car's frame (mm), by face."""
        poses = stage.faces(placed)
        centres_mm = {face.name: np.mean(face.outline_mm, axis=0) for face in self.pieces[placed.piece].faces}
        return {name: np.array(apply(poses[name], *centre_mm)) for name, centre_mm in centres_mm.items()}

    def pose(self, part: Part) -> Matrix:
        """Return the pose of a mount, or of a piece's root face."""
        return np.array(self.stage.mount(part) if isinstance(part, Mount) else self.stage.root(part))

    def shape(self, part: Part, shift_mm: Vector | None = None, creases: bool = False) -> PictureContent:
        """Return a part's facets and lines as it is folded now, moved by ``shift_mm`` (3,).

        With ``creases`` the folds of a piece are drawn as folds, else as edges.
        """
        pose = self.pose(part)
        if shift_mm is not None:
            pose[:3, 3] += shift_mm
        folds = {} if isinstance(part, Mount) else self.fold_fractions.get(part.piece, {})
        # Cached, because most parts stay as they are from step to step.
        cache_key = part, pose.tobytes(), tuple(folds.items()), creases
        if cache_key not in self._shapes:
            self._shapes[cache_key] = (
                mount_shape(part, pose)
                if isinstance(part, Mount)
                else film_shape(self.pieces[part.piece], pose, folds, facet_key_prefix(part), creases=creases)
            )
        return self._shapes[cache_key]


def facet_key_prefix(placed: PlacedPiece) -> str:
    """Return the prefix of the keys of the facets of one copy of a piece."""
    return f"{placed.piece} {placed.copy} "
