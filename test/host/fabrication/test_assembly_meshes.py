"""Meshes of folded cars against trimesh and closed forms; STL and OBJ files read back."""

import math
import struct
from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from cut_samples import FLAP, HEIGHT, LENGTH, THICKNESS, WIDTH, beam, cap
from foldcar.fabrication.assembly.faces import piece_area_mm2
from foldcar.fabrication.assembly.solids import film_mesh, film_solids, mount_solid, obj_files, stl_bytes
from published_cars import car


def test_faces_are_closed_plates_that_hold_the_film() -> None:
    for piece in (beam(), cap()):
        mesh = film_mesh(piece)

        assert mesh.is_watertight and mesh.is_winding_consistent
        assert mesh.body_count == len(piece.faces)
        assert mesh.volume == pytest.approx(piece_area_mm2(piece) * THICKNESS)


def test_area_of_film_is_that_of_rectangles_and_trapezoids() -> None:
    # The screw's hole has 24 corners on a circle of 2 mm.
    walls = 2 * LENGTH * (WIDTH + HEIGHT) - 23.4 * 12.7 - 12 * math.sin(math.pi / 12)
    flap = FLAP * (LENGTH - FLAP)

    assert piece_area_mm2(beam()) == pytest.approx(walls + flap)


def test_a_folded_beam_has_the_outer_measures_of_its_walls() -> None:
    sizes = np.ptp(film_mesh(beam()).vertices, axis=0)

    assert sizes == pytest.approx([LENGTH, WIDTH + THICKNESS, HEIGHT + THICKNESS], abs=1e-3)


def read_stl(content: bytes) -> NDArray[np.float64]:
    """The corners of a binary STL file's triangles, by the format's own definition: count x 3 x 3."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    (count,) = struct.unpack("<I", content[80:84])
    records = np.frombuffer(content[84:], dtype=record)
    assert len(records) == count and not content.startswith(b"solid")
    corners: NDArray[np.float64] = records["corners"].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * records["normal"]).sum(axis=1) >= 0).all()
    return corners


def volume_mm3(corners: NDArray[np.float64]) -> float:
    """What closed surfaces hold, by the divergence theorem; count x 3 x 3."""
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


@pytest.mark.parametrize("name", ["w95", "hinged"])
def test_stl_of_a_car_is_watertight_and_holds_its_film(name: str) -> None:
    folded = car(name)
    film_mm3 = sum(piece.count * piece_area_mm2(piece) * piece.thickness_mm for piece in folded.pieces)
    film = film_solids(folded)
    vertices = np.concatenate([solid.mesh.vertices for solid in film])

    corners = read_stl(stl_bytes(film))

    # Every edge belongs to two triangles, which run along it in opposite directions: each shell is closed by itself.
    points = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    runs = Counter((a, b) for face in points.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True))
    assert all(count == runs[b, a] == 1 for (a, b), count in runs.items())
    assert volume_mm3(corners) == pytest.approx(film_mm3, rel=0.02)
    assert corners.min(axis=(0, 1)) == pytest.approx(vertices.min(axis=0), abs=0.02)
    assert corners.max(axis=(0, 1)) == pytest.approx(vertices.max(axis=0), abs=0.02)
    # A car in millimetres: its axle is some hundred wide.
    assert 60 < np.ptp(corners[..., 1]) < 300


def test_obj_has_every_part_with_its_material_and_size() -> None:
    folded = car("w95")
    solids = [*film_solids(folded), *map(mount_solid, folded.mounts)]

    files = obj_files(solids, "car")

    assert files.keys() == {"car.obj", "car.mtl"}
    lines = [line.split() for line in files["car.obj"].decode().splitlines() if line]
    assert ["mtllib", "car.mtl"] in lines
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], dtype=float)
    objects: dict[str, tuple[list[str], list[list[int]]]] = {}
    for kind, *rest in lines:
        if kind == "o":
            assert rest[0] not in objects
            faces = objects.setdefault(rest[0], ([], []))
        elif kind == "usemtl":
            faces[0].append(rest[0])
        elif kind == "f":
            faces[1].append([int(corner) - 1 for corner in rest])
    assert list(objects) == [solid.name.replace(" ", "_") for solid in solids]
    for solid, (materials, triangles) in zip(solids, objects.values(), strict=True):
        assert materials == [solid.material]
        assert volume_mm3(vertices[np.array(triangles)]) == pytest.approx(solid.mesh.volume, rel=1e-3)
    for mount in folded.mounts:
        box = vertices[np.array(objects[mount.name.replace(" ", "_")][1])]
        assert volume_mm3(box) == pytest.approx(math.prod(mount.size_mm), rel=1e-4)
    known = {line.split()[1] for line in files["car.mtl"].decode().splitlines() if line.startswith("newmtl")}
    assert {material for materials, _ in objects.values() for material in materials} <= known
