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

from foldcar.car.folded.model import IDENTITY, Join, JoinKind, Mount, PlacedPiece, Pose, ToolClearance
from foldcar.car.folded.placed import polygon
from foldcar.car.folded.pose import apply, compose, edge, folded, inverse, side
from foldcar.car.proof.blocks import Blocks, Ignored, clearance_blocks, merge_blocks, plate, solid_blocks
from foldcar.car.proof.roles import Host, Roles
from foldcar.car.proof.step import Folds, PartKey, ToolUse


class Stage:
    """The car while some of its folds are closed. ``folds`` has the fraction of each, by piece and crease.

    A part follows the face that it is fixed to. The root face of a beam stays where it is in the finished car.
    """

    def __init__(self, roles: Roles, folds: Folds) -> None:
        self.roles, self.folds = roles, folds
        self._folded = cache(lambda name: folded(roles.pieces[name], folds.get(name, {})))

    def closed(self, folds: Folds) -> "Stage":
        """Return the stage with these folds closed in addition."""
        changed = {piece: {**self.folds.get(piece, {}), **fractions} for piece, fractions in folds.items()}
        return Stage(self.roles, {**self.folds, **changed})

    def root(self, copy: PlacedPiece) -> Pose:
        """Return the pose of the first face of a copy of a piece."""
        return compose(self._shift(self.roles.host(copy)), copy.pose)

    def faces(self, copy: PlacedPiece) -> dict[str, Pose]:
        """Return the poses of the faces of a copy of a piece."""
        root = self.root(copy)
        return {face: compose(root, pose) for face, pose in self._folded(copy.piece).items()}

    def mount(self, mount: Mount) -> Pose:
        """Return the pose of a mount."""
        return compose(self._shift(self.roles.mount_host(mount)), mount.pose)

    def poses(self, key: PartKey) -> dict[str, Pose]:
        """Return the poses of a piece's faces by their names, or the pose of a mount by its name."""
        kind, name, copy = key
        if kind == "piece":
            return self.faces(self.roles.copies[name, copy])
        return {name: self.mount(self.roles.mounts[name])}

    def _shift(self, host: Host | None) -> Pose:
        """Return how a face has moved from its pose in the finished car to its pose at this stage, as a motion in
        the car's frame.

        ``host`` is a copy of a piece, and the face of it on which something is fixed. None moves nothing.
        """
        if host is None:
            return IDENTITY
        copy, face = host
        # The copy may be fixed to a face that moves itself.
        host_motion = self._shift(self.roles.host(copy))
        # Both are the face's pose in the frame of its piece's first face.
        current, finished = self._folded(copy.piece)[face], self.roles.finished[copy.piece][face]
        if current == finished:
            return host_motion
        # From the car's frame back to the finished face, then on to the face as it is folded now.
        return compose(host_motion, copy.pose, current, inverse(finished), inverse(copy.pose))


TONGUES = frozenset({"lock", "tab_slot", "rim"})
# Tongues leave the plane of their slot at an angle whose sine is more than this.
UPRIGHT = 0.3
FAR_MM = 1000.0
# Distance by which tongues extend behind the tip that a join names.
BEHIND_MM = 1.0


def title(piece: str, face: str) -> str:
    """Return the name of a face in findings."""
    return f"{piece}: {face}"


class CarSolids:
    """The solids of one car. Without ``tongues``, a tongue is cut off where it is inside its slot."""

    def __init__(self, roles: Roles, tongues: bool = False) -> None:
        self.roles = roles
        # Cache of the solids of pieces and mounts at their latest poses.
        self._last: dict[PartKey, tuple[dict[str, Pose], Blocks]] = {}
        self._tongues: dict[tuple[str, str], list[shapely.Geometry]] = defaultdict(list)
        # One join suffices for each tongue's piece and slotted face, because all faces of the piece are cut there. Of a
        # piece that locks into itself each tongue's face needs its own.
        cuts = {(j.piece_a, j.piece_b, j.b.face, j.a.face if j.piece_a == j.piece_b else ""): j for j in roles.car.joins}
        for join in (join for join in cuts.values() if join.kind in TONGUES and not tongues):
            for face, tongue in self._through(join):
                self._tongues[join.piece_a, face].append(tongue)
        self._face = cache(self._build_face)
        self._mount = cache(lambda mount: merge_blocks(solid_blocks(solid, mount.name) for solid in mount.shape))

    def solid(self, key: PartKey, stage: Stage) -> Blocks:
        """Return the solids of a copy of a piece, or of a mount; none for loose wires.

        As long as a part has not moved, its last result is used again.
        """
        poses, (kind, name, _) = stage.poses(key), key
        if key not in self._last or self._last[key][0] != poses:
            if kind == "piece":
                parts = [self._face(name, face).moved(pose) for face, pose in poses.items()]
            else:
                mount = self.roles.mounts[name]
                loose = mount.part == self.roles.car.parts.wiring.name
                parts = [] if loose else [self._mount(mount).moved(poses[name])]
            self._last[key] = poses, merge_blocks(parts)
        return self._last[key][1]

    def screw(self, mount: Mount, stage: Stage) -> list[Blocks]:
        """Return head with shank, the first two solids of a screw, and then its nut, if it has one."""
        solids = [solid_blocks(solid, mount.name).moved(stage.mount(mount)) for solid in mount.shape]
        return [merge_blocks(solids[:2]), *solids[2:]]

    def clearance(self, tool_use: ToolUse, stage: Stage) -> tuple[ToolClearance, Blocks]:
        """Return the clearance that a tool needs, and its cylinder, whose title is that of the part that the tool
        reaches.
        """
        if not tool_use.piece:
            mount = self.roles.mounts[tool_use.name]
            clearance, name, pose = mount.clearances[tool_use.index], mount.name, stage.mount(mount)
        else:
            face = self.roles.faces[tool_use.piece][tool_use.name]
            clearance, name = face.clearances[tool_use.index], title(tool_use.piece, tool_use.name)
            pose = stage.faces(self.roles.copies[tool_use.piece, 0])[tool_use.name]
        return clearance, clearance_blocks(clearance, name).moved(pose)

    def ignored(self, kinds: Collection[JoinKind] = ("tab", "lap", "rim")) -> Ignored:
        """Return the pairs of joined faces, which may overlap: in the model, a tab lies in or on the plane it is
        glued to.
        """
        glued = (join for join in self.roles.car.joins if join.kind in kinds)
        ends = [(title(join.piece_a, join.a.face), title(join.piece_b, join.b.face)) for join in glued]
        return frozenset(ends) | {(b, a) for a, b in ends}

    def _build_face(self, name: str, face_name: str) -> Blocks:
        """Return the solids of a face in its own frame, without its tongues, and without the strips that bend at
        its folds.
        """
        piece, face = self.roles.pieces[name], self.roles.faces[name][face_name]
        folds = (ref for c in piece.creases if not c.bend for ref in (c.parent, c.child) if ref.face == face_name)
        lines = (shapely.LineString(side(face.outline_mm, ref.index)) for ref in folds)
        bends = (line.buffer(piece.thickness_mm / 2, cap_style="flat") for line in lines)
        shape: shapely.Geometry = polygon(face)
        for removed in (*self._tongues[name, face_name], *bends):
            shape = shape.difference(removed)
        return plate(shape, piece.thickness_mm, title(name, face_name))

    def _through(self, join: Join) -> Iterator[tuple[str, shapely.Geometry]]:
        """Yield, for each face of a piece with a tongue, the part of it that is in the slot of a join: (name of
        the face, region).

        The region is a band of the face, from the near side of the slotted film to just behind the tip of the tongue.
        All faces of the piece are cut, because several tongues may share a slot. If a piece locks into itself, only
        the face of the tongue is cut, because the slot is in another face of the piece.
        """
        roles, piece = self.roles, self.roles.pieces[join.piece_a]
        tip = np.mean(edge(roles.faces[join.piece_a], join.a), axis=0)
        copies = ([copy for copy in roles.car.placed if copy.piece == name] for name in (join.piece_a, join.piece_b))
        # A piece with a tongue occurs only once in a body, so the body tells which copies are joined.
        tongue, slotted = next(pair for pair in itertools.product(*copies) if pair[0].body == pair[1].body)
        to_slot = inverse(roles.pose_of(slotted, join.b.face))
        # The tip's height over the slot's face; negative if the tongue comes from above.
        height = apply(compose(to_slot, roles.pose_of(tongue, join.a.face)), *tip)[2]
        half_film = roles.pieces[join.piece_b].thickness_mm / 2
        for face in (face for face in piece.faces if join.piece_a != join.piece_b or face.name == join.a.face):
            # The face's pose relative to the slot's face; heights count in the direction of the tip.
            relative = np.array(compose(to_slot, roles.pose_of(tongue, face.name))) * (1.0 if height > 0 else -1.0)
            # Height of (x, y) of the face over the film: slope @ (x, y) + offset.
            slope, offset = relative[2, :2], relative[2, 3]
            heights = np.array(face.outline_mm) @ slope + offset
            if np.linalg.norm(slope) > UPRIGHT and heights.max() > -half_film:
                yield face.name, _band(slope, offset, -half_film, abs(height) + BEHIND_MM)


def _band(slope: NDArray[np.float64], offset: float, low: float, high: float) -> shapely.Geometry:
    """Return the band of a plane (mm) in which low ≤ slope · point + offset ≤ high, as a long rectangle."""
    steepness = float(np.linalg.norm(slope))
    direction = slope / steepness
    half_length = np.array((-direction[1], direction[0])) * FAR_MM
    first, last = direction * (low - offset) / steepness, direction * (high - offset) / steepness
    return shapely.Polygon([first - half_length, first + half_length, last + half_length, last - half_length])
