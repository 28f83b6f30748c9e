"""A folded car as closed solids: poses and triangles of faces, film with its thickness, bought parts as boxes.

Input: a Piece and its fold fraction, or a FoldedCar. Output: Meshes in millimetres. Faces that share a crease share its
vertices, which are half a thickness off the middle planes of both, on each side: folds are mitred, and a piece is one
shell without gaps. At a crease folded by almost 180° there is no mitre: the faces remain separate shells.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from foldcar.car.folded.model import Crease, Face, FoldedCar, Mount, Piece
from foldcar.car.folded.pose import edge, folded
from foldcar.car.folded.weight import area_mm2

Matrix = NDArray[np.float64]


# 0 is flat, 1 folded: one number for a piece, or one for each crease by its name (0 for those not named).
Fraction = float | Mapping[str, float]
SHARPEST_MITRE_RAD = math.radians(150)
SAME_LENGTH_MM = 1e-6
# Gap between glued layers, so that programs that merge equal vertices keep the shells separate.
AIR_MM = 2e-4
Material = Literal["film", "tyre", "servo", "board", "battery", "other"]


def face_poses(piece: Piece, fraction: Fraction = 1.0) -> dict[str, Matrix]:
    """The (4, 4) poses of all faces by name, in the root face's frame."""
    if isinstance(fraction, Mapping):
        creases = tuple(replace(c, angle_rad=c.angle_rad * fraction.get(c.name, 0.0)) for c in piece.creases)
        piece, fraction = replace(piece, creases=creases), 1.0
    return {name: np.array(pose) for name, pose in folded(piece, fraction).items()}


def share_of(fraction: Fraction, crease: str) -> float:
    """The fraction of one crease."""
    return fraction.get(crease, 0.0) if isinstance(fraction, Mapping) else fraction


def moved(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) or (n, 3) transformed by the pose, (n, 3)."""
    points = np.asarray(points, dtype=np.float64)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    result: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
    return result


def glued_offset_mm(piece: Piece, fraction: Fraction = 1.0) -> dict[str, float]:
    """Offset of each tab from its middle plane (mm) when it is fixed to the inside of another face."""
    tabs = {face.name for face in piece.faces if face.role == "tab"}
    return {
        crease.child.face: piece.thickness_mm * (1 if crease.angle_rad > 0 else -1) * share_of(fraction, crease.name)
        for crease in piece.creases
        if crease.child.face in tabs
    }


def face_points(face: Face) -> tuple[NDArray[np.float64], list[int]]:
    """Points (n, 2) of outline and holes in sequence, and the end index of each of these rings."""
    rings = [np.array(face.outline_mm, dtype=np.float64)]
    rings += [np.array(hole.outline_mm, dtype=np.float64) for hole in face.holes]
    return np.concatenate(rings), list(np.cumsum([len(ring) for ring in rings]))


def face_triangles(face: Face) -> NDArray[np.int64]:
    """Indices (m, 3) into ``face_points``, counter-clockwise seen from the printed side.

    Every point is a corner of a triangle, also one inside a straight edge, because neighbouring faces share it.
    """
    points, ends = face_points(face)
    polygon = Polygon(points[: ends[0]], [points[a:b] for a, b in itertools.pairwise(ends)])
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    number = {(x, y): i for i, (x, y) in enumerate(points.tolist())}
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3].tolist()
    triangles = np.array([[number[x, y] for x, y in triangle] for triangle in corners], dtype=np.int64)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return triangles


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
                (ring[i], ring[(i + 1) % len(ring)]) for i in range(len(ring)) if start or (face.name, i) not in inner
            ]
    return _thickened(middle, normals, np.concatenate(triangles), walls, piece.thickness_mm - AIR_MM)


def _is_welded(piece: Piece, crease: Crease, fraction: float) -> bool:
    faces = {face.name: face for face in piece.faces}
    lengths = [math.dist(*edge(faces, reference)) for reference in (crease.parent, crease.child)]
    return abs(fraction * crease.angle_rad) < SHARPEST_MITRE_RAD and abs(lengths[0] - lengths[1]) < SAME_LENGTH_MM


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
    sides = np.concatenate([np.column_stack([a + below, b + below, b]), np.column_stack([a + below, b, a])])
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
    outlines = [(face.outline_mm, [hole.outline_mm for hole in face.holes]) for face in piece.faces]
    return sum(abs(area_mm2(outer)) - sum(abs(area_mm2(hole)) for hole in holes) for outer, holes in outlines)


@dataclass(frozen=True)
class Solid:
    """One part: its name, its rigid body, its material and its mesh."""

    name: str
    body: str
    material: Material
    mesh: Mesh


def film_solids(folded: FoldedCar) -> list[Solid]:
    """Every copy of every piece of film, folded."""
    pieces = {piece.name: piece for piece in folded.pieces}
    shapes = {piece.name: film_solid(piece) for piece in folded.pieces}
    found = []
    for placed in folded.placed:
        piece = pieces[placed.piece]
        name = piece.name if piece.count == 1 else f"{piece.name} {placed.copy + 1}"
        mesh = shapes[piece.name]
        vertices = moved(np.array(placed.pose), mesh.vertices_mm)
        found.append(Solid(f"{name} ({placed.body})", placed.body, "film", Mesh(vertices, mesh.triangles)))
    return found


def mount_solids(folded: FoldedCar) -> list[Solid]:
    """The bought parts' boxes."""
    return [Solid(mount.name, mount.body, mount_material(mount), _box(mount)) for mount in folded.mounts]


def film_mesh(folded: FoldedCar) -> Mesh:
    """All film as one mesh of several shells."""
    return joined([solid.mesh for solid in film_solids(folded)])


def mount_material(mount: Mount) -> Material:
    """The material of a bought part, by a word in its catalogue name."""
    name = mount.part.lower()
    words: dict[str, Material] = {
        "servo": "servo", "aa": "battery", "lipo": "battery", "feather": "board", "tyre": "tyre",
    }  # fmt: skip
    if "featherwing" in name:
        return "board"
    return next((material for word, material in words.items() if word in name), "other")


def _box(mount: Mount) -> Mesh:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    pose = np.array(mount.pose)
    vertices = (corners * mount.size_mm) @ pose[:3, :3].T + pose[:3, 3]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return Mesh(vertices, np.array(triangles, dtype=np.int64))
