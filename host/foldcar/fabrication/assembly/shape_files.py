"""A car's shape for other programs: FOLD files of its pieces, STL of its film, OBJ of all its parts with their colours.

All are in millimetres, meshes in the car's frame (x forward, y left, z up). A FOLD 1.1 file has the crease pattern as its
key frame and the folded form as the second one; angles are in degrees. Faces are triangles, because FOLD has no faces
with holes; edges between the triangles of one face are flat (F). Small holes and slits are left out: they do not affect
folding, and the narrow triangles around them make folding simulations unstable. The sheets contain them.
https://github.com/edemaine/fold/blob/main/doc/spec.md
"""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import EdgeRef, Piece
from foldcar.fabrication.assembly.solids import (
    Material,
    Mesh,
    Solid,
    face_points,
    face_poses,
    face_triangles,
    moved,
    shared_vertices,
)

SPEC = 1.1
DECIMALS = 6
HOLES = ("opening", "vent")
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


def fold_text(piece: Piece, car: str) -> str:
    """The file's text; ``car`` is the title of the piece's car."""
    piece = without_small_holes(piece)
    names = shared_vertices(piece, list(piece.creases))
    order = {name: i for i, name in enumerate(dict.fromkeys(n for ring in names.values() for n in ring))}
    numbers = {face: [order[name] for name in ring] for face, ring in names.items()}
    triangles = [
        [numbers[face.name][i] for i in triangle] for face in piece.faces for triangle in face_triangles(face).tolist()
    ]
    edges, assignment, angles = _edges(piece, numbers, triangles)
    flat = _coordinates(piece, numbers, len(order), 0.0)
    title = piece.label or piece.name
    document: dict[str, Any] = {
        "file_spec": SPEC,
        "file_creator": "foldcar",
        "file_title": f"{car}: {title}",
        "file_description": "With openings, without screw holes, slots and slits. The printed side is up.",
        "file_classes": ["singleModel"],
        "frame_title": f"{title}, flat",
        "frame_classes": ["creasePattern"],
        "frame_attributes": ["2D", "manifold", "orientable"],
        "frame_unit": "mm",
        "vertices_coords": np.round(flat[:, :2], DECIMALS).tolist(),
        "edges_vertices": edges,
        "edges_assignment": assignment,
        "edges_foldAngle": angles,
        "faces_vertices": triangles,
        "file_frames": [
            {
                "frame_title": f"{title}, folded",
                "frame_classes": ["foldedForm"],
                "frame_attributes": ["3D", "manifold", "orientable"],
                "frame_parent": 0,
                "frame_inherit": True,
                "vertices_coords": np.round(_coordinates(piece, numbers, len(order), 1.0), DECIMALS).tolist(),
            }
        ],
    }
    return json.dumps(document, separators=(",", ":")) + "\n"


def without_small_holes(piece: Piece) -> Piece:
    """The piece without the holes that FOLD files leave out."""
    faces = (replace(face, holes=tuple(hole for hole in face.holes if hole.kind in HOLES)) for face in piece.faces)
    return replace(piece, faces=tuple(faces))


def _edges(
    piece: Piece, numbers: dict[str, list[int]], triangles: list[list[int]]
) -> tuple[list[list[int]], list[str], list[float]]:
    """Every edge once: its vertices, its assignment and its fold angle (degrees)."""
    sizes = {face.name: len(face.outline_mm) for face in piece.faces}

    def ends(edge: EdgeRef) -> tuple[int, int]:
        ring = numbers[edge.face]
        return ring[edge.index % sizes[edge.face]], ring[(edge.index + 1) % sizes[edge.face]]

    folds = {frozenset(ends(crease.parent)): math.degrees(crease.angle_rad) for crease in piece.creases}
    sides: dict[frozenset[int], int] = {}
    for triangle in triangles:
        for i in range(3):
            edge = frozenset((triangle[i], triangle[(i + 1) % 3]))
            sides[edge] = sides.get(edge, 0) + 1
    edges, assignment, angles = [], [], []
    for edge, count in sides.items():
        angle = round(folds.get(edge, 0.0), DECIMALS)
        edges.append(sorted(edge))
        assignment.append("B" if count == 1 else "V" if angle > 0 else "M" if angle < 0 else "F")
        angles.append(angle)
    return edges, assignment, angles


def _coordinates(piece: Piece, numbers: dict[str, list[int]], count: int, fraction: float) -> NDArray[np.float64]:
    """The vertices, (count, 3) in mm, in the root face's frame."""
    poses = face_poses(piece, fraction)
    points = np.zeros((count, 3))
    for face in piece.faces:
        points[numbers[face.name]] = moved(poses[face.name], face_points(face)[0])
    return points


def stl_bytes(mesh: Mesh) -> bytes:
    """A binary STL file."""
    import trimesh
    from trimesh.exchange.stl import export_stl

    content: bytes = export_stl(trimesh.Trimesh(mesh.vertices_mm, mesh.triangles, process=False))
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
        title = solid.name.replace(" ", "_")
        visual = TextureVisuals(material=materials[solid.material])
        mesh = trimesh.Trimesh(
            solid.mesh.vertices_mm, solid.mesh.triangles, process=False, visual=visual, metadata={"name": title}
        )
        scene.add_geometry(mesh, node_name=title, geom_name=title)
    text, others = export_obj(
        scene,
        include_normals=False,
        return_texture=True,
        digits=DIGITS,
        mtl_name=f"{name}.mtl",
        header="foldcar, millimetres, x forward, y left, z up",
    )
    return {f"{name}.obj": text.encode(), **others}
