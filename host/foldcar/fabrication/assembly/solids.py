"""A folded car as closed solids, film with its thickness and bought parts as boxes: STL of the film, OBJ of all parts.

Input: a FoldedCar. Output: meshes and files in millimetres, in the car's frame (x forward, y left, z up). Faces that
share a crease share its vertices, which are half a thickness off the middle planes of both, on each side: folds are
mitred, and a piece is one shell without gaps. At a crease folded by almost 180° there is no mitre: the faces remain
separate shells.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from foldcar.car.folded.model import Crease, FoldedCar, Mount, Piece
from foldcar.car.folded.pose import edge
from foldcar.fabrication.assembly.faces import Material, face_points, face_poses, face_triangles, mount_material, moved

if TYPE_CHECKING:
    from trimesh import Trimesh

SHARPEST_MITRE_RAD = math.radians(150)
SAME_LENGTH_MM = 1e-6
# Gap between glued layers, so that programs that merge equal vertices keep the shells separate.
AIR_MM = 2e-4
# Diffuse colours, 0 to 255.
COLOURS: dict[Material, tuple[int, int, int]] = {
    "film": (237, 232, 217),
    "tyre": (89, 92, 97),
    "servo": (41, 89, 158),
    "board": (26, 107, 64),
    "battery": (191, 140, 51),
    "other": (140, 140, 140),
}
DIGITS = 5


@dataclass(frozen=True)
class Solid:
    """One part: its name, its rigid body, its material; vertices (n, 3) in mm, triangles (m, 3), seen from outside
    counter-clockwise."""

    name: str
    body: str
    material: Material
    vertices_mm: NDArray[np.float64]
    triangles: NDArray[np.int64]

    @property
    def mesh(self) -> "Trimesh":
        """The same for trimesh."""
        from trimesh import Trimesh

        return Trimesh(self.vertices_mm, self.triangles, process=False)


def film_solid(piece: Piece) -> Solid:
    """The folded piece in its root face's frame."""
    faces = {face.name: face for face in piece.faces}
    poses = face_poses(piece)

    def is_welded(crease: Crease) -> bool:
        lengths = [math.dist(*edge(faces, reference)) for reference in (crease.parent, crease.child)]
        return abs(crease.angle_rad) < SHARPEST_MITRE_RAD and abs(lengths[0] - lengths[1]) < SAME_LENGTH_MM

    welded = [crease for crease in piece.creases if is_welded(crease)]
    names = _shared_vertices(piece, welded)
    inner = {(reference.face, reference.index) for crease in welded for reference in (crease.parent, crease.child)}
    middle: dict[int, NDArray[np.float64]] = {}
    normals: dict[int, list[NDArray[np.float64]]] = {}
    triangles, walls = [], []
    for face in piece.faces:
        at, vertex = poses[face.name], names[face.name]
        points, ends = face_points(face)
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
    points = np.array(list(middle.values()))
    offsets = np.array([_offset(normals[index], (piece.thickness_mm - AIR_MM) / 2) for index in middle])
    renumber = np.zeros(max(middle) + 1, dtype=np.int64)
    renumber[list(middle)] = range(len(middle))
    top, below = renumber[np.concatenate(triangles)], len(points)
    a, b = renumber[np.array(walls, dtype=np.int64).reshape(-1, 2)].T
    sides = [np.column_stack([a + below, b + below, b]), np.column_stack([a + below, b, a])]
    vertices = np.concatenate([points + offsets, points - offsets])
    return Solid(piece.name, "", "film", vertices, np.concatenate([top, top[:, ::-1] + below, *sides]))


def _shared_vertices(piece: Piece, welded: list[Crease]) -> dict[str, list[int]]:
    """For each face the vertex numbers of its points; the points of a welded crease share their numbers."""
    sizes = {face.name: len(face.outline_mm) for face in piece.faces}
    counts = [len(face_points(face)[0]) for face in piece.faces]
    starts = dict(zip(sizes, np.cumsum([0, *counts]), strict=False))
    pairs = []
    for a, b in ((crease.parent, crease.child) for crease in welded):
        for one, other in ((a.index, b.index + 1), (a.index + 1, b.index)):
            pairs.append((starts[a.face] + one % sizes[a.face], starts[b.face] + other % sizes[b.face]))
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    same = connected_components(coo_array((np.ones(len(pairs)), ends), shape=[sum(counts)] * 2), directed=False)[1]
    return {name: same[starts[name] :][:count].tolist() for name, count in zip(sizes, counts, strict=True)}


def _offset(normals: list[NDArray[np.float64]], distance_mm: float) -> NDArray[np.float64]:
    """The shortest vector, (3,), with distance ``distance_mm`` from each of the planes with these normals."""
    if len(normals) == 1:
        return normals[0] * distance_mm
    rows = np.array(normals)
    step: NDArray[np.float64] = np.linalg.lstsq(rows, np.full(len(rows), distance_mm), rcond=1e-3)[0]
    return step


def film_solids(folded: FoldedCar) -> list[Solid]:
    """Every copy of every piece of film, folded."""
    pieces = {piece.name: (piece, film_solid(piece)) for piece in folded.pieces}
    found = []
    for placed in folded.placed:
        piece, solid = pieces[placed.piece]
        name = piece.name if piece.count == 1 else f"{piece.name} {placed.copy + 1}"
        vertices = moved(np.array(placed.pose), solid.vertices_mm)
        found.append(Solid(f"{name} ({placed.body})", placed.body, "film", vertices, solid.triangles))
    return found


def mount_solid(mount: Mount) -> Solid:
    """A bought part's box."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))], dtype=np.int64)
    return Solid(
        mount.name, mount.body, mount_material(mount), moved(np.array(mount.pose), corners * mount.size_mm), triangles
    )


def stl_bytes(solids: Sequence[Solid]) -> bytes:
    """A binary STL file of all solids in one mesh of several shells."""
    import trimesh
    from trimesh.exchange.stl import export_stl

    content: bytes = export_stl(trimesh.util.concatenate([solid.mesh for solid in solids]))
    return content


def obj_files(solids: Sequence[Solid], name: str) -> dict[str, bytes]:
    """NAME.obj, an object for each solid, and NAME.mtl with their materials."""
    import trimesh
    from trimesh.exchange.obj import export_obj
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import SimpleMaterial

    materials = {key: SimpleMaterial(name=key, diffuse=colour) for key, colour in COLOURS.items()}
    scene = trimesh.Scene()
    for solid in solids:
        # Of a name OBJ takes what comes before a blank.
        title, mesh = solid.name.replace(" ", "_"), solid.mesh
        mesh.visual, mesh.metadata["name"] = TextureVisuals(material=materials[solid.material]), title
        scene.add_geometry(mesh, node_name=title, geom_name=title)
    header = "foldcar, millimetres, x forward, y left, z up"
    text, others = export_obj(
        scene, include_normals=False, return_texture=True, digits=DIGITS, mtl_name=f"{name}.mtl", header=header
    )
    return {f"{name}.obj": text.encode(), **others}
