"""Meshes of folded cars against trimesh and closed forms; STL, OBJ and FOLD files read back."""

import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar, Piece
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.assembly.fold_file import fold_text, without_small_holes
from foldcar.fabrication.assembly.obj import mtl_text, obj_text
from foldcar.fabrication.assembly.skin import film_solid, piece_area_mm2
from foldcar.fabrication.assembly.solids import film_mesh, film_solids, mount_solids
from foldcar.fabrication.assembly.stl import stl_bytes
from folded_box import HEIGHT_MM, LENGTH_MM, THICKNESS_MM, WIDTH_MM, beam, cap, folded_box


def cars() -> list[FoldedCar]:
    hinged = {"width": 95.0, "height": 50.0, "radius": 40.0, "W.length": 90.0, "B.length": 80.0}
    return [folded_car(compose("W_B_W", {})), folded_car(compose("W_B_H_W_H_W", hinged))]


def as_trimesh(mesh: Any) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices_mm, mesh.triangles, process=False)


@pytest.mark.parametrize("fraction", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("piece", [beam(), cap()], ids=["beam", "cap"])
def test_piece_is_one_closed_shell_that_holds_its_film(piece: Piece, fraction: float) -> None:
    mesh = as_trimesh(film_solid(piece, fraction))

    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(piece_area_mm2(piece) * THICKNESS_MM, rel=2e-3)


def test_area_of_film_is_that_of_rectangles_and_trapezoids() -> None:
    walls = 2 * LENGTH_MM * (WIDTH_MM + HEIGHT_MM) - 23.4 * 12.7
    flap = 8 * (LENGTH_MM - 4)

    assert piece_area_mm2(beam()) == pytest.approx(walls + flap)


def test_folded_box_has_the_outer_measures_of_its_walls() -> None:
    mesh = as_trimesh(film_mesh(folded_box()))

    assert mesh.extents == pytest.approx(np.array([LENGTH_MM, WIDTH_MM, HEIGHT_MM]) + THICKNESS_MM, abs=1e-3)


@pytest.mark.parametrize("folded", cars(), ids=["W_B_W", "hinged"])
def test_stl_of_a_car_is_watertight_and_holds_its_film(folded: FoldedCar) -> None:
    film_mm3 = sum(piece.count * piece_area_mm2(piece) * piece.thickness_mm for piece in folded.pieces)

    mesh = trimesh.load(io.BytesIO(stl_bytes(film_mesh(folded), "car")), file_type="stl")

    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == sum(piece.count for piece in folded.pieces)
    assert mesh.volume == pytest.approx(film_mm3, rel=0.02)


def test_obj_has_every_part_with_its_material_and_size(tmp_path: Path) -> None:
    folded = cars()[0]
    solids = [*film_solids(folded), *mount_solids(folded)]
    (tmp_path / "car.obj").write_text(obj_text(solids, "car.mtl"), encoding="utf-8")
    (tmp_path / "car.mtl").write_text(mtl_text(), encoding="utf-8")

    scene = trimesh.load(tmp_path / "car.obj", split_object=True, group_material=False, process=False)

    names = [line[2:] for line in obj_text(solids, "x").splitlines() if line.startswith("o ")]
    assert names == [solid.name.replace(" ", "_") for solid in solids]
    assert len(set(names)) == len(names)
    # trimesh keeps neither the order nor the names of objects.
    volumes = sorted(shape.volume for shape in scene.geometry.values())
    assert volumes == pytest.approx(sorted(solid.mesh.volume_mm3 for solid in solids), rel=1e-3)
    for mount in folded.mounts:
        assert any(volume == pytest.approx(math.prod(mount.size_mm), rel=1e-4) for volume in volumes)
    used = {line.split()[1] for line in obj_text(solids, "x").splitlines() if line.startswith("usemtl")}
    assert used <= {line.split()[1] for line in mtl_text().splitlines() if line.startswith("newmtl")}


@pytest.mark.parametrize("piece", [beam(), cap(), *cars()[0].pieces], ids=lambda piece: piece.name)
def test_fold_file_keeps_the_rules_of_the_format(piece: Piece) -> None:
    fold = json.loads(fold_text(piece, "test"))
    flat = np.array(fold["vertices_coords"])
    faces = np.array(fold["faces_vertices"])
    sides: dict[frozenset[int], int] = {}
    for face in faces.tolist():
        for i in range(3):
            edge = frozenset((face[i], face[(i + 1) % 3]))
            sides[edge] = sides.get(edge, 0) + 1

    assert fold["file_spec"] == 1.1 and fold["frame_unit"] == "mm"
    assert flat.shape[1] == 2
    assert set(faces.ravel().tolist()) == set(range(len(flat)))
    a, b, c = (flat[faces[:, i]] for i in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (doubled > 0).all()
    assert doubled.sum() / 2 == pytest.approx(piece_area_mm2(without_small_holes(piece)), rel=1e-6)
    edges = [frozenset(edge) for edge in fold["edges_vertices"]]
    assert len(set(edges)) == len(edges) and set(edges) == set(sides)
    for edge, kind, angle in zip(edges, fold["edges_assignment"], fold["edges_foldAngle"], strict=True):
        assert sides[edge] == (1 if kind == "B" else 2)
        assert np.sign(angle) == {"B": 0, "F": 0, "M": -1, "V": 1}[kind]


@pytest.mark.parametrize("piece", [beam(), cap(), *cars()[0].pieces], ids=lambda piece: piece.name)
def test_folded_frame_of_a_fold_file_has_its_angles_and_lengths(piece: Piece) -> None:
    fold = json.loads(fold_text(piece, "test"))
    flat = np.column_stack([np.array(fold["vertices_coords"]), np.zeros(len(fold["vertices_coords"]))])
    (frame,) = fold["file_frames"]
    folded = np.array(frame["vertices_coords"])
    ends = np.array(fold["edges_vertices"])

    assert frame["frame_inherit"] and frame["frame_parent"] == 0
    assert np.allclose(lengths(folded, ends), lengths(flat, ends), atol=1e-4)
    by_edge: dict[frozenset[int], list[list[int]]] = {}
    for face in fold["faces_vertices"]:
        for i in range(3):
            by_edge.setdefault(frozenset((face[i], face[(i + 1) % 3])), []).append(face)
    for edge, angle in zip(fold["edges_vertices"], fold["edges_foldAngle"], strict=True):
        two = by_edge[frozenset(edge)]
        if len(two) == 2:
            assert fold_angle_deg(folded, two, edge) == pytest.approx(angle, abs=0.05)


def lengths(points: NDArray[np.float64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    return found


def fold_angle_deg(points: NDArray[np.float64], faces: list[list[int]], edge: list[int]) -> float:
    """The angle between two triangles' normals, positive if the normals point towards each other."""
    normals = []
    for face in faces:
        a, b, c = points[face]
        normal = np.cross(b - a, c - a)
        normals.append(normal / np.linalg.norm(normal))
    (tip,) = set(faces[1]) - set(edge)
    towards = np.sign(normals[0] @ (points[tip] - points[edge[0]]))
    angle = math.degrees(math.atan2(float(np.linalg.norm(np.cross(*normals))), float(normals[0] @ normals[1])))
    return float(towards) * angle
