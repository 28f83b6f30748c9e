"""A folded car as closed solids in the car's frame: film with its thickness, bought parts as boxes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.fabrication.assembly.poses import moved
from foldcar.fabrication.assembly.skin import Mesh, film_solid, joined

Material = Literal["film", "tyre", "servo", "board", "battery", "other"]


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
