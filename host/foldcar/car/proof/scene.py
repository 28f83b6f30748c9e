"""The solids of a car's pieces and mounts at a stage of its assembly.

Input: a FoldedCar's roles and a Stage. Output: Blocks in the car's frame. A face ends half a film before a fold, where
film bends; tongues are cut off where they reach into what they lock into.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator
from functools import cache
from typing import NamedTuple

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
        """Return how a part that is fixed to ``host`` has moved from its place in the finished car to that at this stage.

        The motion is given in the car's frame. A part without a host does not move.
        """
        if host is None:
            return IDENTITY
        piece, face = host
        # The piece to which the part is fixed may itself be fixed to a face that has moved.
        motion_of_piece = self._shift(self.roles.host(piece))
        # The pose of the face in the frame of its piece's first face: in the finished car, and as the piece is folded
        # now.
        finished_pose = self.roles.finished_poses[piece.piece][face]
        current_pose = self._folded(piece.piece)[face]
        if current_pose == finished_pose:
            return motion_of_piece
        # A point of the part is first given in the frame of its piece, and then in that of the finished face. As it keeps
        # its place on the face, it comes back by the current pose of the face. So the poses apply from right to left.
        return compose(motion_of_piece, piece.pose, current_pose, inverse(finished_pose), inverse(piece.pose))


TONGUES = frozenset({"lock", "tab_slot", "rim"})
# Tongues leave the plane of their slot at an angle whose sine is more than this.
UPRIGHT = 0.3
FAR_MM = 1000.0
# Distance by which tongues extend behind the tip that a join names.
BEHIND_MM = 1.0


def title(piece: str, face: str) -> str:
    """Return the name of a face in findings."""
    return f"{piece}: {face}"


class TongueRegion(NamedTuple):
    """The region of a tongue that is cut off: the name of the face, and a part of this face in its own frame."""

    face: str
    region: shapely.Geometry


class Height(NamedTuple):
    """The height of the points of a face above another face: that of a point (x, y) is slope · (x, y) + offset."""

    slope: NDArray[np.float64]
    offset: float


def _height_of_points(face_in_other: Pose, upwards: float) -> Height:
    """Return the height of a face's points above another face, from the pose of the face in the frame of that one.

    ``upwards`` is 1 if heights are counted along z of the other face, and -1 if they are counted along -z.
    """
    # The third row of a pose gives z of a point.
    slope_x, slope_y, _, offset = upwards * np.array(face_in_other)[2]
    return Height(np.array((slope_x, slope_y)), offset)


class CarSolids:
    """The solids of one car. Without ``tongues``, a tongue is cut off where it is inside its slot."""

    def __init__(self, roles: Roles, tongues: bool = False) -> None:
        """Prepare to compute the solids of a car's parts.

        A tongue of a piece goes through a slot of another piece, and would overlap it. So the ends of tongues are cut
        off, unless ``tongues`` is True.
        """
        self.roles = roles
        # The solids of pieces and mounts, and the poses for which they were computed last.
        self._latest: dict[PartKey, tuple[dict[str, Pose], Blocks]] = {}
        # The regions that are cut off from each face, by the names of its piece and the face.
        self._cut_off: dict[tuple[str, str], list[shapely.Geometry]] = defaultdict(list)
        if not tongues:
            for join in self._tongue_joins():
                for face, region in self._tongue_regions(join):
                    self._cut_off[join.piece_a, face].append(region)
        # The solids of each face and each mount in their own frames are built once.
        self._face = cache(self._build_face)
        self._mount = cache(_mount_solids)

    def _tongue_joins(self) -> list[Join]:
        """Return the joins of tongues and slots at which tongues are cut off, one join for each cut.

        A cut goes through all faces of the piece with the tongue. So if several tongues of a piece go into the same face,
        one cut is enough for all. If a piece locks into itself, a cut goes through one face only, that of the tongue. So
        there is a cut for each face with a tongue.
        """
        join_of_cut: dict[tuple[str, str | None, str, str], Join] = {}
        for join in self.roles.car.joins:
            if join.kind in TONGUES:
                locks_into_itself = join.piece_a == join.piece_b
                # None stands for all faces.
                cut_face = join.a.face if locks_into_itself else None
                join_of_cut[join.piece_a, cut_face, join.piece_b, join.b.face] = join
        return list(join_of_cut.values())

    def solid(self, key: PartKey, stage: Stage) -> Blocks:
        """Return the solids that a part fills at a stage of the assembly, in the car's frame.

        ``key`` names one of the equal copies of a folded piece, or a mount, which is a bought part. The result is empty
        for the wiring, whose wires are loose.
        As long as a part has not moved since the last call, that call's result is used again.
        """
        poses = stage.poses(key)
        if key in self._latest:
            latest_poses, blocks = self._latest[key]
            if latest_poses == poses:
                return blocks
        if key.kind == "piece":
            parts = [self._face(key.name, face).moved(pose) for face, pose in poses.items()]
        else:
            mount = self.roles.mounts[key.name]
            is_loose = mount.part == self.roles.car.parts.wiring.name
            parts = [] if is_loose else [self._mount(mount).moved(poses[key.name])]
        blocks = merge_blocks(parts)
        self._latest[key] = (poses, blocks)
        return blocks

    def screw(self, mount: Mount, stage: Stage) -> list[Blocks]:
        """Return head with shank, the first two solids of a screw, and then its nut, if it has one."""
        solids = [solid_blocks(solid, mount.name).moved(stage.mount(mount)) for solid in mount.shape]
        return [merge_blocks(solids[:2]), *solids[2:]]

    def clearance(self, tool_use: ToolUse, stage: Stage) -> tuple[ToolClearance, Blocks]:
        """Return the clearance that a tool needs, and the cylinder that it fills in the car.

        A tool is used at a face of a piece, if ``tool_use`` names one, or at a mount. The title of the cylinder is the
        name of this face or mount.
        """
        if tool_use.piece:
            face = self.roles.faces[tool_use.piece][tool_use.name]
            clearance = face.clearances[tool_use.index]
            reached = title(tool_use.piece, tool_use.name)
            # Tools are used at pieces that occur once.
            copy = self.roles.copies[tool_use.piece, 0]
            pose = stage.faces(copy)[tool_use.name]
        else:
            mount = self.roles.mounts[tool_use.name]
            clearance = mount.clearances[tool_use.index]
            reached = mount.name
            pose = stage.mount(mount)
        return clearance, clearance_blocks(clearance, reached).moved(pose)

    def ignored(self, kinds: Collection[JoinKind] = ("tab", "lap", "rim")) -> Ignored:
        """Return the pairs of joined faces, which may overlap: in the model, a tab lies in or on the plane it is
        glued to.
        """
        glued = (join for join in self.roles.car.joins if join.kind in kinds)
        ends = [(title(join.piece_a, join.a.face), title(join.piece_b, join.b.face)) for join in glued]
        return frozenset(ends) | {(b, a) for a, b in ends}

    def _build_face(self, name: str, face_name: str) -> Blocks:
        """Return the solids of a face in its own frame, with its holes.

        ``name`` is the name of the piece. Two things are left out: the parts of tongues that are in slots, and a strip
        along each of the face's folds, half a film wide, because the film bends there.
        """
        piece, face = self.roles.pieces[name], self.roles.faces[name][face_name]
        shape: shapely.Geometry = polygon(face)
        for region in self._cut_off[name, face_name]:
            shape = shape.difference(region)
        for crease in piece.creases:
            for ref in (crease.parent, crease.child):
                if ref.face == face_name and not crease.bend:
                    fold = shapely.LineString(side(face.outline_mm, ref.index))
                    shape = shape.difference(fold.buffer(piece.thickness_mm / 2, cap_style="flat"))
        return plate(shape, piece.thickness_mm, title(name, face_name))

    def _tongue_regions(self, join: Join) -> Iterator[TongueRegion]:
        """Yield the regions of a piece with tongues that are cut off because they are in a slot.

        A region is a band of a face: from the near side of the slotted film to just behind the tip of the tongue. All
        faces of the piece are cut, because several tongues may share a slot. If a piece locks into itself, only the face
        of the tongue is cut.
        """
        roles, piece = self.roles, self.roles.pieces[join.piece_a]
        tongue, slotted = self._joined_copies(join)
        # In the frame of the slotted face, z is the height above its film. If the tongue comes from above, its tip is
        # below the film, and heights are counted downwards. So the tip always has a positive height.
        car_to_slotted = inverse(roles.pose_of(slotted, join.b.face))
        tip = np.mean(edge(roles.faces[join.piece_a], join.a), axis=0)
        _, _, tip_z = apply(compose(car_to_slotted, roles.pose_of(tongue, join.a.face)), *tip)
        upwards = 1.0 if tip_z > 0 else -1.0
        near_side = -roles.pieces[join.piece_b].thickness_mm / 2
        locks_into_itself = join.piece_a == join.piece_b
        for face in piece.faces:
            if locks_into_itself and face.name != join.a.face:
                continue
            height = _height_of_points(compose(car_to_slotted, roles.pose_of(tongue, face.name)), upwards)
            corner_heights = np.array(face.outline_mm) @ height.slope + height.offset
            is_upright = np.linalg.norm(height.slope) > UPRIGHT
            reaches_slot = corner_heights.max() > near_side
            if is_upright and reaches_slot:
                band = _band(height.slope, height.offset, low=near_side, high=abs(tip_z) + BEHIND_MM)
                yield TongueRegion(face.name, band)

    def _joined_copies(self, join: Join) -> tuple[PlacedPiece, PlacedPiece]:
        """Return the first copies of both pieces of a join that are in the same body.

        A piece with a tongue occurs only once in a body, so the body tells which copies are joined.
        """
        for first in self.roles.car.placed:
            for second in self.roles.placed(first.body):
                if first.piece == join.piece_a and second.piece == join.piece_b:
                    return first, second
        raise ValueError(f"no body has both pieces of join {join.number}")


def _mount_solids(mount: Mount) -> Blocks:
    """Return the solids of a mount in its own frame."""
    return merge_blocks(solid_blocks(solid, mount.name) for solid in mount.shape)


def _band(slope: NDArray[np.float64], offset: float, low: float, high: float) -> shapely.Geometry:
    """Return the band of a plane (mm) in which low ≤ slope · point + offset ≤ high, as a long rectangle."""
    steepness = float(np.linalg.norm(slope))
    direction = slope / steepness
    half_length = np.array((-direction[1], direction[0])) * FAR_MM
    first, last = direction * (low - offset) / steepness, direction * (high - offset) / steepness
    return shapely.Polygon([first - half_length, first + half_length, last + half_length, last - half_length])
