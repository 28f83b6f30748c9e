"""What one picture of a step shows: the car so far, what goes in apart from its place, arrows along the ways.

Input: a step and the State after it. Output: a Shape, the keys of what was there, arrows, join numbers. Parts that come
from one side onto each other stand apart in a row, in the order of the step; a nut stands on its own side.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from foldcar.car.folded.model import Mount, PlacedPiece
from foldcar.car.parts.mechanics import Screw, Spacer
from foldcar.car.proof.step import Added, AssemblyStep
from foldcar.fabrication.assembly.drawing import Arrow, Mark
from foldcar.fabrication.assembly.facets import Shape, shank_and_nut, together
from foldcar.fabrication.assembly.guide_state import Part, State, key
from foldcar.fabrication.assembly.hidden_surfaces import Camera, Vector
from foldcar.fabrication.assembly.join_marks import join_marks
from foldcar.fabrication.assembly.operations import is_screw, is_wound

# How far parts stand apart from their places along each move of their way: at most, at least, and their size's share.
APART_MM, LEAST_APART_MM, APART_SHARE = 62.0, 24.0, 0.4
SCREW_APART_MM, STRIP_APART_MM = 22.0, 26.0
# Directions are alike from this cosine on.
ALIKE, BEHIND = 0.9, 0.35
# A direction's component below this is across it.
ACROSS = 0.5
# Smaller parts, screws and spacers, do not choose the camera. A fold that moves a face by less has no arrow.
SMALL_MM, MOVED_MM = 14.0, 20.0
FOLD_ARROWS = 2


@dataclass(frozen=True)
class _Apart:
    """What stands apart: the box of its corners in place (2, 3), its direction out and the whole of its shift (mm)."""

    box_mm: Vector
    out: Vector
    shift_mm: Vector


class Scene:
    """``shape``, ``faded`` keys, ``arrows`` and ``marks`` of a step; ``from_`` are directions that large parts come from.

    ``outward`` is the direction away from the car, if the step puts a wheel together.
    """

    def __init__(self, step: AssemblyStep, state: State) -> None:
        self.step, self.state = step, state
        body = state.unit_bodies(step.unit)[0] if step.unit else ""
        axle = next((axle for axle in state.car.axles if axle.wheel == body), None)
        self.axle_mm = None if axle is None else np.array(axle.center_mm)
        self.outward = None if axle is None else np.array([0.0, 1.0 if axle.side == "left" else -1.0, 0.0])
        self.from_: list[Vector] = []
        self.arrows: list[Arrow] = []
        self.marks: list[Mark] = []
        self._apart: list[_Apart] = []
        shown = [added for added in step.adds if not step.unit or added.body == body]
        new = {id(part) for added in shown for part in state.parts(added)}
        there = [part for part in (state.unit(step.unit, body) if step.unit else state.there) if id(part) not in new]
        folded = [part for part in there if isinstance(part, PlacedPiece) and part.piece in step.folds]
        old = [state.shape(part) for part in there if part not in folded and not tiny(state, part)]
        self.faded = {facet.key for shape in old for facet in shape.facets}
        fresh = [state.shape(part, creases=True) for part in folded]
        for part in folded:
            self._mark(part, np.zeros(3))
            if not step.adds:
                self._fold_arrows(part)
        for added in shown:
            fresh += self._added(added)
        self.shape = together([*old, *fresh])

    def arrows_in(self, view: Camera) -> list[Arrow]:
        """The arrows of what comes towards the car from the camera's side, or across."""
        ways = [(one, one.points_mm[0] - one.points_mm[-1]) for one in self.arrows]
        return [one for one, way in ways if way @ view.toward > -BEHIND * np.linalg.norm(way)]

    def _added(self, added: Added) -> list[Shape]:
        """What comes in with ``added``, apart from its place."""
        parts = self.state.parts(added)
        if added.nut_mm:
            (screw,) = parts
            assert isinstance(screw, Mount)
            shank, nut = shank_and_nut(screw)
            return [*self._come(added, [shank]), *self._come(replace(added, way_mm=added.nut_mm[-1:]), [nut])]
        return self._come(added, parts)

    def _come(self, added: Added, parts: Sequence[Part]) -> list[Shape]:
        in_place = points([self.state.shape(part) for part in parts])
        box = np.stack([in_place.min(axis=0), in_place.max(axis=0)])
        moves = self._moves(added, box)
        shift = -np.sum(moves, axis=0) if moves else np.zeros(3)
        if moves:
            out = shift / np.linalg.norm(shift)
            before = self._before(box, out)
            if np.ptp(box, axis=0).max() > SMALL_MM:
                self.from_.append(out)
            middle = box.mean(axis=0) + before + shift
            self.arrows.append(Arrow(np.cumsum([middle, *moves], axis=0), "tool" if self._is_screw(added) else "way"))
            shift = shift + before
            self._apart.append(_Apart(box, out, shift))
        for part in parts:
            if isinstance(part, PlacedPiece):
                self._mark(part, shift)
        return [self.state.shape(part, shift, creases=not moves) for part in parts]

    def _before(self, box: Vector, out: Vector) -> Vector:
        """The shift of what stands apart already in the way of a box that moves out in that direction."""
        across = np.abs(out) < ACROSS
        shifts = [np.zeros(3)]
        for one in self._apart:
            overlap = (box[0] <= one.box_mm[1]) & (one.box_mm[0] <= box[1])
            if float(one.out @ out) > ALIKE and overlap[across].all():
                shifts.append(one.shift_mm)
        return max(shifts, key=lambda shift: float(shift @ out))

    def _moves(self, added: Added, box: Vector) -> list[Vector]:
        """The way in, its moves shortened; the first one is long enough to be seen."""
        moves = [np.array(move) for move in added.way_mm if np.linalg.norm(move) > 0]
        if not moves and self.axle_mm is not None and added.kind == "piece" and is_wound(self.state.pieces[added.name]):
            radial = (box.mean(axis=0) - self.axle_mm) * (1.0, 0.0, 1.0)
            moves = [-radial] if np.linalg.norm(radial) > 0 else []
            return [STRIP_APART_MM * move / np.linalg.norm(move) for move in moves]
        lengths = [float(np.linalg.norm(move)) for move in moves]
        if self._is_screw(added):
            return [move * min(1.0, SCREW_APART_MM / length) for move, length in zip(moves, lengths, strict=True)]
        least = min(max(LEAST_APART_MM, APART_SHARE * float(np.ptp(box, axis=0).max())), APART_MM)
        wanted = [min(max(length, 0.0 if i else least), APART_MM) for i, length in enumerate(lengths)]
        return [move * (want / length) for move, length, want in zip(moves, lengths, wanted, strict=True)]

    def _is_screw(self, added: Added) -> bool:
        return added.kind == "mount" and is_screw(self.state.car.parts, self.state.mounts[added.name])

    def _fold_arrows(self, part: PlacedPiece) -> None:
        """From where the largest faces that a fold moves were to where they are."""
        then, now = self.state.face_centres(part, self.state.before), self.state.face_centres(part)
        faces = sorted(self.state.pieces[part.piece].faces, key=lambda face: -_spread(face.outline_mm))
        moved = [f.name for f in faces if np.linalg.norm(now[f.name] - then[f.name]) > MOVED_MM]
        self.arrows += [Arrow(np.stack([then[name], now[name]])) for name in moved[:FOLD_ARROWS]]

    def _mark(self, part: PlacedPiece, shift: Vector) -> None:
        """The numbers of this step's joins on a piece."""
        pose = self.state.pose(part)
        pose[:3, 3] += shift
        piece = self.state.pieces[part.piece]
        marks = join_marks(self.state.car, piece, pose, self.state.fraction(part.piece), key(part))
        self.marks += [mark for mark in marks if int(mark.text) in self.step.joins]


def tiny(state: State, part: Part) -> bool:
    """Whether the part is a screw or a spacer, which is not drawn any more once it is in."""
    names = {entry.name for _, entry in state.car.parts if isinstance(entry, Screw | Spacer)}
    return isinstance(part, Mount) and part.part in names


def points(shapes: Sequence[Shape]) -> Vector:
    """All corners (n, 3)."""
    return np.concatenate([facet.rings_mm[0] for shape in shapes for facet in shape.facets])


def _spread(outline_mm: Sequence[tuple[float, float]]) -> float:
    return float(np.prod(np.ptp(np.array(outline_mm), axis=0)))
