"""The role of each piece and part of a folded car in its assembly; the lids of beams.

Input: a FoldedCar. Output: its beams, their lids, layers, caps, carriers of boards and fasteners. All roles follow from
joins, creases and mounts.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from foldcar.car.folded.model import Face, FoldedCar, Join, Mount, Piece, PlacedPiece, Pose, Solid, ToolClearance
from foldcar.car.folded.placed import polygon
from foldcar.car.folded.pose import apply, compose, folded, inverse
from foldcar.car.parts.bought import Screw
from foldcar.car.proof.step import PartKey

PARALLEL = 0.999
# A shank stands in a bore if it overlaps the bore's wall by no more than this.
TOUCH_MM = 0.1
# Layers lie closer than this to the face they are glued to.
LAYER_MM = 1.5


class Host(NamedTuple):
    """What something is fixed to: a copy of a piece, and the face of it."""

    piece: PlacedPiece
    face: str


@lru_cache(maxsize=16)
def roles_of(car: FoldedCar) -> "Roles":
    """Return the roles in a car."""
    return Roles(car)


class Roles:
    """The roles in one car.

    ``segments`` and ``wheels`` are the names of its bodies, and ``wheel_units`` the wheels of each unit, which are alike.
    ``beams`` has the beam of each segment, to which all else is fixed, and ``beam_names`` the names of their pieces.
    ``finished_poses`` has the poses of the faces of each folded piece, in the frame of its first face. ``host`` and
    ``held_by`` are the cached methods below.
    """

    def __init__(self, car: FoldedCar) -> None:
        """Derive the roles from the pieces, parts and joins of a car."""
        self.car = car
        # What the car has, by name.
        self.pieces = {piece.name: piece for piece in car.pieces}
        self.faces = {piece.name: {face.name: face for face in piece.faces} for piece in car.pieces}
        self.copies = {(copy.piece, copy.copy): copy for copy in car.placed}
        self.mounts = {mount.name: mount for mount in car.mounts}
        self.finished_poses = {piece.name: folded(piece) for piece in car.pieces}
        # The rigid bodies of the car.
        self.segments = sorted({copy.body for copy in car.placed if copy.body.startswith("segment")})
        self.wheels = [axle.wheel for axle in car.axles]
        self.wheel_units: dict[str, list[str]] = {}
        for axle in car.axles:
            self.wheel_units.setdefault(axle.unit, []).append(axle.wheel)
        # The *beam* of a segment, the box that carries all else, is its largest piece.
        area = {piece.name: sum(polygon(face).area for face in piece.faces) for piece in car.pieces}
        self.beams = {body: max(self.placed(body), key=lambda copy: area[copy.piece]) for body in self.segments}
        self.beam_names = {copy.piece for copy in self.beams.values()}
        self.lids = {name: lid_of(car, self.pieces[name]) for name in sorted(self.beam_names)}
        # The kinds of parts.
        self.board_names = {car.parts.feather.name, car.parts.featherwing.name}
        self.fastener_names = {part.name for part in car.parts.bought if isinstance(part, Screw)}
        # The results of these two methods are remembered.
        self.host = cache(self._host)
        self.held_by = cache(self._held_by)

    def placed(self, body: str) -> list[PlacedPiece]:
        """Return the copies of pieces in a body."""
        return [copy for copy in self.car.placed if copy.body == body]

    def non_beam_copies(self) -> Iterator[PlacedPiece]:
        """Yield the copies of pieces in all segments, without the beams."""
        for body in self.segments:
            yield from (copy for copy in self.placed(body) if copy is not self.beams[body])

    def _host(self, copy: PlacedPiece) -> Host | None:
        """Return the piece and the face that carry a copy of a piece: it is glued to them and moves with them.

        If it is glued to several pieces, the *beam* of its segment comes first, the box that carries all others. A
        *layer* lies flat on the face that carries it, and carries no other piece. The result is None for a beam, and
        for a piece that is glued to nothing.
        """
        beam = self.beams.get(copy.body)
        if beam is None or copy is beam:
            return None
        # The names of the faces to which the copy is glued, by the names of their pieces.
        glued_faces: dict[str, list[str]] = defaultdict(list)
        for join in self.joined(copy.piece):
            if join.kind in GLUED:
                piece, face = _partner(join, copy.piece)
                glued_faces[piece].append(face)
        is_layer = self.is_layer(copy)
        others = [other for other in self.placed(copy.body) if other not in (beam, copy)]
        for other in (beam, *others):
            for face in glued_faces[other.piece]:
                carries_layer = is_layer and self._lies_on(copy, other, face)
                carries_other_piece = not is_layer and not self.is_layer(other)
                if carries_layer or carries_other_piece:
                    return Host(other, face)
        return None

    def mount_host(self, mount: Mount) -> Host | None:
        """Return the piece and the face that a mount is fixed to; None for a mount that is fixed to none."""
        candidates = (*([self.beams[mount.body]] if mount.body in self.beams else []), *self.placed(mount.body))
        hosts = [Host(copy, mount.face) for copy in candidates if mount.face in self.finished_poses[copy.piece]]
        # Both caps of a segment have a face of the same name: that with the mount's hole is meant.
        with_hole = (host for host in hosts if self._holes(host) & set(mount.holes))
        return next(with_hole, next(iter(hosts), None))

    def _holes(self, host: Host) -> set[str]:
        piece = self.pieces[host.piece.piece]
        return {hole.name for face in piece.faces if face.name == host.face for hole in face.holes}

    def is_on_lid(self, mount: Mount) -> bool:
        """Return whether a mount lies on the outer side of a lid."""
        host = self.mount_host(mount)
        host_on_beam = self._on_beam(host, mount.body)
        if host is None or host_on_beam is None or self.is_fastener(mount):
            return False
        lid = self.lids[host_on_beam.piece.piece]
        if host_on_beam.face not in lid.faces:
            return False
        # z of a face's frame points to its printed side, which is inside the car. So what is outside has negative z.
        mount_in_face = compose(inverse(self.pose_of(host.piece, host.face)), mount.pose)
        return _height_mm(mount_in_face) < 0

    def _on_beam(self, host: Host | None, body: str) -> Host | None:
        """Return the face of a beam on which something is fixed, directly or by other pieces.

        ``host`` is the piece that it is fixed to, and ``body`` its body. The result is None if no beam carries the host.
        """
        while host is not None and host.piece is not self.beams.get(body):
            host = self.host(host.piece)
        return host

    def pose_of(self, copy: PlacedPiece, face: str) -> Pose:
        """Return the pose of a face in the finished car."""
        return compose(copy.pose, self.finished_poses[copy.piece][face])

    def all_folded(self, piece: str) -> dict[str, float]:
        """Return the fractions of a folded piece's folds: 1 for each crease."""
        return {crease.name: 1.0 for crease in self.pieces[piece].creases}

    def joined(self, piece: str) -> list[Join]:
        """Return the joins of a piece with others."""
        return [j for j in self.car.joins if (j.piece_a == piece) != (j.piece_b == piece)]

    def is_layer(self, copy: PlacedPiece) -> bool:
        """Return whether a copy is of a flat piece whose only joins are laminations."""
        return not self.pieces[copy.piece].creases and {j.kind for j in self.joined(copy.piece)} == {"laminate"}

    def is_connector(self, copy: PlacedPiece) -> bool:
        """Return whether a copy belongs to a hinge: it is the strip that joins two segments, or a stop.

        A stop is joined to caps only, whereas all other pieces are joined to a beam.
        """
        if any(crease.flexure for crease in self.pieces[copy.piece].creases):
            return True
        partner_names = {_partner(join, copy.piece)[0] for join in self.joined(copy.piece)}
        return bool(partner_names) and partner_names.isdisjoint(self.beam_names)

    def is_wound(self, piece: str) -> bool:
        """Return whether a piece is wound around discs, into whose edges it hooks."""
        return any(join.kind == "rim" and join.piece_a == piece for join in self.joined(piece))

    def carried(self, copy: PlacedPiece) -> list[Mount]:
        """Return the mounts on a piece that are on faces of its own, not on faces that its beam has, too."""
        faces = {face.name for face in self.pieces[copy.piece].faces}
        if copy.body in self.beams:
            beam = self.pieces[self.beams[copy.body].piece]
            faces -= {face.name for face in beam.faces}
        return [mount for mount in self.car.mounts if mount.body == copy.body and mount.face in faces]

    def is_carrier(self, copy: PlacedPiece) -> bool:
        """Return whether a copy carries boards, which are screwed to it before it goes in."""
        return any(mount.part in self.board_names for mount in self.carried(copy))

    def is_fastener(self, mount: Mount) -> bool:
        """Return whether a mount is a screw, with its nut."""
        return mount.part in self.fastener_names

    def _held_by(self, screw: Mount) -> list[Mount]:
        """Return the mounts with bores through which a screw passes."""
        others = [m for m in self.car.mounts if not self.is_fastener(m)]
        return [m for m in others if any(stands_in(screw, a, m, b) for a in screw.solids for b in m.solids)]

    def passed_by(self, screw: Mount) -> tuple[PartKey, ...]:
        """Return the parts and the pieces of film that the shank of a screw passes through, in order from its head."""
        # A screw's solids are its head, its shank and its nut. The origin of the shank's frame is its middle, and z
        # points to the head. So what is nearer to the head has a greater height in this frame.
        shank = screw.solids[1]
        car_to_shank = inverse(compose(screw.pose, shank.pose))
        passed: list[PassedPart] = []
        # If a part has several solids around the shank, the one that is nearest to the head counts.
        for mount in self.held_by(screw):
            around_shank = [solid for solid in mount.solids if stands_in(screw, shank, mount, solid)]
            heights = [_height_mm(compose(car_to_shank, mount.pose, solid.pose)) for solid in around_shank]
            if heights:
                passed.append(PassedPart(max(heights), PartKey("mount", mount.name, 0)))
        for copy in self.placed(screw.body):
            for face in self.pieces[copy.piece].faces:
                face_in_shank = compose(car_to_shank, self.pose_of(copy, face.name))
                if _is_pierced(face, face_in_shank, shank):
                    key = PartKey("piece", copy.piece, copy.copy)
                    passed.append(PassedPart(_height_mm(face_in_shank), key))
        from_head = sorted(passed, key=lambda part: -part.height_mm)
        return tuple(part.key for part in from_head)

    def from_outside(self, mount: Mount, clearance: ToolClearance) -> bool:
        """Return whether a tool reaches the mount while the lid is shut.

        The space that the tool needs, its ``clearance``, is a cylinder from the mount to the hand. The tool reaches the
        mount if the cylinder starts outside the segment, or if it leaves the segment through a wall or the floor, but not
        through the lid.
        """
        beam = self.beams.get(mount.body)
        if beam is None:
            return True
        # The bounds of the segment's box in the car's frame.
        corners = []
        for face in self.pieces[beam.piece].faces:
            if face.role == "panel":
                corners += [apply(self.pose_of(beam, face.name), *point) for point in face.outline_mm]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        # The two ends of the cylinder.
        pose = compose(mount.pose, clearance.pose)
        start = np.array(apply(pose, 0.0, 0.0, 0.0))
        end = np.array(apply(pose, 0.0, 0.0, clearance.length_mm))
        starts_inside = bool(((start > low) & (start < high)).all())
        # The lid is the upper bound along z, so only the upper bounds along x and y are compared.
        leaves_through_wall_or_floor = bool((end < low).any() or (end > high)[:2].any())
        return not starts_inside or leaves_through_wall_or_floor

    def _lies_on(self, copy: PlacedPiece, other: PlacedPiece, name: str) -> bool:
        """Return whether a flat piece lies on the face ``name`` of another piece: close to it and inside its outline."""
        piece_in_face = compose(inverse(self.pose_of(other, name)), copy.pose)
        # One point of the piece stands for all.
        flat_face = self.pieces[copy.piece].faces[0]
        middle = polygon(flat_face).representative_point()
        x, y, z = apply(piece_in_face, middle.x, middle.y)
        outline = shapely.Polygon(self.faces[other.piece][name].outline_mm)
        is_inside = bool(outline.contains(shapely.Point(x, y)))
        return is_inside and _is_parallel(piece_in_face) and abs(z) < LAYER_MM


class PassedPart(NamedTuple):
    """A part that the shank of a screw passes through, and its height in the frame of the shank (mm)."""

    height_mm: float
    key: PartKey


def _height_mm(pose: Pose) -> float:
    """Return z of a pose's origin (mm)."""
    _, _, z = apply(pose, 0.0, 0.0)
    return z


def _is_parallel(pose: Pose) -> bool:
    """Return whether z of a pose's frame is parallel to z of the frame in which the pose is given, or opposite to it."""
    z_row = pose[2]
    cosine = z_row[2]
    return abs(cosine) > PARALLEL


def _is_pierced(face: Face, face_in_shank: Pose, shank: Solid) -> bool:
    """Return whether the shank of a screw passes through a face, whose pose in the frame of the shank is given.

    The face must lie across the shank, between its ends, and have the shank's axis inside its outline.
    """
    is_between_ends = abs(_height_mm(face_in_shank)) < shank.size_mm[2] / 2
    if not _is_parallel(face_in_shank) or not is_between_ends:
        return False
    axis_x, axis_y, _ = apply(inverse(face_in_shank), 0.0, 0.0)
    return bool(shapely.Polygon(face.outline_mm).contains(shapely.Point(axis_x, axis_y)))


def _partner(join: Join, piece: str) -> tuple[str, str]:
    """Return the names of the piece and the face that a join connects with ``piece``."""
    if join.piece_a == piece:
        return join.piece_b, join.b.face
    return join.piece_a, join.a.face


# Permanent joins; locks and tucks can be opened.
GLUED = frozenset({"lap", "tab", "rim", "laminate"})


@dataclass(frozen=True)
class Lid:
    """The part of a beam that opens.

    ``creases`` are the folds that open it, its hinge first. ``joins`` are the numbers of the joins that shut it.
    ``gripped`` are the faces that fingers press or hold to open it.
    """

    faces: frozenset[str]
    creases: tuple[str, ...]
    joins: tuple[int, ...]
    gripped: tuple[Face, ...] = ()


def lid_of(car: FoldedCar, beam: Piece) -> Lid:
    """Return the lid of a beam: its face ``lid`` and all faces that hang on it.

    The *beam* is the box of a segment, which is folded from one piece. A beam that is not locked has no lid, and the
    result has no faces then.
    """
    is_locked = any(join.kind == "lock" and join.piece_a == join.piece_b == beam.name for join in car.joins)
    if not is_locked:
        return Lid(frozenset(), (), ())
    moving = {face.name for face in beam.faces if face.name.rpartition(".")[2] == "lid"}
    for crease in beam.creases:
        if crease.parent.face in moving:
            moving.add(crease.child.face)
    panels = {face.name for face in beam.faces if face.name in moving and face.role == "panel"}
    crease_names = tuple(crease.name for crease in beam.creases if crease.child.face in panels)
    # The joins that shut the lid connect it with something else. A join between two of its own faces does not shut it.
    closing_joins = set()
    for join in car.joins:
        a_is_on_lid = join.piece_a == beam.name and join.a.face in moving
        b_is_on_lid = join.piece_b == beam.name and join.b.face in moving
        connects_lid_with_other = a_is_on_lid != b_is_on_lid
        if join.kind in ("lock", "tuck") and connects_lid_with_other:
            closing_joins.add(join.number)
    # Fingers grip the faces that require a clearance.
    with_clearance = tuple(face for face in beam.faces if face.name in moving and face.clearances)
    return Lid(frozenset(moving), crease_names, tuple(sorted(closing_joins)), gripped=with_clearance)


def stands_in(screw: Mount, solid: Solid, other: Mount, bored: Solid) -> bool:
    """Return whether a cylinder of a screw, such as its shank, stands in a bore of another part.

    ``solid`` is the solid of the screw, and ``bored`` is the solid of the part ``other``.
    """
    if solid.kind != "cylinder" or not bored.bores:
        return False
    # A cylinder's frame has its origin in its middle and z along its axis. Bores run along z of the bored solid's frame.
    # So in that frame, the cylinder's z must be parallel to z.
    cylinder_in_car = compose(screw.pose, solid.pose)
    bored_in_car = compose(other.pose, bored.pose)
    cylinder_in_bored = np.array(compose(inverse(bored_in_car), cylinder_in_car))
    x, y, z = cylinder_in_bored[:3, 3]
    _, _, z_of_axis = cylinder_in_bored[:3, 2]
    is_parallel = abs(z_of_axis) >= PARALLEL
    overlaps_along_z = abs(z) < (solid.size_mm[2] + bored.size_mm[2]) / 2
    if not is_parallel or not overlaps_along_z:
        return False
    radius_mm = solid.size_mm[0] / 2
    for bore_x, bore_y, bore_mm in bored.bores:
        if np.hypot(x - bore_x, y - bore_y) + radius_mm <= bore_mm / 2 + TOUCH_MM:
            return True
    return False
