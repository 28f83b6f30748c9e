"""The view page in a browser: the car that it puts together, parts that it names, the run that it replays."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from browser import probed
from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.assembly.faces import face_poses, moved
from foldcar.fabrication.assembly.scene_shape import SceneShapes, recorded_run
from foldcar.fabrication.assembly.view_page import view_page
from foldcar.models.exported_car import main_segment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import carsim_heights
from published_cars import car
from published_cars import design as published_design

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
    probe = probed(view_page(folded, "a car"), tmp_path, "", PUT_TOGETHER)

    flat, built = np.array(probe["boxes"][0]), np.array(probe["boxes"][-1])
    assert flat[5] - flat[2] == pytest.approx(0, abs=1e-3)
    assert built == pytest.approx(film_box(folded), abs=2e-3)
    nuts = sum("nut" in mount.part for mount in folded.mounts)
    # Nothing is put in twice, nothing leaves, and in the end all is there.
    assert probe["counts"][1:] == sorted(probe["counts"][1:])
    assert probe["counts"][-1] == len(folded.placed) + len(folded.mounts) + nuts
    # Exploded parts are apart: the film takes more room to the left and above.
    assert (np.array(probe["exploded"])[4:] > built[4:] + 10).all()
    names = {piece.name for piece in folded.pieces} | {mount.name for mount in folded.mounts}
    assert len(probe["named"]) >= 4
    for name in probe["named"]:
        assert any(name.startswith(known) for known in names)
    assert probe["tip"] == probe["tapped"] != ""
    assert probe["turned_rad"] == pytest.approx(0.12, abs=1e-6)


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


def run_data(folded: FoldedCar, body: dict[str, Any], rows: Any, terrain: Any = (), outcome: str = "passed") -> Any:
    answer, where = {"outcome": outcome}, scene(terrain=list(terrain))
    return recorded_run(folded, body, where, answer, rows, lambda _, x, y: STEP_M * np.exp(-(x**2)), "Told.")


def test_wheels_that_do_not_slip_turn_by_the_way_of_each(tmp_path: Path) -> None:
    design = compose("W_B_W", {})
    folded, body = folded_car(design), body_json(design)
    # Half a left turn of radius 1 m, then 0.5 m back.
    turn, still = np.linspace(0, np.pi, 2001), np.zeros(2001)
    circle = np.column_stack([turn, np.sin(turn), 1 - np.cos(turn), still, turn, still, still])
    back = circle[-1] + np.outer(np.linspace(0, 1, 11)[1:], [1, 0.5, 0, 0, 0, 0, 0])
    run = run_data(folded, body, np.vstack([circle, back]))

    probe = probed(view_page(folded, "a car", run), tmp_path, "time=0", WHEELS)

    track = body["track_m"]
    for wheel, angles in zip(body["wheels"], probe, strict=True):
        side = -1 if wheel["side"] == "left" else 1
        half = np.pi * (1 + side * track / 2) / wheel["radius_m"]
        for angle, way in zip(angles, (half, half - 0.5 / wheel["radius_m"]), strict=True):
            assert np.exp(1j * angle) == pytest.approx(np.exp(1j * way), abs=1e-3)


# The turn of each wheel about +y in its segment, after the half turn and at the end.
WHEELS = """
  const driven = view.run.cars()[0].car, turns = driven.wheels.map(() => []);
  for (const t of [Math.PI, 10]) {
    view.run.time(t);
    driven.body.wheels.forEach((wheel, k) => {
      const own = driven.segments[wheel.segment].matrix.clone().invert().multiply(driven.wheels[k].matrix).elements;
      turns[k].push(Math.atan2(own[8], own[0]));
    });
  }
  return turns;
"""


def test_page_replays_a_run_of_a_hinged_car_on_the_simulators_ground(tmp_path: Path, carsim_binary: Path) -> None:
    """Poses against scipy's rotations; at each hinge two segments stay together, and wheels on their axles.

    Blocks are exact, smooth ground is within its grid, where both meet the higher of them.
    """
    design = published_design("hinged")
    folded, body = folded_car(design), body_json(design)
    rows = [[0.0, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.6, 0.1, 0.07, 0.5, 0.3, -0.2, -0.4, -0.25]]
    at = {"heading_rad": 0.4, "length_m": 0.4, "width_m": 0.3, "height_m": 0.05}
    hill = {"sd_along_m": 0.2, "sd_across_m": 0.1}
    terrain = [
        *({"kind": kind, "x_m": x, "y_m": 0.2, **at} for kind, x in (("box", -0.2), ("ramp", 0.3), ("half_round", 0.8))),
        {"kind": "hill", "x_m": 0.4, "y_m": -0.2, "heading_rad": 0.2, "height_m": 0.04, **hill},
        {"kind": "pothole", "x_m": 1.0, "y_m": -0.3, "radius_m": 0.2, "depth_m": 0.03, "edge_m": 0.1},
    ]
    heights, where = carsim_heights(Carsim(carsim_binary)), scene(terrain=terrain)
    chance = np.random.default_rng(3)
    x, y = chance.uniform(-0.4, 1.4, 400), chance.uniform(-0.5, 0.5, 400)
    run = recorded_run(folded, body, where, {"outcome": "passed"}, rows, heights, "Told.")
    points = f"const points = {np.column_stack([x, y]).tolist()};"

    probe = probed(view_page(folded, "a car", run), tmp_path, "time=1", points + REPLAY)

    poses = {name: np.array(pose) for name, pose in probe["bodies"].items()}
    # Intrinsic: about z, then nose up, then left side up.
    turn = Rotation.from_euler("ZYX", [0.5, -0.3, -0.2]).as_matrix()
    main = poses[f"segment{main_segment(body)}"]
    assert main[:3, :3] == pytest.approx(turn, abs=1e-6)
    assert main[:3, 3] == pytest.approx([0.6, 0.1, 0.07], abs=1e-6)
    for hinge, fold in zip(folded.hinges, (-0.4, -0.25), strict=True):
        front, rear, at = poses[hinge.front], poses[hinge.rear], np.array([*np.array(hinge.center_mm) / 1000, 1.0])
        assert front @ at == pytest.approx(rear @ at, abs=1e-6)
        # Positive with the front segment's nose up, which is a negative turn about +y.
        assert rear[:3, :3].T @ front[:3, :3] == pytest.approx(Rotation.from_rotvec([0, -fold, 0]).as_matrix(), abs=1e-6)
    for axle in folded.axles:
        center = np.array([*np.array(axle.center_mm) / 1000, 1.0])
        assert poses[axle.wheel] @ center == pytest.approx(poses[axle.body] @ center, abs=1e-6)
    # The simulator's half-round has facets; points at a block's very edge may be on either side of it.
    assert np.quantile(np.abs(np.array(probe["ground_m"]) - heights(where, x, y)), 0.99) < 0.001
    assert np.ptp(probe["ground_m"]) > 0.06 and min(probe["ground_m"]) < -0.01
    assert "did not slip" in probe["told"]
    # The camera has an obstacle in its picture.
    assert np.abs(probe["seen"]).max() < 1


REPLAY = """
  const { car, ground } = view.run.cars()[0];
  const rows = m => [0, 1, 2, 3].map(row => [0, 1, 2, 3].map(column => m.elements[4 * column + row]));
  const bodies = Object.fromEntries([
    ...car.segments.map((one, k) => [`segment${k}`, rows(one.matrix)]),
    ...car.body.wheels.map((wheel, k) => [`wheel${wheel.channel}`, rows(car.wheels[k].matrix)])]);
  const point = car.group.position.clone().set(0.3, 0.2, 0.05).project(view.run.lens());
  return { bodies, ground_m: points.map(([x, y]) => ground.height(x, y)),
    seen: [point.x, point.y], told: document.getElementById("told").textContent };
"""


def test_every_face_of_film_is_where_the_car_is_folded(tmp_path: Path) -> None:
    """What the page draws of a car, against its film; at hinges faces beyond go with the other segment."""
    folded = car("hinged")
    shapes = SceneShapes()
    parts = shapes.add(folded)

    drawn, bodies = [], set()
    for part in parts:
        pose = np.vstack([np.reshape(part["pose"], (3, 4)), [0, 0, 0, 1]])
        for number, rings in enumerate(shapes.pieces[part["piece"]].get("faces", ())):
            drawn.append(moved(pose, np.reshape(rings[0], (-1, 3)) / 10))
            bodies.add(part.get("beyond", {}).get(number, part["body"]))
    every = np.concatenate(drawn)
    layered = film_box(folded)

    assert np.concatenate([every.min(axis=0), every.max(axis=0)]) == pytest.approx(layered, abs=1.1)
    assert sum("beyond" in part for part in parts) == len(folded.hinges)
    for part in parts:
        assert set(part.get("beyond", {}).values()) <= {f"segment{k}" for k in range(3)} - {part["body"]}
    # Wheels are equal: the page has their pieces once.
    assert len(shapes.pieces) < len(parts) / 2
    assert bodies == {part["body"] for part in parts if "faces" in shapes.pieces[part["piece"]]}


def test_a_stuck_cars_belly_is_marked_where_it_hangs(tmp_path: Path) -> None:
    design = compose("W_B_W", {})
    folded, body = folded_car(design), body_json(design)
    bottom = min(segment["center_z_m"] - segment["height_m"] / 2 for segment in body["segments"])
    rail = {"kind": "box", "x_m": 0.5, "y_m": 0.0, "heading_rad": 0.0, "length_m": 0.02, "width_m": 0.5, "height_m": 0.08}
    z = 0.08 - bottom
    rows = [[0.0, 0.5, 0.0, z, 0.0, 0.0, 0.0], [1.0, 0.5, 0.0, z, 0.0, 0.0, 0.0]]
    page = view_page(folded, "a car", run_data(folded, body, rows, [rail], "stuck"))

    probe = probed(page, tmp_path, "time=1", """
      const [{ marks }] = view.run.cars();
      return marks.visible ? marks.children.map(one => one.position.toArray()) : null;
    """)  # fmt: skip

    assert probe and all(abs(x - 0.5) <= 0.011 and place == pytest.approx(0.08, abs=0.003) for x, _, place in probe)


def test_without_webgl_a_run_has_roll_and_pitch(tmp_path: Path) -> None:
    design = compose("W_B_W", {})
    folded, body = folded_car(design), body_json(design)
    rows = [[0.0, 0.0, 0.0, 0.06, 0.0, 0.0, 0.0], [1.0, 0.5, 0.0, 0.06, 0.0, 0.0, 0.0]]
    page = view_page(folded, "a car", run_data(folded, body, rows))
    # The assembly needs WebGL; here only the run is without.
    no_webgl = """const own = HTMLCanvasElement.prototype, get = own.getContext;
      own.getContext = function (kind, ...rest) {
        return /webgl/.test(kind) && this.id !== "model" ? null : get.call(this, kind, ...rest);
      };"""
    probe = probed(page, tmp_path, "time=0", """
      view.run.time(0.8);
      return [document.querySelector(".scene-picture").textContent, document.querySelector(".strips").height];
    """, no_webgl)  # fmt: skip

    assert probe[0].startswith("Without WebGL") and probe[1] > 60
