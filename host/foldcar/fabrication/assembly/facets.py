"""Converts faces of film and bought parts to facets to be drawn, in the car's frame.

Input: pieces with their poses and fold fractions, mounts. Output: Facets and the lines along their edges.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from foldcar.car.folded.model import Hole, Mount, Piece
from foldcar.fabrication.assembly.hidden_surfaces import Facet, Vector
from foldcar.fabrication.assembly.poses import Matrix, face_poses, glued_offset_mm, moved
from foldcar.fabrication.assembly.solids import mount_material

SMALL_HOLE_MM = 4.0

LineKind = Literal["cut", "mountain", "valley", "flat"]


@dataclass(frozen=True)
class EdgeLine:
    """A line along the edge of one facet or, for a fold, of two; it is drawn where one of them is visible."""

    keys: tuple[str, ...]
    ends_mm: Vector
    kind: LineKind


@dataclass(frozen=True)
class Shape:
    """The content of one picture: facets, their lines, and each facet's material by its key."""

    facets: tuple[Facet, ...]
    lines: tuple[EdgeLine, ...]
    materials: Mapping[str, str]


def together(shapes: Iterable[Shape]) -> Shape:
    """Several shapes as one; their keys must differ."""
    several = list(shapes)
    return Shape(
        tuple(facet for shape in several for facet in shape.facets),
        tuple(line for shape in several for line in shape.lines),
        {key: material for shape in several for key, material in shape.materials.items()},
    )


def film_shape(
    piece: Piece,
    pose: Matrix,
    fraction: float = 1.0,
    prefix: str = "",
    tabs: bool = True,
    creases: bool = True,
) -> Shape:
    """One copy of a piece, folded by ``fraction`` (0 to 1), its root face at ``pose``.

    Keys are ``prefix`` and the face's name. ``creases`` draws folds as such, not as edges.
    """
    poses = {name: pose @ at for name, at in face_poses(piece, fraction).items()}
    facets, lines = [], []
    offsets = glued_offset_mm(piece)
    shown = {face.name for face in piece.faces if tabs or face.role != "tab"}
    folds = _folded_edges(piece, shown)
    for face in piece.faces:
        if face.name not in shown:
            continue
        at, key = poses[face.name].copy(), prefix + face.name
        at[:3, 3] += fraction * offsets.get(face.name, 0.0) * at[:3, 2]
        rings = tuple(moved(at, ring) for ring in (np.array(face.outline_mm), *map(_hole_ring, face.holes)))
        facets.append(Facet(key, rings, at[:3, 2]))
        for number, ring in enumerate(rings):
            for i, ends in enumerate(np.stack([ring, np.roll(ring, -1, 0)], axis=1)):
                kind, others = ("cut", ()) if number else folds.get((face.name, i), ("cut", ()))
                if kind is not None:
                    keys = (key, *(prefix + other for other in others))
                    lines.append(EdgeLine(keys, ends, kind if creases else "cut"))
    rim = any(face.role == "rim" for face in piece.faces)
    return Shape(tuple(facets), tuple(lines), {f.key: "tyre" if rim else "film" for f in facets})


def mount_shape(mount: Mount, pose: Matrix | None = None) -> Shape:
    """A bought part's box, at its pose in the car or at ``pose``."""
    pose = np.array(mount.pose) if pose is None else pose
    half = np.array(mount.size_mm) / 2
    facets, lines = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = np.zeros((4, 3))
            corners[:, axis] = sign * half[axis]
            corners[:, u] = np.array([-1, 1, 1, -1]) * half[u]
            corners[:, v] = np.array([-1, -1, 1, 1]) * half[v]
            ring = moved(pose, corners)
            key = f"{mount.name} {axis}{sign:+g}"
            facets.append(Facet(key, (ring,), sign * pose[:3, axis], closed=True))
            lines += [EdgeLine((key,), ends, "cut") for ends in np.stack([ring, np.roll(ring, -1, 0)], axis=1)]
    return Shape(tuple(facets), tuple(lines), {facet.key: mount_material(mount) for facet in facets})


def _hole_ring(hole: Hole) -> Vector:
    """The hole's outline; a circle has as many corners as are visible in a picture."""
    if hole.diameter_mm is None or hole.center_mm is None:
        return np.array(hole.outline_mm)
    turns = np.linspace(0, 2 * np.pi, 16 if hole.diameter_mm > SMALL_HOLE_MM else 10, endpoint=False)
    return np.array(hole.center_mm) + hole.diameter_mm / 2 * np.column_stack([np.cos(turns), np.sin(turns)])


def _folded_edges(piece: Piece, shown: set[str]) -> dict[tuple[str, int], tuple[LineKind | None, tuple[str, ...]]]:
    """The line along each edge that two shown faces share (None for no line) and the other face, by the parent's edge.

    A rim bends smoothly and has no folds between its facets.
    """
    edges: dict[tuple[str, int], tuple[LineKind | None, tuple[str, ...]]] = {}
    rims = {face.name for face in piece.faces if face.role == "rim"}
    for crease in piece.creases:
        if {crease.parent.face, crease.child.face} <= shown:
            kind: LineKind = "valley" if crease.angle_rad > 0 else "mountain" if crease.angle_rad < 0 else "flat"
            even = {crease.parent.face, crease.child.face} <= rims
            edges[crease.parent.face, crease.parent.index] = (None if even else kind, (crease.child.face,))
            edges[crease.child.face, crease.child.index] = (None, ())
    return edges
