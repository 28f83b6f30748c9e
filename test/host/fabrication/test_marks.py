"""Marks that help to build: arrow to the front, ends of hinge strips, counts on repeated pieces; feet of the bridge."""

import numpy as np
import pytest

from foldcar.car.folded.model import FoldedCar, Solid
from foldcar.car.folded.placed import PlacedFace, placed_faces
from foldcar.car.folded.pose import translation
from foldcar.car.proof.blocks import Blocks, first_obstacle, merge_blocks, solid_blocks
from foldcar.car.proof.prove import assembly_steps
from foldcar.car.proof.roles import roles_of
from foldcar.car.proof.scene import CarSolids, Stage
from foldcar.car.proof.step import PartKey
from foldcar.fabrication.patterns import piece_shapes as piece_shapes_module
from foldcar.fabrication.patterns.flat_piece import flat_piece
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.piece_shapes import piece_shapes
from published_cars import car


def faces(folded: FoldedCar) -> list[PlacedFace]:
    return [face for faces_of_body in placed_faces(folded).values() for face in faces_of_body]


@pytest.mark.parametrize(("name", "segments"), [("w95", 1), ("hinged", 3)])
def test_an_arrow_on_each_floor_points_to_the_front(name: str, segments: int) -> None:
    arrows = [(face, mark) for face in faces(car(name)) for mark in face.face.marks if mark.name == "FRONT"]

    assert len(arrows) == segments
    for face, mark in arrows:
        corners = face.in_car(mark.outline_mm)
        (tip,) = corners[corners[:, 0] > corners[:, 0].max() - 0.1]
        assert tip[1] == pytest.approx(corners[:, 1].mean(), abs=0.01)
        # Not below the cap's tab, 8 mm deep.
        assert face.corners_mm[:, 0].max() - tip[0] > 8.5


def test_marks_on_a_hinge_s_strip_lie_along_the_ends_of_the_floors() -> None:
    placed = faces(car("hinged"))
    ends = sorted(
        x for face in placed if face.face.name == "floor" for x in np.unique(face.corners_mm[:, 0].round(3))[[0, -1]]
    )
    marked = [face.in_car(mark.outline_mm) for face in placed for mark in face.face.marks if mark.name == "floor"]

    assert len(marked) == 4
    # Each floor's end at a gap is an edge of one mark; the first and last end are caps.
    edges = sorted({round(float(x), 3) for corners in marked for x in corners[:, 0]})
    assert set(ends[1:-1]) <= set(edges) and len(edges) == 8


def test_the_name_of_a_repeated_piece_says_how_often_it_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []

    def label_paths(flat: object, name: str, *_: object) -> tuple[list[object], list[str]]:
        written.append(name)
        return [], []

    monkeypatch.setattr(piece_shapes_module, "label_paths", label_paths)
    for piece in car("w95").pieces:
        piece_shapes(flat_piece(piece, options("laser")), options("laser"), [])

    assert {"servo doubler (x4)", "wheel hub (x4)", "switch doubler (x3)", "front cap", "rear cap"} <= set(written)


@pytest.mark.parametrize("name", ["w65", "w95", "hinged", "six"])
def test_a_bone_folder_reaches_the_bridge_s_feet_from_the_side_without_a_tongue(name: str) -> None:
    folded = car(name)
    placed = {face.face.name: face for face in faces(folded) if face.piece.name == "bridge"}
    low, high = (placed["shelf"].corners_mm[:, 0].min(), placed["shelf"].corners_mm[:, 0].max())
    flange = placed["flange"].corners_mm[:, 0].mean()
    # From 20 mm before the open side to the flange: as wide as a foot, 3 mm high over its film.
    ends = (low + 1.0, high + 20.0) if flange < (low + high) / 2 else (low - 20.0, high - 1.0)
    for side in ("left", "right"):
        y0, y1 = placed[f"{side} foot"].corners_mm[:, 1].min() + 0.5, placed[f"{side} foot"].corners_mm[:, 1].max() - 0.5
        bottom = placed[f"{side} foot"].corners_mm[:, 2].max() + 0.2
        size = (ends[1] - ends[0], y1 - y0, 3.0)
        blade = solid_blocks(Solid("box", size, translation(sum(ends) / 2, (y0 + y1) / 2, bottom + 1.5)), "bone folder")
        assert first_obstacle(blade, standing(folded)) is None, side


def standing(folded: FoldedCar) -> Blocks:
    """What is in the car when the bridge goes in."""
    stage, roles = Stage(roles_of(folded), {}), roles_of(folded)
    for step in assembly_steps(folded):
        stage = stage.closed(step.folds)
        if step.title.startswith("Put the bridge"):
            break
    scene, bodies = CarSolids(roles), roles.segments
    things = [PartKey("piece", copy.piece, copy.copy) for copy in folded.placed if copy.body in bodies]
    things += [PartKey("mount", mount.name, 0) for mount in folded.mounts if mount.body in bodies
               and mount.part not in (folded.parts.battery.name, folded.parts.pad.name)]  # fmt: skip
    return merge_blocks(scene.solid(thing, stage) for thing in things)
