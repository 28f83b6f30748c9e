"""The view page in a browser: the car that it puts together, parts that it names, the run that it replays."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.assembly.faces import face_poses, moved
from foldcar.fabrication.assembly.recorded_run import recorded_run, rolled_rad
from foldcar.fabrication.assembly.view_page import view_page
from view_probe import probed

HINGED = {"width": 95.0, "height": 50.0, "radius": 40.0, "W.length": 90.0, "B.length": 80.0}
# A block's worth of ground, so that the map has heights.
STEP_M = 0.02


def film_box(folded: FoldedCar) -> np.ndarray:
    """Minimum and maximum coordinates of the middle surfaces of the built car's film; layers are drawn 1 mm off."""
    pieces = {piece.name: piece for piece in folded.pieces}
    layers = {join.piece_a for join in folded.joins if join.kind == "laminate"}
    points = []
    for placed in folded.placed:
        piece = pieces[placed.piece]
        poses = face_poses(piece)
        for face in piece.faces:
            corners = moved(poses[face.name], np.array(face.outline_mm)) + np.array((0, 0, placed.piece in layers))
            points.append(corners @ np.array(placed.pose)[:3, :3].T + np.array(placed.pose)[:3, 3])
    every = np.concatenate(points)
    return np.concatenate([every.min(axis=0), every.max(axis=0)])


def test_page_puts_the_car_together_and_names_its_parts(tmp_path: Path) -> None:
    folded = folded_car(compose("W_B_W", {}))
    found = probed(view_page(folded, "a car", []), tmp_path, "", PUT_TOGETHER)

    flat, built = np.array(found["boxes"][0]), np.array(found["boxes"][-1])
    assert flat[5] - flat[2] == pytest.approx(0, abs=1e-3)
    assert built == pytest.approx(film_box(folded), abs=2e-3)
    nuts = sum("nut" in mount.part for mount in folded.mounts)
    # Nothing is put in twice, nothing leaves, and in the end all is there.
    assert found["counts"][1:] == sorted(found["counts"][1:])
    assert found["counts"][-1] == len(folded.placed) + len(folded.mounts) + nuts
    # Exploded parts are apart: the film takes more room to the left and above.
    assert (np.array(found["exploded"])[4:] > built[4:] + 10).all()
    names = {piece.name for piece in folded.pieces} | {mount.name for mount in folded.mounts}
    assert len(found["named"]) >= 4
    for name in found["named"]:
        assert any(name.startswith(known) for known in names)
    assert found["tip"] == found["tapped"] != ""
    assert found["turned_rad"] == pytest.approx(0.12, abs=1e-6)


# Pictures are not looked at here.
PUT_TOGETHER = """
  view.stage.renderer.render = () => {};
  const box = () => document.body.dataset.box.split(" ").map(Number);
  const boxes = [], counts = [], steps = view.car.steps;
  for (let step = 0; step <= steps; step++) {
    view.set(step);
    boxes.push(box());
    counts.push(view.car.parts.filter(one => one.group.visible).length);
  }
  document.getElementById("explode").value = 1;
  view.show();
  const exploded = box();
  document.getElementById("explode").value = 0;
  view.show();
  const canvas = document.getElementById("model"), area = canvas.getBoundingClientRect(), named = new Set();
  const point = (type, x, y, pointerType) => canvas.dispatchEvent(new PointerEvent(type, {
    clientX: area.left + x * area.width, clientY: area.top + y * area.height, pointerType, bubbles: true }));
  for (let x = 0.02; x < 1; x += 0.09) for (let y = 0.02; y < 1; y += 0.09) {
    point("pointermove", x, y, "mouse");
    if (document.body.dataset.named) named.add(document.body.dataset.named);
  }
  point("pointerdown", 0.5, 0.5, "touch");
  point("pointerup", 0.5, 0.5, "touch");
  const tip = document.getElementById("tip"), tapped = document.body.dataset.named;
  const heading = () => Math.atan2(view.stage.camera.position.y - view.stage.controls.target.y,
    view.stage.camera.position.x - view.stage.controls.target.x);
  const before = heading();
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
  return { boxes, counts, exploded, named: [...named], tapped, tip: tip.hidden ? "" : tip.textContent,
    turned_rad: Math.abs(heading() - before) };
"""


def scene(**more: Any) -> dict[str, Any]:
    course = {"x_min_m": -0.5, "x_max_m": 1.5, "y_min_m": -0.6, "y_max_m": 0.6}
    start = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}
    goal = {"kind": "line", "x_m": 1.2, "y_m": 0.0, "heading_rad": 0.0}
    return {"friction": 0.7, "terrain": [], "start": start, "goal": goal, "course": course, **more}


def test_wheels_that_do_not_slip_turn_by_the_way_of_each() -> None:
    body = {"track_m": 0.14, "wheels": [{"side": "left", "radius_m": 0.06}, {"side": "right", "radius_m": 0.05}]}
    # Half a left turn of radius 1 m, then 0.5 m back.
    turn = np.linspace(0, np.pi, 2001)
    circle = np.column_stack([turn, np.sin(turn), 1 - np.cos(turn), np.zeros_like(turn), turn])
    back = circle[-1] + np.outer(np.linspace(0, 1, 11)[1:], [1, 0.5, 0, 0, 0])

    left, right = rolled_rad(body, np.vstack([circle, back])).T

    assert left[2000] == pytest.approx(np.pi * (1 - 0.07) / 0.06, rel=1e-6)
    assert right[2000] == pytest.approx(np.pi * (1 + 0.07) / 0.05, rel=1e-6)
    assert left[-1] - left[2000] == pytest.approx(-0.5 / 0.06, rel=1e-6)


def test_page_replays_a_run_of_a_hinged_car(tmp_path: Path) -> None:
    """Poses against scipy's rotations; at each hinge two segments and the strip that joins them stay together."""
    design = compose("W_B_H_W_H_W", HINGED)
    folded, body = folded_car(design), body_json(design)
    rows = [[0.0, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.6, 0.1, 0.07, 0.5, 0.3, -0.2, -0.4, -0.25]]
    run = recorded_run(body, scene(), rows, lambda _, x, y: np.where(x > 0.5, STEP_M, 0.0), "Told.")

    found = probed(view_page(folded, "a car", [], run), tmp_path, "time=1", REPLAY)

    poses = {name: np.array(pose) for name, pose in found["bodies"].items()}
    # Intrinsic: about z, then nose up, then left side up.
    turn = Rotation.from_euler("ZYX", [0.5, -0.3, -0.2]).as_matrix()
    main = poses[f"segment{run['main']}"]
    assert main[:3, :3] == pytest.approx(turn, abs=1e-6)
    assert main[:3, 3] == pytest.approx([600, 100, 70], abs=1e-6)
    for hinge, fold in zip(folded.hinges, (-0.4, -0.25), strict=True):
        front, rear, at = poses[hinge.front], poses[hinge.rear], np.array([*hinge.center_mm, 1.0])
        assert front @ at == pytest.approx(rear @ at, abs=1e-6)
        # Positive with the front segment's nose up, which is a negative turn about +y.
        assert rear[:3, :3].T @ front[:3, :3] == pytest.approx(Rotation.from_rotvec([0, -fold, 0]).as_matrix(), abs=1e-6)
    # Every strip lies flat on both floors: its corners are within film and glue of where each segment takes them.
    assert len(found["strips"]) == len(folded.hinges)
    for strip in found["strips"]:
        own, bent = np.array(strip["corners"]), np.array(strip["flat"])
        beyond = [np.linalg.norm((pose @ np.column_stack([bent, np.ones(len(bent))]).T).T[:, :3] - own, axis=1).max()
                  for name, pose in poses.items() if name.startswith("segment")]  # fmt: skip
        assert min(beyond) < 0.5
    for axle in folded.axles:
        center = np.array([*axle.center_mm, 1.0])
        assert poses[axle.wheel] @ center == pytest.approx(poses[axle.body] @ center, abs=1e-6)
    assert found["ground_mm"] == [0, 1000 * STEP_M]
    assert "did not slip" in found["told"]


REPLAY = """
  const rows = m => [0, 1, 2, 3].map(row => [0, 1, 2, 3].map(column => m.elements[4 * column + row]));
  const bodies = Object.fromEntries([...view.car.bodies].map(([name, body]) => [name, rows(body.matrix)]));
  const corners = (one, face) => one.corners[face].map(corner => corner.clone());
  const strips = view.car.parts.filter(one => one.part.hinge).map(one => {
    const face = one.part.hinge.face, body = view.car.bodies.get(one.part.body).matrix;
    const now = corners(one, face).map(corner => corner.applyMatrix4(one.group.matrix).applyMatrix4(body).toArray());
    one.fold(one.piece.faces.map(() => 1), 0);
    return { corners: now, flat: corners(one, face).map(corner => corner.applyMatrix4(one.group.matrix).toArray()) };
  });
  const ground = view.run.ground;
  return { bodies, strips, ground_mm: [ground.height(300, 0), ground.height(700, 0)],
    told: document.getElementById("told").textContent };
"""
