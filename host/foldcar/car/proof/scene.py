"""The solids of a car's pieces and mounts at a stage of its assembly.

Input: a FoldedCar's roles and a Stage. Output: Blocks in the car's frame. A face ends half a film before a fold, where
film bends; tongues are cut off where they reach into what they lock into.
"""

import itertools
from collections import defaultdict
from collections.abc import Collection, Iterator
from functools import cache

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.model import IDENTITY, Access, Join, JoinKind, Mount, PlacedPiece, Pose
from foldcar.car.folded.placed import polygon
from foldcar.car.folded.pose import apply, compose, edge, folded, inverse, side
from foldcar.car.proof.blocks import Blocks, Ignored, access_blocks, plate, solid_blocks, together
from foldcar.car.proof.roles import Host, Roles
from foldcar.car.proof.step import Folds, Reach, Thing


class Stage:
    """The car with its folds closed by fractions, by piece and crease.

    What is fixed to a piece follows the face it is fixed to; the root of a beam stays where it is in the finished car.
    """

    def __init__(self, roles: Roles, folds: Folds) -> None:
        self.roles, self.folds = roles, folds
        self._folded = cache(lambda name: folded(roles.pieces[name], folds.get(name, {})))

    def closed(self, folds: Folds) -> "Stage":
        """The stage with these folds closed, too."""
        changed = {piece: {**self.folds.get(piece, {}), **fractions} for piece, fractions in folds.items()}
        return Stage(self.roles, {**self.folds, **changed})

    def root(self, one: PlacedPiece) -> Pose:
        """The pose of the first face of a copy of a piece."""
        return compose(self._shift(self.roles.host(one)), one.pose)

    def faces(self, one: PlacedPiece) -> dict[str, Pose]:
        """The poses of the faces of a copy of a piece."""
        root = self.root(one)
        return {face: compose(root, pose) for face, pose in self._folded(one.piece).items()}

    def mount(self, mount: Mount) -> Pose:
        """The pose of a mount."""
        return compose(self._shift(self.roles.mount_host(mount)), mount.pose)

    def poses(self, thing: Thing) -> dict[str, Pose]:
        """The poses of a piece's faces by name, or that of a mount by its own."""
        kind, name, copy = thing
        return (
            self.faces(self.roles.copies[name, copy]) if kind == "piece" else {name: self.mount(self.roles.mounts[name])}
        )

    def _shift(self, host: Host) -> Pose:
        """The motion of a face from its place in the finished car."""
        if host is None:
            return IDENTITY
        one, face = host
        above = self._shift(self.roles.host(one))
        now, then = self._folded(one.piece)[face], self.roles.finished[one.piece][face]
        return above if now == then else compose(above, one.pose, now, inverse(then), inverse(one.pose))


TONGUES = frozenset({"lock", "tab_slot", "rim"})
# Tongues leave the plane of their slot at an angle whose sine is more than this.
UPRIGHT = 0.3
FAR_MM = 1000.0
# Tongues reach so far behind the tip that a join names.
BEHIND_MM = 1.0


def title(piece: str, face: str) -> str:
    """The name of a face in findings."""
    return f"{piece}: {face}"


class Scene:
    """Solids of one car, without its ``tongues`` where they are in their slots, or with them."""

    def __init__(self, roles: Roles, tongues: bool = False) -> None:
        self.roles = roles
        # The solids of pieces and mounts at the poses where they were last.
        self._last: dict[Thing, tuple[dict[str, Pose], Blocks]] = {}
        self._tongues: dict[tuple[str, str], list[shapely.Geometry]] = defaultdict(list)
        # A tongue's piece is cut whole where it meets a face of another one.
        cuts = {(j.piece_a, j.piece_b, j.b.face, j.a.face if j.piece_a == j.piece_b else ""): j for j in roles.car.joins}
        for join in (join for join in cuts.values() if join.kind in TONGUES and not tongues):
            for face, tongue in self._through(join):
                self._tongues[join.piece_a, face].append(tongue)
        self._face = cache(self._made_face)
        self._mount = cache(lambda mount: together(solid_blocks(solid, mount.name) for solid in mount.shape))

    def solid(self, thing: Thing, stage: Stage) -> Blocks:
        """A copy of a piece, or a mount; nothing for loose wires."""
        poses, (kind, name, _) = stage.poses(thing), thing
        if thing not in self._last or self._last[thing][0] != poses:
            if kind == "piece":
                parts = [self._face(name, face).moved(pose) for face, pose in poses.items()]
            else:
                mount = self.roles.mounts[name]
                loose = mount.part == self.roles.car.parts.wiring.name
                parts = [] if loose else [self._mount(mount).moved(poses[name])]
            self._last[thing] = poses, together(parts)
        return self._last[thing][1]

    def screw(self, mount: Mount, stage: Stage) -> list[Blocks]:
        """Head with shank, then the nut: the solids from the third on."""
        several = [solid_blocks(solid, mount.name).moved(stage.mount(mount)) for solid in mount.shape]
        return [together(several[:2]), *several[2:]]

    def access(self, reach: Reach, stage: Stage) -> tuple[Access, Blocks]:
        """An access and its cylinder, which is named as what is reached."""
        if not reach.piece:
            mount = self.roles.mounts[reach.name]
            access, name, pose = mount.accesses[reach.index], mount.name, stage.mount(mount)
        else:
            face = self.roles.faces[reach.piece][reach.name]
            access, name = face.accesses[reach.index], title(reach.piece, reach.name)
            pose = stage.faces(self.roles.copies[reach.piece, 0])[reach.name]
        return access, access_blocks(access, name).moved(pose)

    def ignored(self, kinds: Collection[JoinKind] = ("tab", "lap", "rim")) -> Ignored:
        """The pairs of faces that tabs join: a tab is modelled in the plane it is glued to, or on it."""
        glued = (join for join in self.roles.car.joins if join.kind in kinds)
        ends = [(title(join.piece_a, join.a.face), title(join.piece_b, join.b.face)) for join in glued]
        return frozenset(ends) | {(b, a) for a, b in ends}

    def _made_face(self, name: str, face_name: str) -> Blocks:
        """A face in its own frame, without its tongues and what bends at its folds."""
        piece, face = self.roles.pieces[name], self.roles.faces[name][face_name]
        folds = (ref for c in piece.creases if not c.bend for ref in (c.parent, c.child) if ref.face == face_name)
        lines = (shapely.LineString(side(face.outline_mm, ref.index)) for ref in folds)
        bends = (line.buffer(piece.thickness_mm / 2, cap_style="flat") for line in lines)
        shape: shapely.Geometry = polygon(face)
        for one in (*self._tongues[name, face_name], *bends):
            shape = shape.difference(one)
        return plate(shape, piece.thickness_mm, title(name, face_name))

    def _through(self, join: Join) -> Iterator[tuple[str, shapely.Geometry]]:
        """Bands of faces, in their frames, in and behind the film that a tongue goes through, as far as its tip.

        All faces of the tongue's piece are cut there, unless it locks into itself: tongues may share a slot.
        """
        roles, piece = self.roles, self.roles.pieces[join.piece_a]
        tip = np.mean(edge(roles.faces[join.piece_a], join.a), axis=0)
        copies = ([one for one in roles.car.placed if one.piece == name] for name in (join.piece_a, join.piece_b))
        # No piece with a tongue is twice in one body.
        tongue, slotted = next(pair for pair in itertools.product(*copies) if pair[0].body == pair[1].body)
        onto = inverse(roles.pose_of(slotted, join.b.face))
        height = apply(compose(onto, roles.pose_of(tongue, join.a.face)), *tip)[2]
        half = roles.pieces[join.piece_b].thickness_mm / 2
        for face in (face for face in piece.faces if join.piece_a != join.piece_b or face.name == join.a.face):
            relative = np.array(compose(onto, roles.pose_of(tongue, face.name))) * (1.0 if height > 0 else -1.0)
            # Height of (x, y) of the face over the film: slope @ (x, y) + offset.
            slope, offset = relative[2, :2], relative[2, 3]
            heights = np.array(face.outline_mm) @ slope + offset
            if np.linalg.norm(slope) > UPRIGHT and heights.max() > -half:
                yield face.name, _band(slope, offset, -half, abs(height) + BEHIND_MM)


def _band(slope: NDArray[np.float64], offset: float, low: float, high: float) -> shapely.Geometry:
    """The points of the plane (mm) where ``slope`` @ point + ``offset`` is between two values, as a long rectangle."""
    steep = float(np.linalg.norm(slope))
    out = slope / steep
    along = np.array((-out[1], out[0])) * FAR_MM
    first, last = out * (low - offset) / steep, out * (high - offset) / steep
    return shapely.Polygon([first - along, first + along, last + along, last - along])
