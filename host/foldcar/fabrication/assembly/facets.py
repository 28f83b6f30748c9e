"""Converts faces of film and bought parts to facets to be drawn, in the car's frame.

Input: pieces with their poses and fold fractions, mounts. Output: Facets and the lines along their edges.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from foldcar.car.folded.model import Hole, Mount, Piece, Solid
from foldcar.fabrication.assembly.faces import Fraction, Matrix, face_poses, glued_offset_mm, mount_material, moved
from foldcar.fabrication.assembly.hidden_surfaces import Facet, Vector

SMALL_HOLE_MM = 4.0
CYLINDER_ENDS = 2
# A part of at least this number of boxes is a ring around z, such as a tyre, and is drawn round.
RING_SOLIDS, RING_SIDES = 16, 40
CYLINDER_SIDES, SMALL_CYLINDER_SIDES = 16, 8

NUT_OF = "nut of "

LineKind = Literal["cut", "mountain", "valley", "flat"]


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
    """Return what is drawn of one copy of a piece of film, whose root face is at ``pose``.

    Its folds are closed by ``fraction``. The key of a facet is ``prefix`` and the name of its face. With ``creases``,
    folds are drawn as folds, else as edges. Without ``tabs``, tabs are left out.
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
        rings = tuple(moved(face_pose, ring) for ring in (np.array(face.outline_mm), *map(_hole_ring, face.holes)))
        facets.append(Facet(key, rings, face_pose[:3, 2]))
        for number, ring in enumerate(rings):
            for i, ends in enumerate(_edges(ring)):
                # Ring 0 is the outline, the others are holes, whose edges are cut. Kind None: the parent has the line.
                kind, others = ("cut", ()) if number else folds.get((face.name, i), ("cut", ()))
                if kind is not None:
                    keys = (key, *(prefix + other for other in others))
                    lines.append(EdgeLine(keys, ends, kind if creases else "cut"))
    return PictureContent(tuple(facets), tuple(lines))


def mount_shape(mount: Mount, pose: Matrix | None = None) -> PictureContent:
    """Return what is drawn of a bought part: its solids or, if it has none, its box.

    ``pose`` is its place in the car by default.
    """
    pose = np.array(mount.pose) if pose is None else pose
    facets, lines = [], []
    # A part of so many solids, all alike, is a ring, such as a tyre.
    if len(mount.solids) >= RING_SOLIDS and len({solid.size_mm for solid in mount.solids}) == 1:
        solids = [("round", _ring(mount, pose))]
    else:
        solids = [(solid.kind, _sides(solid, pose @ np.array(solid.pose))) for solid in mount.shape]
    for number, (kind, sides) in enumerate(solids):
        for side, (rings, normal) in enumerate(sides):
            facets.append(Facet(f"{mount.name} {number}.{side}", rings, normal, mount_material(mount), closed=True))
            # The sides of a cylinder meet smoothly, without edges; its two ends come first.
            if kind == "box" or side < CYLINDER_ENDS:
                lines += [EdgeLine((facets[-1].key,), ends, "cut") for ring in rings for ends in _edges(ring)]
    return PictureContent(tuple(facets), tuple(lines))


def _edges(ring: Vector) -> Vector:
    """Return both ends of each edge, (n, 2, 3)."""
    return np.stack([ring, np.roll(ring, -1, 0)], axis=1)


def shank_and_nut(screw: Mount) -> tuple[Mount, Mount]:
    """Split a screw into two parts: head with shank, and its nut, which gets a name of its own."""
    return replace(screw, solids=screw.solids[:2]), replace(screw, name=f"{NUT_OF}{screw.name}", solids=screw.solids[2:])


def _ring(mount: Mount, pose: Matrix) -> Iterator[tuple[tuple[Vector, ...], Vector]]:
    """Yield the facets of a ring, such as a tyre, each as (rings, normal): its two faces, then its outer side.

    The ring fills the box of the mount, around its z axis. It is as thick as the first of the mount's solids.
    """
    circle = _circle(RING_SIDES)
    outer_mm, half = mount.size_mm[0] / 2, mount.size_mm[2] / 2
    inner_mm = outer_mm - min(mount.solids[0].size_mm)
    end_rings = [
        tuple(moved(pose, np.column_stack([r * circle, np.full(RING_SIDES, z)])) for r in (outer_mm, inner_mm))
        for z in (-half, half)
    ]
    yield from ((rings, sign * pose[:3, 2]) for rings, sign in zip(end_rings, (-1.0, 1.0), strict=True))
    for i in range(RING_SIDES):
        normal = pose[:3, :2] @ (circle[i] + circle[(i + 1) % RING_SIDES])
        yield (_side(end_rings[0][0], end_rings[1][0], i),), normal / np.linalg.norm(normal)


def _circle(sides: int) -> Vector:
    turns = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    return np.column_stack([np.cos(turns), np.sin(turns)])


def _side(low: Vector, high: Vector, i: int) -> Vector:
    """Return the corners of the side between two round ends that begins at their corner i."""
    j = (i + 1) % len(low)
    return np.stack([low[i], low[j], high[j], high[i]])


def _sides(solid: Solid, pose: Matrix) -> Iterator[tuple[tuple[Vector], Vector]]:
    """Yield the sides of a box or a cylinder, each as (rings, normal). The two ends of a cylinder come first."""
    half = np.array(solid.size_mm) / 2
    if solid.kind == "box":
        for axis in range(3):
            for sign in (-1.0, 1.0):
                corners = np.zeros((4, 3))
                corners[:, axis] = sign * half[axis]
                corners[:, (axis + 1) % 3] = np.array([-1, 1, 1, -1]) * half[(axis + 1) % 3]
                corners[:, (axis + 2) % 3] = np.array([-1, -1, 1, 1]) * half[(axis + 2) % 3]
                yield (moved(pose, corners),), sign * pose[:3, axis]
        return
    sides = CYLINDER_SIDES if half[0] > SMALL_HOLE_MM / 2 else SMALL_CYLINDER_SIDES
    low, high = (moved(pose, np.column_stack([half[0] * _circle(sides), np.full(sides, z)])) for z in (-half[2], half[2]))
    yield from (((end,), sign * pose[:3, 2]) for end, sign in ((low, -1.0), (high, 1.0)))
    middles = np.linspace(0, 2 * np.pi, sides, endpoint=False) + np.pi / sides
    for i, middle in enumerate(middles):
        yield (_side(low, high, i),), pose[:3, 0] * np.cos(middle) + pose[:3, 1] * np.sin(middle)


def _hole_ring(hole: Hole) -> Vector:
    """Return the hole's outline; a circle has only as many corners as are visible in a picture."""
    if hole.diameter_mm is None or hole.center_mm is None:
        return np.array(hole.outline_mm)
    sides = 16 if hole.diameter_mm > SMALL_HOLE_MM else 10
    return np.array(hole.center_mm) + hole.diameter_mm / 2 * _circle(sides)


def _folded_edges(piece: Piece, shown: set[str]) -> dict[tuple[str, int], tuple[LineKind | None, tuple[str, ...]]]:
    """Find the edges that two shown faces share; return for each (face, edge) its kind of line and the other face.

    The line is drawn only once, at the edge of the parent. So the kind is None for the edge of the child, and also
    for smooth bends.
    """
    edges: dict[tuple[str, int], tuple[LineKind | None, tuple[str, ...]]] = {}
    for crease in piece.creases:
        parent, child = crease.parent, crease.child
        if parent.face in shown and child.face in shown:
            kind = None if crease.bend else _fold_kind(crease.angle_rad)
            edges[parent.face, parent.index] = (kind, (child.face,))
            edges[child.face, child.index] = (None, ())
    return edges


def _fold_kind(angle_rad: float) -> LineKind:
    """Return how the fold of that angle is drawn."""
    if angle_rad > 0:
        return "valley"
    return "mountain" if angle_rad < 0 else "flat"
