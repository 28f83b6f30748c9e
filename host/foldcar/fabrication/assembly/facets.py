"""Converts faces of film and bought parts to facets to be drawn, in the car's frame.

Input: pieces with their poses and fold fractions, mounts. Output: Facets and the lines along their edges.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from foldcar.car.folded.model import Hole, Mount, Piece, Solid
from foldcar.fabrication.assembly.faces import Fraction, Matrix, face_poses, glued_offset_mm, mount_material, moved
from foldcar.fabrication.assembly.hidden_surfaces import Facet, Vector

SMALL_HOLE_MM = 4.0
CYLINDER_ENDS = 2
# A part of at least this number of boxes is a ring around z, such as a tyre, and is drawn round.
RING_SOLIDS, RING_SIDES = 16, 40
CYLINDER_SIDES, SMALL_CYLINDER_SIDES = 16, 8
HOLE_SIDES, SMALL_HOLE_SIDES = 16, 10

NUT_OF = "nut of "

LineKind = Literal["cut", "mountain", "valley", "flat"]


class SolidSide(NamedTuple):
    """A flat side of a solid: its outline and its holes, each (n, 3), and the direction (3,) away from the solid."""

    rings_mm: tuple[Vector, ...]
    normal: Vector


class EdgeStyle(NamedTuple):
    """How an edge of a face is drawn. ``kind`` is None if no line is drawn there.

    ``other_face`` is the face on the other side of the edge. The line is also drawn if only that face is visible.
    """

    kind: LineKind | None
    other_face: str | None = None


CUT = EdgeStyle("cut")


@dataclass(frozen=True)
class EdgeLine:
    """A line along an edge of a facet, or along the fold between two facets. It is drawn where one of them is visible."""

    keys: tuple[str, ...]
    ends_mm: Vector
    kind: LineKind


@dataclass(frozen=True)
class PictureContent:
    """The content of one picture: facets and their lines."""

    facets: tuple[Facet, ...]
    lines: tuple[EdgeLine, ...]


def merge_shapes(shapes: Iterable[PictureContent]) -> PictureContent:
    """Merge several shapes to one; their keys must differ."""
    facets, lines = zip(*((shape.facets, shape.lines) for shape in shapes), strict=True)
    return PictureContent(tuple(itertools.chain(*facets)), tuple(itertools.chain(*lines)))


def film_shape(
    piece: Piece,
    pose: Matrix,
    fraction: Fraction = 1.0,
    prefix: str = "",
    tabs: bool = True,
    creases: bool = True,
) -> PictureContent:
    """Return the facets and lines that are drawn of a piece of film, the plastic sheet of which the car is folded.

    ``pose`` is the pose of the piece's root face, from which its other faces are folded by ``fraction``: 0 is flat, 1 is
    folded. The key of a facet is ``prefix`` and the name of its face. If ``creases`` is True, folds are drawn as folds,
    otherwise as edges. If ``tabs`` is False, tabs are left out.
    """
    poses = {name: pose @ local_pose for name, local_pose in face_poses(piece, fraction).items()}
    facets, lines = [], []
    offsets = glued_offset_mm(piece, fraction)
    shown_faces = {face.name for face in piece.faces if tabs or face.role != "tab"}
    folds = _folded_edges(piece, shown_faces)
    for face in piece.faces:
        if face.name not in shown_faces:
            continue
        face_pose, key = poses[face.name].copy(), prefix + face.name
        # A glued face is drawn beside the face that it lies on, not in the same plane.
        face_pose[:3, 3] += offsets.get(face.name, 0.0) * face_pose[:3, 2]
        outline = moved(face_pose, np.array(face.outline_mm))
        holes = [moved(face_pose, _hole_ring(hole)) for hole in face.holes]
        facets.append(Facet(key, (outline, *holes), face_pose[:3, 2]))
        for index, ends in enumerate(_edges(outline)):
            style = folds.get((face.name, index), CUT)
            if style.kind is not None:
                # A fold is visible if the face on one of its sides is.
                keys = (key,) if style.other_face is None else (key, prefix + style.other_face)
                lines.append(EdgeLine(keys, ends, style.kind if creases else "cut"))
        for hole in holes:
            lines += [EdgeLine((key,), ends, "cut") for ends in _edges(hole)]
    return PictureContent(tuple(facets), tuple(lines))


def mount_shape(mount: Mount, pose: Matrix | None = None) -> PictureContent:
    """Return what is drawn of a bought part: its solids or, if it has none, its box.

    ``pose`` is its place in the car by default.
    """
    pose = np.array(mount.pose) if pose is None else pose
    facets, lines = [], []
    # A tyre is described by many equal boxes around its axis. It is drawn as a ring instead.
    is_ring = len(mount.solids) >= RING_SOLIDS and len({solid.size_mm for solid in mount.solids}) == 1
    # The kind of each drawn solid, and its sides.
    if is_ring:
        drawn_solids = [("round", _ring(mount, pose))]
    else:
        drawn_solids = [(solid.kind, _sides(solid, pose @ np.array(solid.pose))) for solid in mount.shape]
    for solid_number, (kind, sides) in enumerate(drawn_solids):
        for side_number, side in enumerate(sides):
            key = f"{mount.name} {solid_number}.{side_number}"
            facets.append(Facet(key, side.rings_mm, side.normal, mount_material(mount), closed=True))
            # The first sides of a round solid are its ends, which have lines around them. The other ones together are
            # its round side, where they meet without a line.
            is_end = side_number < CYLINDER_ENDS
            if kind == "box" or is_end:
                for ring in side.rings_mm:
                    lines += [EdgeLine((key,), ends, "cut") for ends in _edges(ring)]
    return PictureContent(tuple(facets), tuple(lines))


def _edges(ring: Vector) -> Vector:
    """Return both ends of each edge, (n, 2, 3)."""
    return np.stack([ring, np.roll(ring, -1, 0)], axis=1)


def shank_and_nut(screw: Mount) -> tuple[Mount, Mount]:
    """Split a screw into two parts: head with shank, and its nut, which gets a name of its own."""
    return replace(screw, solids=screw.solids[:2]), replace(screw, name=f"{NUT_OF}{screw.name}", solids=screw.solids[2:])


def _ring(mount: Mount, pose: Matrix) -> Iterator[SolidSide]:
    """Yield the sides of a ring, such as a tyre: its lower and its upper face, then its outer side in RING_SIDES parts.

    The ring fills the box of the mount, around the z axis of its ``pose``. It is as thick as the first of the mount's
    solids.
    """
    circle = _circle(RING_SIDES)
    outer_mm, half_height_mm = mount.size_mm[0] / 2, mount.size_mm[2] / 2
    inner_mm = outer_mm - min(mount.solids[0].size_mm)

    def moved_circle(radius_mm: float, z_mm: float) -> Vector:
        """Return the corners of a circle around the z axis, at its place in the car."""
        return moved(pose, np.column_stack([radius_mm * circle, np.full(RING_SIDES, z_mm)]))

    low_outer, high_outer = moved_circle(outer_mm, -half_height_mm), moved_circle(outer_mm, half_height_mm)
    low_inner, high_inner = moved_circle(inner_mm, -half_height_mm), moved_circle(inner_mm, half_height_mm)
    # The lower and the upper face have a hole.
    yield SolidSide((low_outer, low_inner), -1.0 * pose[:3, 2])
    yield SolidSide((high_outer, high_inner), 1.0 * pose[:3, 2])
    # The outer side is flat between each corner of the circle and the next one. Its normal points to their middle.
    next_corners = np.roll(circle, -1, axis=0)
    for index, (corner, next_corner) in enumerate(zip(circle, next_corners, strict=True)):
        normal = pose[:3, :2] @ (corner + next_corner)
        yield SolidSide((_side(low_outer, high_outer, index),), normal / np.linalg.norm(normal))


def _circle(sides: int) -> Vector:
    """Return the corners (sides, 2) of a circle of radius 1."""
    turns = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    return np.column_stack([np.cos(turns), np.sin(turns)])


def _side(low: Vector, high: Vector, i: int) -> Vector:
    """Return the corners of the flat side between the corners i and i + 1 of two round ends."""
    j = (i + 1) % len(low)
    return np.stack([low[i], low[j], high[j], high[i]])


def _sides(solid: Solid, pose: Matrix) -> Iterator[SolidSide]:
    """Yield the sides of a box or a cylinder at its place. The two ends of a cylinder come first."""
    if solid.kind == "box":
        yield from _sides_of_box(solid, pose)
        return
    half = np.array(solid.size_mm) / 2
    sides = CYLINDER_SIDES if half[0] > SMALL_HOLE_MM / 2 else SMALL_CYLINDER_SIDES
    circle = half[0] * _circle(sides)
    low = moved(pose, np.column_stack([circle, np.full(sides, -half[2])]))
    high = moved(pose, np.column_stack([circle, np.full(sides, half[2])]))
    yield SolidSide((low,), -1.0 * pose[:3, 2])
    yield SolidSide((high,), 1.0 * pose[:3, 2])
    # The directions of the middles of the flat sides.
    middles = np.linspace(0, 2 * np.pi, sides, endpoint=False) + np.pi / sides
    for i, middle in enumerate(middles):
        normal = pose[:3, 0] * np.cos(middle) + pose[:3, 1] * np.sin(middle)
        yield SolidSide((_side(low, high, i),), normal)


def _sides_of_box(box: Solid, pose: Matrix) -> Iterator[SolidSide]:
    """Yield the six sides of a box at its place: for each axis of the box the side at its lower and its upper end."""
    half = np.array(box.size_mm) / 2
    for axis in range(3):
        # The two other axes of the box, along which the side extends.
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign * half[axis]
            # The four corners around the side.
            corners[:, first] = (-half[first], half[first], half[first], -half[first])
            corners[:, second] = (-half[second], -half[second], half[second], half[second])
            yield SolidSide((moved(pose, corners),), sign * pose[:3, axis])


def _hole_ring(hole: Hole) -> Vector:
    """Return the outline of a hole (n, 2). A round hole has only as many corners as can be seen in a picture."""
    if hole.diameter_mm is None or hole.center_mm is None:
        return np.array(hole.outline_mm)
    sides = HOLE_SIDES if hole.diameter_mm > SMALL_HOLE_MM else SMALL_HOLE_SIDES
    return np.array(hole.center_mm) + hole.diameter_mm / 2 * _circle(sides)


def _folded_edges(piece: Piece, shown: set[str]) -> dict[tuple[str, int], EdgeStyle]:
    """Return how the edges are drawn that two of the ``shown`` faces share.

    The keys are pairs: the name of a face, and the index of an edge in its outline. Such an edge is a fold. Its line is
    drawn once, with the parent face, so the edge of the child face has no line. A smooth bend has no line at all.
    """
    styles: dict[tuple[str, int], EdgeStyle] = {}
    for crease in piece.creases:
        parent, child = crease.parent, crease.child
        if parent.face in shown and child.face in shown:
            kind = None if crease.bend else _fold_kind(crease.angle_rad)
            styles[parent.face, parent.index] = EdgeStyle(kind, child.face)
            styles[child.face, child.index] = EdgeStyle(None)
    return styles


def _fold_kind(angle_rad: float) -> LineKind:
    """Return how the fold of that angle is drawn."""
    if angle_rad > 0:
        return "valley"
    return "mountain" if angle_rad < 0 else "flat"
