"""The pictures of a step and of the service: parts in place are pale, new parts have an arrow along their insertion path.

Input: a step and the State after it; a FoldedCar. Output: Pictures. Parts that are inserted onto each other from one side
stand apart in a row, in the order of the step; a nut stands on its own side.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations

import numpy as np
from shapely.geometry import Point, Polygon

from foldcar.car.folded.model import FoldedCar, Join, Mount, Piece, PlacedPiece
from foldcar.car.folded.pose import edge
from foldcar.car.parts.bought import Screw, Spacer
from foldcar.car.proof.prove import assembly_steps, service_steps
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.step import Added, AssemblyStep
from foldcar.fabrication.assembly.drawing import Arrow, Drawing, Mark
from foldcar.fabrication.assembly.faces import Fraction, Matrix, face_poses, glued_offset_mm, moved
from foldcar.fabrication.assembly.facets import Shape, merge_shapes, shank_and_nut
from foldcar.fabrication.assembly.guide_state import Part, State, key
from foldcar.fabrication.assembly.guide_words import reached_part
from foldcar.fabrication.assembly.hidden_surfaces import Camera, Vector, camera
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
BESIDE_EDGE_MM = 7.0


@dataclass(frozen=True, slots=True)
class Step:
    """One step: a title, instructions line by line, pictures, and its operations."""

    title: str
    lines: tuple[str, ...]
    pictures: tuple[Drawing, ...] = ()
    done: Operations = field(default_factory=Operations)

    @property
    def effort(self) -> str:
        """The step's operations and their time as text; "" if there are none."""
        counts = [f"{count} {name}" for name, count in self.done.named()]
        return f"{', '.join(counts)}: about {minutes(self.done.minutes)}" if counts else ""


def step_pictures(step: AssemblyStep, state: State, title: str) -> tuple[Drawing, ...]:
    """Return the pictures of one step, one from each side that parts come from."""
    scene = Scene(step, state)
    return tuple(
        Drawing(scene.shape, view, title, scene.marks, 1.0, scene.faded, scene.arrows_in(view), caption)
        for view, caption in _views(scene)
    )


def service_picture(car: FoldedCar) -> tuple[Drawing, ...]:
    """Return pictures of the finished car: how its lids open, and, with open lids, what plugs and fingers reach."""
    state = State(car)
    for step in assembly_steps(car):
        state.apply_step(step)
    wheels = {axle.wheel for axle in car.axles}
    shown = [part for part in state.in_place if part.body not in wheels and not is_hidden(state, part)]
    lids = [step.folds for step in service_steps(car) if step.folds]
    pictures: list[Drawing] = []
    if lids:
        outside_lid = [part for part in shown if not (isinstance(part, Mount) and roles_of(car).is_on_lid(part))]
        caption = "the lid shut, without wheels: push each lever outwards, lift by the pull tab"
        shut = merge_shapes(map(state.shape, outside_lid))
        pictures.append(Drawing(shut, FROM_RIGHT, "Open", arrows=_opening(car, state), caption=caption))
    for folds in lids:
        state.close(folds)
    mounts = {mount.name: mount for mount in car.mounts}
    arrows: list[Arrow] = []
    for reach in (reach for step in service_steps(car) for reach in step.tool_uses if not reach.piece):
        mount = mounts[reach.name]
        access = mount.clearances[reach.index]
        longest_mm = DRIVER_MM if access.tool == "driver" else TOOL_MM
        at = state.pose(mount) @ np.array(access.pose)
        ends = np.stack([at[:3, 3] + at[:3, 2] * min(access.length_mm, longest_mm), at[:3, 3]])
        word = reached_part(car, mount, reach.index)
        arrows.append(Arrow(ends, "tool", "" if any(arrow.text == word for arrow in arrows) else word))
    caption = "the lid open, without wheels" if lids else "without wheels"
    opened = Drawing(merge_shapes(map(state.shape, shown)), FROM_RIGHT, "Service", arrows=arrows, caption=caption)
    return (*pictures, opened)


def _opening(car: FoldedCar, state: State) -> list[Arrow]:
    """Return arrows where fingers push the lids' levers outwards, and where they lift."""
    arrows: list[Arrow] = []
    for name, lid in sorted(roles_of(car).lids.items()):
        copy = next(copy for copy in car.placed if copy.piece == name)
        poses = face_poses(state.pieces[name], state.closed.get(name, {}))
        for face in lid.gripped:
            pose = state.pose(copy) @ poses[face.name]
            kinds = [access.tool for access in face.clearances]
            middle = max(x for x, _ in face.outline_mm) / 2
            if "tongue" in kinds:
                # The lever stands as high over the lid as the tongue is below it; printed sides face down.
                lever = (car.parts.assembly.flap_mm.value + car.parts.assembly.grip_mm.value * LEVER_AT) * -1.0
                points_mm = [(middle, -PUSH_MM, lever), (middle, 0.0, lever)]
            else:
                tip = max(y for _, y in face.outline_mm)
                points_mm = [(middle, tip, 0.0), (middle, tip + TOOL_MM, 0.0)]
            arrows.append(Arrow(moved(pose, np.array(points_mm))))
    return arrows


def _views(scene: "Scene") -> list[tuple[Camera, str]]:
    """Return the cameras and captions of a scene's pictures."""
    if scene.outward is not None:
        return [(camera(35 if scene.outward[1] > 0 else -35, 18), "seen from its outer side")]
    sides = scene.sides
    if not sides and np.ptp(points([scene.shape])[:, 2]) < FLAT_MM:
        return [(FLAT, "")]
    left, right = any(side[1] > SIDEWAYS for side in sides), any(side[1] < -SIDEWAYS for side in sides)
    if left and right:
        return [(FROM_RIGHT, "seen from the right"), (FROM_LEFT, "seen from the left")]
    if sides and all(side[2] < -SIDEWAYS for side in sides):
        return [(FROM_BELOW, "seen from below")]
    if sides and all(side[0] < -SIDEWAYS for side in sides):
        return [(FROM_REAR, "seen from the rear")]
    return [(FROM_LEFT, "seen from the left") if left else (FROM_RIGHT, "seen from the right")]


@dataclass(frozen=True)
class _DisplacedPart:
    """A part that stands apart: its bounding box in place (2, 3), its direction out, and its total shift (mm)."""

    box_mm: Vector
    out: Vector
    shift_mm: Vector


class Scene:
    """``shape``, ``faded`` keys, ``arrows`` and ``marks`` of a step; ``sides`` are directions that large parts come from.

    ``outward`` is the direction away from the car, if the step puts a wheel together.
    """

    def __init__(self, step: AssemblyStep, state: State) -> None:
        self.step, self.state = step, state
        body = state.unit_bodies(step.unit)[0] if step.unit else ""
        axle = next((axle for axle in state.car.axles if axle.wheel == body), None)
        self.axle_mm = None if axle is None else np.array(axle.center_mm)
        self.outward = None if axle is None else np.array([0.0, 1.0 if axle.side == "left" else -1.0, 0.0])
        self.sides: list[Vector] = []
        self.arrows: list[Arrow] = []
        self.marks: list[Mark] = []
        self._displaced: list[_DisplacedPart] = []
        shown = [added for added in step.adds if not step.unit or added.body == body]
        new = {id(part) for added in shown for part in state.parts(added)}
        present = [part for part in (state.unit(step.unit, body) if step.unit else state.in_place) if id(part) not in new]
        folded = [part for part in present if isinstance(part, PlacedPiece) and part.piece in step.folds]
        old = [state.shape(part) for part in present if part not in folded and not is_hidden(state, part)]
        self.faded = {facet.key for shape in old for facet in shape.facets}
        fresh = [state.shape(part, creases=True) for part in folded]
        for part in folded:
            self._mark(part, np.zeros(3))
            if not step.adds:
                self._fold_arrows(part)
        for added in shown:
            fresh += self._added(added)
        self.shape = merge_shapes([*old, *fresh])

    def arrows_in(self, view: Camera) -> list[Arrow]:
        """Return the arrows of parts that come from the camera's side, or across."""
        ways = [(arrow, arrow.points_mm[0] - arrow.points_mm[-1]) for arrow in self.arrows]
        return [arrow for arrow, way in ways if way @ view.toward > -BEHIND * np.linalg.norm(way)]

    def _added(self, added: Added) -> list[Shape]:
        """Return the shapes that come in with ``added``, apart from their places."""
        parts = self.state.parts(added)
        if added.nut_mm:
            (screw,) = parts
            assert isinstance(screw, Mount)
            shank, nut = shank_and_nut(screw)
            return [*self._insert(added, [shank]), *self._insert(replace(added, way_mm=added.nut_mm[-1:]), [nut])]
        return self._insert(added, parts)

    def _insert(self, added: Added, parts: Sequence[Part]) -> list[Shape]:
        """Show ``parts`` apart from their place, with arrows along the moves that bring them in."""
        in_place = points([self.state.shape(part) for part in parts])
        box = np.stack([in_place.min(axis=0), in_place.max(axis=0)])
        moves = self._moves(added, box)
        shift = -np.sum(moves, axis=0) if moves else np.zeros(3)
        if moves:
            out = shift / np.linalg.norm(shift)
            before = self._shift_of_obstacle(box, out)
            if np.ptp(box, axis=0).max() > SMALL_MM:
                self.sides.append(out)
            middle = box.mean(axis=0) + before + shift
            self.arrows.append(Arrow(np.cumsum([middle, *moves], axis=0), "tool" if self._is_screw(added) else "way"))
            shift = shift + before
            self._displaced.append(_DisplacedPart(box, out, shift))
        for part in parts:
            if isinstance(part, PlacedPiece):
                self._mark(part, shift)
        return [self.state.shape(part, shift, creases=not moves) for part in parts]

    def _shift_of_obstacle(self, box: Vector, out: Vector) -> Vector:
        """Return the largest shift of a part that stands apart in the way of a box moving out in that direction."""
        across = np.abs(out) < ACROSS
        shifts = [np.zeros(3)]
        for earlier in self._displaced:
            overlap = (box[0] <= earlier.box_mm[1]) & (earlier.box_mm[0] <= box[1])
            if float(earlier.out @ out) > ALIKE and overlap[across].all():
                shifts.append(earlier.shift_mm)
        return max(shifts, key=lambda shift: float(shift @ out))

    def _moves(self, added: Added, box: Vector) -> list[Vector]:
        """Return the insertion path with its moves shortened; the first is long enough to be seen."""
        moves = [np.array(move) for move in added.way_mm if np.linalg.norm(move) > 0]
        if not moves and self.axle_mm is not None and added.kind == "piece" and is_wound(self.state.pieces[added.name]):
            radial = (box.mean(axis=0) - self.axle_mm) * (1.0, 0.0, 1.0)
            moves = [-radial] if np.linalg.norm(radial) > 0 else []
            return [STRIP_APART_MM * move / np.linalg.norm(move) for move in moves]
        lengths = [float(np.linalg.norm(move)) for move in moves]
        if self._is_screw(added):
            return [move * min(1.0, SCREW_APART_MM / length) for move, length in zip(moves, lengths, strict=True)]
        least = min(max(MIN_APART_MM, APART_SHARE * float(np.ptp(box, axis=0).max())), APART_MM)
        lengths_mm = [min(max(length, 0.0 if i else least), APART_MM) for i, length in enumerate(lengths)]
        return [move * (want / length) for move, length, want in zip(moves, lengths, lengths_mm, strict=True)]

    def _is_screw(self, added: Added) -> bool:
        return added.kind == "mount" and is_screw(self.state.car.parts, self.state.mounts[added.name])

    def _fold_arrows(self, part: PlacedPiece) -> None:
        """Add arrows for the largest faces that a fold moves, from where they were to where they are."""
        earlier, later = (self.state.face_centres(part, stage) for stage in (self.state.before, self.state.stage))
        faces = sorted(self.state.pieces[part.piece].faces, key=lambda face: -_spread(face.outline_mm))
        moved_names = [f.name for f in faces if np.linalg.norm(later[f.name] - earlier[f.name]) > MOVED_MM]
        self.arrows += [Arrow(np.stack([earlier[name], later[name]])) for name in moved_names[:FOLD_ARROWS]]

    def _mark(self, part: PlacedPiece, shift: Vector) -> None:
        """Add marks with the numbers of this step's joins on a piece."""
        pose = self.state.pose(part)
        pose[:3, 3] += shift
        piece = self.state.pieces[part.piece]
        marks = join_marks(self.state.car, piece, pose, self.state.closed.get(part.piece, {}), key(part))
        self.marks += [mark for mark in marks if int(mark.text) in self.step.joins]


def is_hidden(state: State, part: Part) -> bool:
    """Whether the part is a screw or a spacer, which later steps do not draw."""
    names = {entry.name for _, entry in state.car.parts if isinstance(entry, Screw | Spacer)}
    return isinstance(part, Mount) and part.part in names


def points(shapes: Sequence[Shape]) -> Vector:
    """Return the corners of all facets' outlines, (n, 3)."""
    return np.concatenate([facet.rings_mm[0] for shape in shapes for facet in shape.facets])


def _spread(outline_mm: Sequence[tuple[float, float]]) -> float:
    return float(np.prod(np.ptp(np.array(outline_mm), axis=0)))


def join_marks(folded: FoldedCar, piece: Piece, pose: Matrix, fraction: Fraction, prefix: str = "") -> list[Mark]:
    """Return the numbers of joins on one copy of a piece; joins around a rim have their number once on each side."""
    poses = {name: pose @ at for name, at in face_poses(piece, fraction).items()}
    offsets = glued_offset_mm(piece, fraction)
    places: dict[tuple[int, str], list[Mark]] = {}
    for join in folded.joins:
        for side in ("a", "b"):
            if (join.piece_a if side == "a" else join.piece_b) != piece.name:
                continue
            place = _place(join, piece, side)
            if place is None:
                continue
            face, at = place
            once = (join.number, side if join.kind in ("rim", "laminate") else f"{side} {face}")
            point = moved(poses[face], np.array([[*at, offsets.get(face, 0.0)]]))[0]
            places.setdefault(once, []).append(Mark(str(join.number), point, prefix + face))
    marks: list[Mark] = []
    # Numbers with one place come first. Of the teeth around a rim, the one farthest from all other numbers is taken.
    for candidates in sorted(places.values(), key=len):
        marks.append(max(candidates, key=lambda mark: round(_apart_mm(mark, marks), 3)))
    return marks


def _apart_mm(mark: Mark, others: list[Mark]) -> float:
    return min((float(np.linalg.norm(mark.at_mm - other.at_mm)) for other in others), default=0.0)


def _place(join: Join, piece: Piece, side: str) -> tuple[str, Vector] | None:
    """Return the face and the point (mm) for a join's number; None if the join has no number on this side."""
    faces = {face.name: face for face in piece.faces}
    reference = join.a if side == "a" else join.b
    # The joins of merged copies name the faces of the first copy.
    face = faces.get(reference.face, piece.faces[0])
    outline = np.array(face.outline_mm)
    if join.kind == "laminate" and side == "a":
        # Off the centre, where hubs and openings are.
        return face.name, outline.mean(axis=0) * 0.4 + outline[0] * 0.6
    if join.kind == "laminate":
        return None
    hole = next((hole for hole in face.holes if side == "b" and hole.name == join.slot), None)
    if hole is not None:
        middle = np.array(hole.outline_mm).mean(axis=0)
        inward = outline.mean(axis=0) - middle
        depth_mm = float(np.linalg.norm(inward))
        if depth_mm > BESIDE_EDGE_MM:
            step = inward * BESIDE_EDGE_MM / depth_mm
            opened = any(Polygon(hole.outline_mm).covers(Point(*(middle + step))) for hole in face.holes)
            return face.name, middle - step if opened else middle + step
        # A wound strip's faces are short, so the number is on the next face.
        ends = [(crease.parent.face, crease.child.face) for crease in piece.creases]
        beside = [faces[b] for pair in ends for a, b in permutations(pair) if a == face.name]
        neighbour = max(beside, key=lambda hole: float(np.ptp(hole.outline_mm, axis=0).prod()), default=face)
        return neighbour.name, np.array(neighbour.outline_mm).mean(axis=0)
    if side == "a" and join.kind in ("tab", "lap", "rim"):
        return face.name, outline.mean(axis=0)
    a, b = (np.array(point) for point in edge(faces, reference))
    inward = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    reach = min(BESIDE_EDGE_MM, float(((outline - a) @ inward).max()) / 2)
    return face.name, (a + b) / 2 + inward * reach
