"""What each piece and part of a folded car is for, as far as the order of assembly depends on it; the lids of beams.

Input: a FoldedCar. Output: its beams, what opens of them without harm, the layers, caps, carriers of boards and
fasteners. All follows from joins, creases and mounts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import shapely

from foldcar.car.folded.model import Access, Face, FoldedCar, Join, Mount, Piece, PlacedPiece
from foldcar.car.folded.placed import polygon
from foldcar.car.folded.pose import apply, compose, folded, inverse
from foldcar.car.parts.bought import Screw
from foldcar.car.proof.check_parts import stands_in
from foldcar.car.proof.step import Thing

PARALLEL = 0.999
# Layers lie closer than this to the face they are glued to.
LAYER_MM = 1.5
ON_AXIS_MM = 0.5
# A piece, and a face of it that something is fixed to.
Host = tuple[PlacedPiece, str] | None


@lru_cache(maxsize=16)
def roles_of(car: FoldedCar) -> "Roles":
    """The roles in a car."""
    return Roles(car)


class Roles:
    """The roles in one car."""

    def __init__(self, car: FoldedCar) -> None:
        self.car = car
        self.pieces = {piece.name: piece for piece in car.pieces}
        self.bodies = sorted({one.body for one in car.placed if one.body.startswith("segment")})
        self.wheels = [axle.wheel for axle in car.axles]
        area = {piece.name: sum(polygon(face).area for face in piece.faces) for piece in car.pieces}
        self.base = {body: max(self.placed(body), key=lambda one: area[one.piece]) for body in self.bodies}
        self.bases = {one.piece for one in self.base.values()}
        self.lids = {name: lid_of(car, self.pieces[name]) for name in self.bases}
        self.finished = {piece.name: folded(piece) for piece in car.pieces}
        self.fastener_names = {part.name for part in car.parts.bought if isinstance(part, Screw)}
        self.host = cache(self._host)
        self.held_by = cache(self._held_by)
        self.board_names = {car.parts.feather.name, car.parts.featherwing.name}

    def placed(self, body: str) -> list[PlacedPiece]:
        """The copies of pieces in a body."""
        return [one for one in self.car.placed if one.body == body]

    def others(self) -> Iterator[PlacedPiece]:
        """The copies of pieces in all segments, but for the beams."""
        for body in self.bodies:
            yield from (one for one in self.placed(body) if one is not self.base[body])

    def _host(self, one: PlacedPiece) -> Host:
        """The piece that a piece is fixed to, and the face of it that it moves with; None for a beam or a loose piece."""
        base = self.base.get(one.body)
        if base is None or one is base:
            return None
        layer = self.is_layer(one)
        for other in [base, *(p for p in self.placed(one.body) if p is not base and p is not one)]:
            fixed = [j for j in self.joined(one.piece) if j.kind in GLUED and other.piece in (j.piece_a, j.piece_b)]
            faces = [j.a.face if j.piece_a == other.piece else j.b.face for j in fixed]
            face = self._lies_on(one, other, faces) if layer else next(iter(faces), None)
            if face is not None and not (self.is_layer(other) and not layer):
                return other, face
        return None

    def mount_host(self, mount: Mount) -> Host:
        """The piece and its face that a mount is fixed to."""
        if mount.face is None:
            return None
        base = self.base.get(mount.body)
        pieces = [*([base] if base else []), *self.placed(mount.body)]
        return next(((one, mount.face) for one in pieces if mount.face in self.finished[one.piece]), None)

    def is_on_lid(self, mount: Mount) -> bool:
        """Whether a mount lies on the outer side of a lid."""
        base, host = self.base.get(mount.body), self.mount_host(mount)
        if base is None or host is None:
            return False
        on = self._on_beam(host, base)
        if on is None or on[1] not in self.lids[base.piece].faces:
            return False
        onto = inverse(compose(host[0].pose, self.finished[host[0].piece][host[1]]))
        # Printed sides, along +z of their frames, look inwards.
        return compose(onto, mount.pose)[2][3] < 0 and not self.is_fastener(mount)

    def face_under(self, one: PlacedPiece) -> str | None:
        """The face of its beam that a piece moves with; None for a beam and for what is fixed to none."""
        on = self._on_beam(self.host(one), self.base.get(one.body))
        return None if on is None else on[1]

    def _on_beam(self, host: Host, base: PlacedPiece | None) -> Host:
        """What a host is fixed to in the end, its beam; None if that is none."""
        while host is not None and host[0] is not base:
            host = self.host(host[0])
        return host

    def whole(self, piece: str) -> dict[str, float]:
        """The fractions of a piece's folds when it is folded: 1 for each crease."""
        return {crease.name: 1.0 for crease in self.pieces[piece].creases}

    def joined(self, piece: str) -> list[Join]:
        """The joins of a piece with others."""
        return [j for j in self.car.joins if (j.piece_a == piece) != (j.piece_b == piece)]

    def is_layer(self, one: PlacedPiece) -> bool:
        """Whether it is a flat piece that is only laminated to others."""
        return not self.pieces[one.piece].creases and {j.kind for j in self.joined(one.piece)} == {"laminate"}

    def is_between(self, one: PlacedPiece) -> bool:
        """Whether it joins segments or is fixed to other pieces than beams: hinge strips, stops."""
        if any(crease.flexure for crease in self.pieces[one.piece].creases):
            return True
        partners = {j.piece_b if j.piece_a == one.piece else j.piece_a for j in self.joined(one.piece)}
        return bool(partners) and not partners & self.bases

    def is_wound(self, piece: str) -> bool:
        """Whether a piece is wound around discs, into whose edges it hooks."""
        return any(join.kind == "rim" and join.piece_a == piece for join in self.joined(piece))

    def carried(self, one: PlacedPiece) -> list[Mount]:
        """The mounts on the faces of a piece that are not on its beam."""
        mine = {face.name for face in self.pieces[one.piece].faces}
        base = {face.name for face in self.pieces[self.base[one.body].piece].faces} if one.body in self.base else set()
        return [m for m in self.car.mounts if m.body == one.body and m.face in mine - base]

    def is_carrier(self, one: PlacedPiece) -> bool:
        """Whether it carries boards, which are screwed to it before it goes in."""
        return any(mount.part in self.board_names for mount in self.carried(one))

    def is_fastener(self, mount: Mount) -> bool:
        """Whether a mount is a screw, with its nut."""
        return mount.part in self.fastener_names

    def _held_by(self, screw: Mount) -> list[Mount]:
        """The mounts that a screw passes through, in bores of theirs."""
        others = [m for m in self.car.mounts if not self.is_fastener(m)]
        return [m for m in others if any(stands_in(screw, a, m, b) for a in screw.solids for b in m.solids)]

    def passed_by(self, screw: Mount) -> tuple[Thing, ...]:
        """What the shank of a screw, the second of its solids, passes, from the head on: parts with bores, and film."""
        if len(screw.solids) < 2:
            return ()
        shank = screw.solids[1]
        onto = inverse(compose(screw.pose, shank.pose))
        half = shank.size_mm[2] / 2
        found: list[tuple[float, Thing]] = []
        for mount in self.held_by(screw):
            held = [solid for solid in mount.solids if stands_in(screw, shank, mount, solid)]
            heights = [compose(onto, mount.pose, solid.pose)[2][3] for solid in held]
            found += [(max(heights), ("mount", mount.name, 0))] if heights else []
        for one in self.placed(screw.body):
            for face in self.pieces[one.piece].faces:
                pose = np.array(compose(onto, one.pose, self.finished[one.piece][face.name]))
                x, y, _ = -pose[:3, :3].T @ pose[:3, 3]
                flat = abs(pose[2, 2]) > PARALLEL and abs(pose[2, 3]) < half
                if flat and shapely.Polygon(face.outline_mm).contains(shapely.Point(x, y)):
                    found.append((pose[2, 3], ("piece", one.piece, one.copy)))
        return tuple(thing for _, thing in sorted(found, key=lambda one: -one[0]))

    def from_outside(self, mount: Mount, access: Access) -> bool:
        """Whether an access leads out of a segment, or starts outside it, other than through the lid above."""
        if mount.body not in self.base:
            return True
        base = self.base[mount.body]
        panels = [face for face in self.pieces[base.piece].faces if face.role == "panel"]
        poses = {face.name: compose(base.pose, self.finished[base.piece][face.name]) for face in panels}
        corners = np.array([apply(poses[face.name], *point) for face in panels for point in face.outline_mm])
        pose = compose(mount.pose, access.pose)
        start, end = (np.array(apply(pose, 0.0, 0.0, z)) for z in (0.0, access.length_mm))
        low, high = corners.min(axis=0), corners.max(axis=0)
        if not ((start > low) & (start < high)).all():
            return True
        return bool((end < low).any() or (end > high)[:2].any())

    def is_tyre(self, mount: Mount) -> bool:
        """Whether a mount is stretched over a wheel."""
        return mount.body in self.wheels and mount.part != self.car.parts.horn.name and not self.is_fastener(mount)

    def on_axis(self, mount: Mount) -> bool:
        """Whether a mount of a wheel lies on the wheel's axis: the horn's centre screw."""
        axle = next(axle for axle in self.car.axles if axle.wheel == mount.body)
        x, z = (mount.pose[i][3] - axle.center_mm[i] for i in (0, 2))
        return bool(np.hypot(x, z) < ON_AXIS_MM)

    def _lies_on(self, one: PlacedPiece, other: PlacedPiece, faces: Sequence[str]) -> str | None:
        """The one of some faces of a piece that another piece lies on; None if it lies on none."""
        root = self.pieces[one.piece].faces[0]
        middle = np.array([*polygon(root).representative_point().coords[0], 0.0, 1.0])
        here = np.array(one.pose)
        for face in (face for face in self.pieces[other.piece].faces if face.name in faces):
            there = np.array(compose(other.pose, self.finished[other.piece][face.name]))
            x, y, z, _ = np.linalg.inv(there) @ here @ middle
            near = abs(float(here[:3, 2] @ there[:3, 2])) > PARALLEL and abs(z) < LAYER_MM
            if near and shapely.Polygon(face.outline_mm).contains(shapely.Point(x, y)):
                return face.name
        return None


# Joins that hold for good; locks and tucks open again.
GLUED = frozenset({"lap", "tab", "rim", "laminate"})


@dataclass(frozen=True)
class Lid:
    """The part of a beam that opens: faces, the folds that open it, its hinge first, and the joins that shut it.

    ``gripped`` are those of the faces that fingers press or hold to open it.
    """

    faces: frozenset[str]
    creases: tuple[str, ...]
    joins: tuple[int, ...]
    gripped: tuple[Face, ...] = ()


def lid_of(car: FoldedCar, base: Piece) -> Lid:
    """The lid of a beam: the faces between a lock and the first face that is glued to something; none without a lock.

    Climbs from the tongue of a lock within the beam towards the root, and stops before a face from which glue leads to
    what does not move with it.
    """
    faces = {face.name: face for face in base.faces}
    parents = {crease.child.face: crease for crease in base.creases}
    locks = [j for j in car.joins if j.kind == "lock" and j.piece_a == j.piece_b == base.name]
    moving: set[str] = set()
    opening: list[str] = []
    for lock in locks:
        face = lock.b.face
        still = {face}
        while face in parents:
            face = parents[face].parent.face
            still.add(face)
        at, folds = lock.a.face, []
        while at in parents and at not in still:
            # The face and all that hang on it.
            below = {at}
            for crease in base.creases:
                if crease.parent.face in below:
                    below.add(crease.child.face)
            if _glued_elsewhere(car, base, below):
                break
            moving |= below
            if faces[at].role == "panel":
                folds.append(parents[at].name)
            at = parents[at].parent.face
        opening += [name for name in reversed(folds) if name not in opening]
    order = [crease.name for crease in base.creases if crease.name in opening]
    ends = {(base.name, face) for face in moving}
    shutting = {
        j.number
        for j in car.joins
        if j.kind in ("lock", "tuck") and len(ends & {(j.piece_a, j.a.face), (j.piece_b, j.b.face)}) == 1
    }
    gripped = tuple(face for face in base.faces if face.name in moving and face.accesses)
    return Lid(frozenset(moving), tuple(order), tuple(sorted(shutting)), gripped)


def _glued_elsewhere(car: FoldedCar, base: Piece, faces: set[str]) -> bool:
    """Whether glue joins these faces of a beam to faces that do not move with them.

    A flat piece laminated to the faces alone moves with them.
    """
    layers = {piece.name for piece in car.pieces if not piece.creases}
    for join in car.joins:
        ends = ((join.piece_a, join.a.face), (join.piece_b, join.b.face))
        inside = [piece == base.name and face in faces for piece, face in ends]
        if join.kind not in GLUED or not any(inside) or all(inside):
            continue
        if join.kind != "laminate" or ends[inside.index(False)][0] not in layers:
            return True
    return False
