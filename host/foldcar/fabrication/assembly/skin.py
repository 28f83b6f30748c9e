"""A folded piece of film as a closed solid of its thickness.

Input: a Piece and its fold fraction. Output: a Mesh in millimetres. Faces that share a crease share its vertices, which
are half a thickness off the middle planes of both, on each side: folds are mitred, and a piece is one shell without
gaps. At a crease folded by almost 180° there is no mitre: the faces remain separate shells.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import Crease, Piece, Point
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.poses import face_poses, moved
from foldcar.fabrication.assembly.triangles import face_points, face_triangles

SHARPEST_MITRE_RAD = math.radians(150)
SAME_LENGTH_MM = 1e-6
# Gap between glued layers, so that programs that merge equal vertices keep the shells separate.
AIR_MM = 2e-4


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, 3) in millimetres; triangles (m, 3), counter-clockwise seen from outside."""

    vertices_mm: NDArray[np.float64]
    triangles: NDArray[np.int64]

    @property
    def volume_mm3(self) -> float:
        """The enclosed volume (mm³), by the divergence theorem."""
        a, b, c = (self.vertices_mm[self.triangles[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one, without merging vertices."""
    starts = np.cumsum([0, *(len(mesh.vertices_mm) for mesh in meshes)])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices_mm for mesh in meshes]), np.concatenate(triangles))


def film_solid(piece: Piece, fraction: float = 1.0) -> Mesh:
    """The solid of the piece, folded by ``fraction`` (0 to 1), in its root face's frame."""
    poses = face_poses(piece, fraction)
    welded = [crease for crease in piece.creases if _is_welded(piece, crease, fraction)]
    names = shared_vertices(piece, welded)
    middle: dict[int, NDArray[np.float64]] = {}
    normals: dict[int, list[NDArray[np.float64]]] = {}
    triangles, walls = [], []
    inner = {(crease.parent.face, crease.parent.index) for crease in welded}
    inner |= {(crease.child.face, crease.child.index) for crease in welded}
    for face in piece.faces:
        at = poses[face.name]
        points, ends = face_points(face)
        vertex = names[face.name]
        for index, point in zip(vertex, moved(at, points), strict=True):
            middle[index] = point
            normals.setdefault(index, []).append(at[:3, 2])
        triangles.append(np.array(vertex)[face_triangles(face)])
        for start, end in zip([0, *ends], ends, strict=False):
            # The film must be on the left, so a hole's ring is reversed.
            ring = vertex[start:end][::-1] if start else vertex[:end]
            walls += [
                (ring[i], ring[(i + 1) % len(ring)])
                for i in range(len(ring))
                if start or (face.name, i) not in inner
            ]
    return _thickened(middle, normals, np.concatenate(triangles), walls, piece.thickness_mm - AIR_MM)


def _is_welded(piece: Piece, crease: Crease, fraction: float) -> bool:
    faces = {face.name: face for face in piece.faces}
    lengths = [math.dist(*edge(faces, reference)) for reference in (crease.parent, crease.child)]
    return (
        abs(fraction * crease.angle_rad) < SHARPEST_MITRE_RAD and abs(lengths[0] - lengths[1]) < SAME_LENGTH_MM
    )


def shared_vertices(piece: Piece, welded: list[Crease]) -> dict[str, list[int]]:
    """For each face the vertex numbers of its points; the points of a welded crease share their numbers."""
    names: dict[str, list[int]] = {}
    count = 0
    for face in piece.faces:
        size = len(face_points(face)[0])
        names[face.name] = list(range(count, count + size))
        count += size
    parent = list(range(count))

    def root(index: int) -> int:
        while parent[index] != index:
            index = parent[index]
        return index

    sizes = {face.name: len(face.outline_mm) for face in piece.faces}
    for crease in welded:
        a, b = crease.parent, crease.child
        for one, other in ((a.index, b.index + 1), (a.index + 1, b.index)):
            first = root(names[a.face][one % sizes[a.face]])
            parent[root(names[b.face][other % sizes[b.face]])] = first
    return {name: [root(index) for index in indices] for name, indices in names.items()}


def _thickened(
    middle: dict[int, NDArray[np.float64]],
    normals: dict[int, list[NDArray[np.float64]]],
    triangles: NDArray[np.int64],
    walls: list[tuple[int, int]],
    thickness_mm: float,
) -> Mesh:
    order = {index: place for place, index in enumerate(middle)}
    points = np.array(list(middle.values()))
    offsets = np.array([_offset(normals[index], thickness_mm / 2) for index in middle])
    renumber = np.zeros(max(order) + 1, dtype=np.int64)
    renumber[list(order)] = list(order.values())
    top = renumber[triangles]
    below = len(points)
    a, b = renumber[np.array(walls, dtype=np.int64).reshape(-1, 2)].T
    sides = np.concatenate(
        [np.column_stack([a + below, b + below, b]), np.column_stack([a + below, b, a])]
    )
    return Mesh(
        np.concatenate([points + offsets, points - offsets]),
        np.concatenate([top, top[:, ::-1] + below, sides]),
    )


def _offset(normals: list[NDArray[np.float64]], distance_mm: float) -> NDArray[np.float64]:
    """The shortest vector, (3,), with distance ``distance_mm`` from each of the planes with these normals."""
    if len(normals) == 1:
        return normals[0] * distance_mm
    rows = np.array(normals)
    step: NDArray[np.float64] = np.linalg.lstsq(rows, np.full(len(rows), distance_mm), rcond=1e-3)[0]
    return step


def piece_area_mm2(piece: Piece) -> float:
    """Area of film in one copy of the piece (mm²)."""
    return sum(_area(face.outline_mm) - sum(_area(hole.outline_mm) for hole in face.holes) for face in piece.faces)


def _area(ring: tuple[Point, ...]) -> float:
    x, y = np.array(ring).T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)
