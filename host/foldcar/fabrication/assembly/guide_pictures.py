"""The pictures of a step and of the service: parts in place are pale, new parts have an arrow along their insertion path.

Input: a step and the AssemblyState after it; a FoldedCar. Output: Drawings. Parts that are inserted onto each other from
one side stand apart in a row, in the order of the step; a nut stands on its own side.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from foldcar.car.folded.model import FoldedCar, Mount, PlacedPiece
from foldcar.car.parts.bought import Screw, Spacer
from foldcar.car.proof.prove import assembly_steps, service_steps
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.step import AddedPart, AssemblyStep
from foldcar.fabrication.assembly.drawing import Arrow, Drawing, DrawnText
from foldcar.fabrication.assembly.faces import face_poses, moved
from foldcar.fabrication.assembly.facets import PictureContent, merge_shapes, shank_and_nut
from foldcar.fabrication.assembly.guide_service import reached_part
from foldcar.fabrication.assembly.guide_state import AssemblyState, Part, facet_key_prefix
from foldcar.fabrication.assembly.hidden_surfaces import Camera, Vector, camera
from foldcar.fabrication.assembly.join_numbers import box_area_mm2, join_marks
from foldcar.fabrication.assembly.operations import Operations, is_screw, is_wound, minutes

# Open lids stand on the left, so that most is seen from the right.
FROM_RIGHT, FROM_LEFT, FROM_REAR = camera(-55, 34), camera(125, 34), camera(-125, 34)
FROM_BELOW, FLAT = camera(-55, -34), camera(-75, 50)
FLAT_MM, TOOL_MM, PUSH_MM = 16.0, 28.0, 16.0
# A screwdriver's arrow is longer than those of plugs, so that it does not cross their words.
DRIVER_MM = 65.0
# Where a lever is pushed, as a fraction of its height.
LEVER_AT = 0.8
# A part comes from a side if the cosine to that direction is larger.
SIDEWAYS = 0.7
# Distance of parts from their places along each move of their path: maximum, minimum, and fraction of their size.
APART_MM, MIN_APART_MM, APART_SHARE = 62.0, 24.0, 0.4
SCREW_APART_MM, STRIP_APART_MM = 22.0, 26.0
# Directions are alike above this cosine; an arrow points away from the camera below the negative of the second.
ALIKE, BEHIND = 0.9, 0.35
# An axis is across a direction if the direction's component along it is smaller.
ACROSS = 0.5
# Smaller parts, screws and spacers, do not choose the camera. A fold that moves a face by less has no arrow.
SMALL_MM, MOVED_MM = 14.0, 20.0
FOLD_ARROWS = 2


@dataclass(frozen=True, slots=True)
class FlatPicture:
    """A picture that is no view of the car, such as a wiring diagram: its SVG, and the words below it."""

    svg: Markup
    caption: str


@dataclass(frozen=True, slots=True)
class Step:
    """One step: a title, instructions line by line, pictures, and its operations."""

    title: str
    lines: tuple[str, ...]
    pictures: tuple[Drawing | FlatPicture, ...] = ()
    done: Operations = field(default_factory=Operations)

    @property
    def layout(self) -> str:
        """The classes of the page that lay out text and pictures; a flat picture takes the whole width."""
        if any(isinstance(picture, FlatPicture) for picture in self.pictures):
            return " flat"
        return "" if len(self.pictures) == 1 else " two"

    @property
    def effort(self) -> str:
        """The step's operations and their time as text; "" without operations."""
        counts = [f"{count} {name}" for name, count in self.done.named()]
        return f"{', '.join(counts)}: about {minutes(self.done.minutes)}" if counts else ""


def step_pictures(step: AssemblyStep, state: AssemblyState, title: str) -> tuple[Drawing, ...]:
    """Return the pictures of one step, one from each side that parts come from."""
    scene = StepPicture(step, state)
    return tuple(
        Drawing(scene.shape, view, title, scene.marks, 1.0, scene.faded, scene.arrows_in(view), caption)
        for view, caption in _views(scene)
    )


def service_picture(car: FoldedCar) -> tuple[Drawing, ...]:
    """Return the pictures on how to open the finished car and reach the parts inside, to service it.

    If the car has lids, the first picture shows how they are opened. The last one shows the car with open lids, and what
    plugs, fingers and screwdrivers reach then. Wheels, screws and spacers are not drawn.
    """
    state = AssemblyState(car)
    for step in assembly_steps(car):
        state.advance(step)
    wheels = {axle.wheel for axle in car.axles}
    parts = [part for part in state.in_place if part.body not in wheels and not is_hidden(state, part)]
    folds_of_lids = [step.folds for step in service_steps(car) if step.folds]
    pictures: list[Drawing] = []
    if folds_of_lids:
        # Parts that are fixed to a lid would hide it.
        without_parts_on_lids = [
            part for part in parts if not (isinstance(part, Mount) and roles_of(car).is_on_lid(part))
        ]
        caption = "the lid shut, without wheels: push each lever outwards, lift by the pull tab"
        closed_shape = merge_shapes(map(state.shape, without_parts_on_lids))
        pictures.append(Drawing(closed_shape, FROM_RIGHT, "Open", arrows=_opening_arrows(car, state), caption=caption))
    for folds in folds_of_lids:
        state.close_folds(folds)
    open_shape = merge_shapes(map(state.shape, parts))
    caption = "the lid open, without wheels" if folds_of_lids else "without wheels"
    arrows = _tool_arrows(car, state)
    pictures.append(Drawing(open_shape, FROM_RIGHT, "Service", arrows=arrows, caption=caption))
    return tuple(pictures)


def _tool_arrows(car: FoldedCar, state: AssemblyState) -> list[Arrow]:
    """Return an arrow for each plug, finger or screwdriver that reaches a part of the finished car.

    The arrow has the name of the part, unless another arrow has it already.
    """
    mounts = {mount.name: mount for mount in car.mounts}
    arrows: list[Arrow] = []
    uses = [use for step in service_steps(car) for use in step.tool_uses]
    for use in uses:
        if use.piece:
            # The lids have arrows in a picture of their own.
            continue
        mount = mounts[use.name]
        clearance = mount.clearances[use.index]
        longest_mm = DRIVER_MM if clearance.tool == "driver" else TOOL_MM
        # A tool comes along the z axis of its clearance.
        tool_pose = state.pose(mount) @ np.array(clearance.pose)
        end_mm = tool_pose[:3, 3]
        start_mm = end_mm + tool_pose[:3, 2] * min(clearance.length_mm, longest_mm)
        label = reached_part(car, mount, use.index)
        is_labelled = any(arrow.text == label for arrow in arrows)
        arrows.append(Arrow(np.stack([start_mm, end_mm]), "tool", "" if is_labelled else label))
    return arrows


def _opening_arrows(car: FoldedCar, state: AssemblyState) -> list[Arrow]:
    """Return arrows that show how lids are opened: the levers of latches are pushed outwards, pull tabs are lifted."""
    arrows: list[Arrow] = []
    for name, lid in sorted(roles_of(car).lids.items()):
        copy = next(copy for copy in car.placed if copy.piece == name)
        poses = face_poses(state.pieces[name], state.fold_fractions.get(name, {}))
        # Fingers push or pull these faces.
        for face in lid.gripped:
            pose = state.pose(copy) @ poses[face.name]
            # The tongue of a latch requires free space for itself, because its lever draws it out of its slot.
            is_latch_tongue = any(clearance.tool == "tongue" for clearance in face.clearances)
            # The points of the arrow are in the frame of the face.
            middle = max(x for x, _ in face.outline_mm) / 2
            if is_latch_tongue:
                # The lever is above the tongue and stands out of the lid. In the tongue's frame, y points outwards and z
                # down.
                height_mm = car.parts.assembly.flap_mm.value + car.parts.assembly.grip_mm.value * LEVER_AT
                lever_z_mm = -height_mm
                points_mm = [(middle, -PUSH_MM, lever_z_mm), (middle, 0.0, lever_z_mm)]
            else:
                tip = max(y for _, y in face.outline_mm)
                points_mm = [(middle, tip, 0.0), (middle, tip + TOOL_MM, 0.0)]
            arrows.append(Arrow(moved(pose, np.array(points_mm))))
    return arrows


def _views(scene: "StepPicture") -> list[tuple[Camera, str]]:
    """Return the cameras and captions of the pictures of a step.

    Each new part is seen from the side from which it comes. ``scene.outward`` is the direction of a part's outer side, if
    only this side is to be seen.
    """
    if scene.outward is not None:
        azimuth_deg = 35 if scene.outward[1] > 0 else -35
        return [(camera(azimuth_deg, elevation_deg=18), "seen from its outer side")]
    # The directions from which large parts come. Their components are x forwards, y to the left and z up.
    sides = scene.sides
    is_flat = np.ptp(points([scene.shape])[:, 2]) < FLAT_MM
    if not sides and is_flat:
        return [(FLAT, "")]
    some_from_left = any(side[1] > SIDEWAYS for side in sides)
    some_from_right = any(side[1] < -SIDEWAYS for side in sides)
    all_from_below = bool(sides) and all(side[2] < -SIDEWAYS for side in sides)
    all_from_rear = bool(sides) and all(side[0] < -SIDEWAYS for side in sides)
    if some_from_left and some_from_right:
        return [(FROM_RIGHT, "seen from the right"), (FROM_LEFT, "seen from the left")]
    if all_from_below:
        return [(FROM_BELOW, "seen from below")]
    if all_from_rear:
        return [(FROM_REAR, "seen from the rear")]
    if some_from_left:
        return [(FROM_LEFT, "seen from the left")]
    return [(FROM_RIGHT, "seen from the right")]


class _Box(NamedTuple):
    """A box along the axes of the car: its corners with the smallest and with the largest coordinates (3,), in mm."""

    low: Vector
    high: Vector

    @property
    def middle(self) -> Vector:
        """The middle of the box (3,)."""
        middle: Vector = np.stack(self).mean(axis=0)
        return middle

    @property
    def longest_mm(self) -> float:
        """The longest of its sides."""
        return float(np.ptp(np.stack(self), axis=0).max())


@dataclass(frozen=True)
class _DisplacedPart:
    """A part drawn apart from its place: its bounding box in place, the direction out (3,), and the shift (3,) in mm."""

    box: _Box
    out: Vector
    shift_mm: Vector


class StepPicture:
    """What the pictures of a step show.

    ``shape`` is everything that is drawn. The facets whose keys are in ``faded`` belong to parts that were in place
    before the step, and are drawn paler. ``arrows`` are the ways of new parts, and ``marks`` the numbers of the step's
    joins. ``sides`` are the directions that large parts come from. ``outward`` is the direction away from the car, if
    the step puts a wheel together.
    """

    def __init__(self, step: AssemblyStep, state: AssemblyState) -> None:
        """Draw a step. ``state`` is that of the assembly after it."""
        self.step, self.state = step, state
        # If the step builds a unit, such as a wheel, that several bodies have, only the first of them is drawn.
        self.body = state.unit_bodies(step.unit)[0] if step.unit else ""
        axle = next((axle for axle in state.car.axles if axle.wheel == self.body), None)
        self.axle_mm = None if axle is None else np.array(axle.center_mm)
        self.outward = None if axle is None else np.array([0.0, 1.0 if axle.side == "left" else -1.0, 0.0])
        self.sides: list[Vector] = []
        self.arrows: list[Arrow] = []
        self.marks: list[DrawnText] = []
        self._displaced: list[_DisplacedPart] = []
        # The parts that were in place before the step. Of these, the pieces that the step folds are drawn like new ones.
        added_parts = [added for added in step.adds if not step.unit or added.body == self.body]
        present = self._parts_before(added_parts)
        folded = [part for part in present if isinstance(part, PlacedPiece) and part.piece in step.folds]
        old_shapes = [state.shape(part) for part in present if part not in folded and not is_hidden(state, part)]
        self.faded = {facet.key for shape in old_shapes for facet in shape.facets}
        new_shapes = [state.shape(part, creases=True) for part in folded]
        for part in folded:
            self._mark_joins(part, np.zeros(3))
            if not step.adds:
                self._add_fold_arrows(part)
        for added in added_parts:
            new_shapes += self._show_added(added)
        self.shape = merge_shapes([*old_shapes, *new_shapes])

    def _parts_before(self, added_parts: Sequence[AddedPart]) -> list[Part]:
        """Return the parts that were in place before the step: in the car, or in the unit that the step builds."""
        new_ids = {id(part) for added in added_parts for part in self.state.parts_of(added)}
        parts = self.state.unit_parts(self.step.unit, self.body) if self.step.unit else self.state.in_place
        return [part for part in parts if id(part) not in new_ids]

    def arrows_in(self, view: Camera) -> list[Arrow]:
        """Return the arrows of parts that come from the camera's side or across the picture, not from behind it."""
        arrows = [(arrow, arrow.points_mm[0] - arrow.points_mm[-1]) for arrow in self.arrows]
        return [arrow for arrow, back in arrows if back @ view.toward > -BEHIND * np.linalg.norm(back)]

    def _show_added(self, added: AddedPart) -> list[PictureContent]:
        """Return the shapes of an added part, drawn at a distance from its place.

        A unit consists of several parts. A screw with a nut is drawn as two parts, with the nut at a distance from the
        screw.
        """
        parts = self.state.parts_of(added)
        if added.nut_mm:
            (screw,) = parts
            assert isinstance(screw, Mount)
            shank, nut = shank_and_nut(screw)
            # The picture shows only the nut's last move, onto the shank.
            nut_added = replace(added, way_mm=added.nut_mm[-1:])
            return [*self._show_apart(added, [shank]), *self._show_apart(nut_added, [nut])]
        return self._show_apart(added, parts)

    def _show_apart(self, added: AddedPart, parts: Sequence[Part]) -> list[PictureContent]:
        """Return the shapes of parts before they are put in. Also add the arrow of their path and their marks.

        The parts stand at the beginning of their path. An earlier part of the step may stand there already, because it
        comes from the same direction. Then these parts stand farther out, by the distance of the earlier one from its
        place.
        """
        corners_mm = points([self.state.shape(part) for part in parts])
        box = _Box(low=corners_mm.min(axis=0), high=corners_mm.max(axis=0))
        moves = self._moves(added, box)
        # How far the parts stand from their places.
        shift = np.zeros(3)
        if moves:
            shift_to_start = -np.sum(moves, axis=0)
            direction_out = shift_to_start / np.linalg.norm(shift_to_start)
            shift_of_earlier = self._shift_of_obstacle(box, direction_out)
            shift = shift_to_start + shift_of_earlier
            self._displaced.append(_DisplacedPart(box, direction_out, shift))
            if box.longest_mm > SMALL_MM:
                self.sides.append(direction_out)
            # The arrow leads along the moves, from the middle of the parts.
            start = box.middle + shift_of_earlier + shift_to_start
            path = np.cumsum([start, *moves], axis=0)
            self.arrows.append(Arrow(path, "tool" if self._is_screw(added) else "way"))
        for part in parts:
            if isinstance(part, PlacedPiece):
                self._mark_joins(part, shift)
        return [self.state.shape(part, shift, creases=not moves) for part in parts]

    def _shift_of_obstacle(self, box: _Box, out: Vector) -> Vector:
        """Return how far (3,) that part is shifted which a ``box`` would meet on its way in the direction ``out``.

        A displaced part is in the way if it was moved in about the same direction, and if it overlaps the box across that
        direction. Of several, the one that is shifted farthest counts. Without any, the result is 0.
        """
        # The axes of the car that are about perpendicular to the direction.
        is_across = np.abs(out) < ACROSS
        shifts = [np.zeros(3)]
        for earlier in self._displaced:
            has_same_direction = float(earlier.out @ out) > ALIKE
            overlaps_along_axes = (box.low <= earlier.box.high) & (earlier.box.low <= box.high)
            if has_same_direction and overlaps_along_axes[is_across].all():
                shifts.append(earlier.shift_mm)
        return max(shifts, key=lambda shift: float(shift @ out))

    def _moves(self, added: AddedPart, box: _Box) -> list[Vector]:
        """Return the moves (3,) of a part's insertion path, with lengths that suit the picture.

        Long moves are shortened. The first move of a part is lengthened if it would be too short to be seen. A strip that
        is wound around a wheel has no path; it is drawn as if it came from outside, along the radius of the wheel.
        """
        moves = [np.array(move) for move in added.way_mm if np.linalg.norm(move) > 0]
        if not moves and self.axle_mm is not None and added.kind == "piece" and is_wound(self.state.pieces[added.name]):
            # The axle runs along y, so the radius has no y.
            radial = (box.middle - self.axle_mm) * (1.0, 0.0, 1.0)
            if np.linalg.norm(radial) == 0:
                return []
            inwards = -radial
            return [STRIP_APART_MM * inwards / np.linalg.norm(inwards)]
        min_first_mm = min(max(MIN_APART_MM, APART_SHARE * box.longest_mm), APART_MM)
        drawn_moves = []
        for number, move in enumerate(moves):
            length_mm = float(np.linalg.norm(move))
            if self._is_screw(added):
                drawn_moves.append(move * min(1.0, SCREW_APART_MM / length_mm))
                continue
            min_mm = min_first_mm if number == 0 else 0.0
            drawn_mm = min(max(length_mm, min_mm), APART_MM)
            drawn_moves.append(move * (drawn_mm / length_mm))
        return drawn_moves

    def _is_screw(self, added: AddedPart) -> bool:
        return added.kind == "mount" and is_screw(self.state.car.parts, self.state.mounts[added.name])

    def _add_fold_arrows(self, part: PlacedPiece) -> None:
        """Add arrows for the largest faces that the folds of the step move, from where they were to where they are."""
        before = self.state.face_centres(part, self.state.previous_stage)
        after = self.state.face_centres(part, self.state.stage)
        faces = sorted(self.state.pieces[part.piece].faces, key=lambda face: -box_area_mm2(face.outline_mm))
        moved_faces = [face.name for face in faces if np.linalg.norm(after[face.name] - before[face.name]) > MOVED_MM]
        self.arrows += [Arrow(np.stack([before[name], after[name]])) for name in moved_faces[:FOLD_ARROWS]]

    def _mark_joins(self, part: PlacedPiece, shift: Vector) -> None:
        """Add marks with the numbers of this step's joins on a copy of a piece that is shifted (mm) from its place."""
        pose = self.state.pose(part)
        pose[:3, 3] += shift
        piece = self.state.pieces[part.piece]
        fractions = self.state.fold_fractions.get(part.piece, {})
        marks = join_marks(self.state.car, piece, pose, fractions, facet_key_prefix(part))
        self.marks += [mark for mark in marks if int(mark.text) in self.step.joins]


def is_hidden(state: AssemblyState, part: Part) -> bool:
    """Return whether the part is a screw or a spacer, which later steps do not draw."""
    names = {entry.name for _, entry in state.car.parts if isinstance(entry, Screw | Spacer)}
    return isinstance(part, Mount) and part.part in names


def points(shapes: Sequence[PictureContent]) -> Vector:
    """Return the corners of all facets' outlines, (n, 3)."""
    return np.concatenate([facet.rings_mm[0] for shape in shapes for facet in shape.facets])
