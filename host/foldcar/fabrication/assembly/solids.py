"""A folded car as closed solids, film with its thickness and bought parts as boxes: STL of the film, OBJ of all parts.

Input: a FoldedCar. Output: meshes and files in millimetres, in the car's frame (x forward, y left, z up). Each face of
film is a plate around its middle surface: at a fold the plates of both faces overlap by up to half a thickness.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount, Piece
from foldcar.fabrication.assembly.faces import Material, face_points, face_poses, face_triangles, mount_material

if TYPE_CHECKING:
    from trimesh import Trimesh

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
# Shells of an STL file are scaled down by this fraction. STL has no indices, so readers merge equal corners: shells
# that share an edge would be merged to one surface that is not closed.
SHELL_SHRINKING = 1e-4


@dataclass(frozen=True)
class PartMesh:
    """A part's name, material, and mesh in the car's frame (mm)."""

    name: str
    material: Material
    mesh: "Trimesh"


def film_mesh(piece: Piece) -> "Trimesh":
    """Return the mesh of the folded piece in its root face's frame (mm): a plate of film for each face."""
    from trimesh.creation import extrude_triangulation
    from trimesh.util import concatenate

    poses = face_poses(piece)
    to_lower_side = np.eye(4)
    to_lower_side[2, 3] = -piece.thickness_mm / 2
    plates = []
    for face in piece.faces:
        points, _ = face_points(face)
        lower_pose = poses[face.name] @ to_lower_side
        plates.append(extrude_triangulation(points, face_triangles(face), piece.thickness_mm, transform=lower_pose))
    mesh: Trimesh = concatenate(plates)
    return mesh


def film_solids(folded: FoldedCar) -> list[PartMesh]:
    """Return every copy of every piece of film, folded."""
    pieces = {piece.name: (piece, film_mesh(piece)) for piece in folded.pieces}
    solids = []
    for placed in folded.placed:
        piece, mesh = pieces[placed.piece]
        name = piece.name if piece.count == 1 else f"{piece.name} {placed.copy + 1}"
        solids.append(PartMesh(f"{name} ({placed.body})", "film", mesh.copy().apply_transform(np.array(placed.pose))))
    return solids


def mount_solid(mount: Mount) -> PartMesh:
    """Return a bought part's box."""
    from trimesh.creation import box

    return PartMesh(mount.name, mount_material(mount), box(mount.size_mm, np.array(mount.pose)))


def stl_bytes(solids: Sequence[PartMesh]) -> bytes:
    """Return a binary STL file of all solids (mm). Its closed shells are shrunk slightly, so that they do not touch."""
    from trimesh.exchange.stl import export_stl
    from trimesh.util import concatenate

    shells = [shell for solid in solids for shell in solid.mesh.split(only_watertight=False)]
    for shell in shells:
        shell.vertices += SHELL_SHRINKING * (shell.vertices.mean(axis=0) - shell.vertices)
    content: bytes = export_stl(concatenate(shells))
    return content


def obj_files(solids: Sequence[PartMesh], name: str) -> dict[str, bytes]:
    """Return NAME.obj with an object for each solid, and NAME.mtl with their materials."""
    import trimesh
    from trimesh.exchange.obj import export_obj
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import SimpleMaterial

    materials = {key: SimpleMaterial(name=key, diffuse=colour) for key, colour in COLOURS.items()}
    scene = trimesh.Scene()
    for solid in solids:
        # In an OBJ file a name ends at the first blank.
        title = solid.name.replace(" ", "_")
        solid.mesh.visual = TextureVisuals(material=materials[solid.material])
        solid.mesh.metadata["name"] = title
        scene.add_geometry(solid.mesh, node_name=title, geom_name=title)
    header = "foldcar, millimetres, x forward, y left, z up"
    text, other_files = export_obj(
        scene, include_normals=False, return_texture=True, digits=DIGITS, mtl_name=f"{name}.mtl", header=header
    )
    return {f"{name}.obj": text.encode(), **other_files}
