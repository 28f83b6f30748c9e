"""Poses of cars, cards and the camera itself from pictures with known truth; printed sheets and lenses."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy
import pytest
from pypdf import PdfReader

from filmed import Camera, Car, Film, Filming, Thing, floor_markers, marker, rotation
from filmed_scene import BOX, COURSE, FILMING, SCENE, photo
from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.errors import FoldcarError
from foldcar.scenes.obstacles import Obstacle
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.runner import RunRequest
from foldcar.trials.camera.detection import Detector
from foldcar.trials.camera.filming import car_marker
from foldcar.trials.camera.ground import Place, fit_heights, height_remarks, standing
from foldcar.trials.camera.lens import BOARD_SQUARES, SQUARE_M, board, calibrate
from foldcar.trials.camera.markers import FIRST_OBSTACLE_ID, FloorMarker, course_json, read_course, rectangle
from foldcar.trials.camera.photo import measure_placement
from foldcar.trials.camera.poses import find_pose
from foldcar.trials.camera.view import find_view
from study_car import car_texts


def pictures(scene: Any) -> tuple[list[tuple[Any, Any]], Any, Any]:
    """True poses and corners of the car's marker as a camera sees them, of a drive there; the view, the car's body."""
    body, settings = car_texts(95, 8)
    request = RunRequest("car", "scene", json.dumps({**json.loads(settings), "path_interval_s": 0.033}), "t", 0)
    (answer,) = Carsim().run({"car": body}, {"scene": json.dumps(scene)}, [request])
    filming, chance = Filming(k1=-0.02), numpy.random.default_rng(4)
    camera, course, car = Camera(filming), rectangle(), Car()

    def corners(thing: Thing) -> Any:
        side = thing.half[0] / 1.4
        flat = numpy.array([(-side, side, 0), (side, side, 0), (side, -side, 0), (-side, -side, 0)])
        return camera.pixels(thing.place + flat @ thing.turn.T) + chance.normal(0, 0.15, (4, 2))

    floor = {marker.id: corners(thing) for marker, thing in zip(course.floor, floor_markers(course), strict=True)}
    view = find_view(floor, course, (filming.width, filming.height), None, "picture")
    shown = [(numpy.array(row[1:7]), corners(car.things(row[1:7])[-1])) for row in answer["path"]]
    return shown, view, json.loads(body)


def seen(course: Any) -> dict[int, Any]:
    return Detector().find(photo(course))


@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_obstacles_are_as_high_as_the_car_shows(factor: float) -> None:
    box = {**BOX, "x_m": 0.7, "height_m": 0.03}
    shown, view, body = pictures({**SCENE, "terrain": [{**box, "height_m": 0.03 * factor}]})
    planned, car = standing({**SCENE, "terrain": [box]}, carsim_heights(Carsim()), body), car_marker(body, COURSE)

    poses = [find_pose(seen, view, car, planned) for _, seen in shown]
    heights = fit_heights([pose for pose in poses if pose], planned, 0.15)

    height, error = heights.factors[1], heights.factor_errors[1]
    assert abs(height - factor) < 2 * error < 0.15
    sentences = (
        [f"obstacle at 700, 90 mm were {height:.2f} ± {error:.2f} times as high as planned"] if factor != 1 else []
    )
    remarks = height_remarks(heights, "film")
    with pytest.raises(FoldcarError, match=r"film: is a film of another trial: .* obstacle at 700, 90 mm"):
        height_remarks(replace(heights, factors=heights.factors * [1, 0.3]), "film")
    assert len(remarks) == len(sentences) and all(
        sentence in remark for sentence, remark in zip(sentences, remarks, strict=True)
    )
    off = numpy.array([find_pose(seen, view, car, heights).values - true for true, seen in shown])
    place_m = numpy.hypot(off[:, 0], off[:, 1])
    assert numpy.median(place_m) < 0.003 and numpy.quantile(place_m, 0.95) < 0.006


def test_a_car_that_leans_on_a_pyramid_is_where_it_is_seen() -> None:
    sides_m = (0.23, 0.16, 0.09)
    steps = [
        {"kind": "box", "x_m": 0.46, "y_m": 0.12, "heading_rad": 0.0, "length_m": a, "width_m": a, "height_m": 0.0295 * k}
        for k, a in enumerate(sides_m, 1)
    ]
    scene = {**SCENE, "terrain": steps, "start": {"x_m": 0.0, "y_m": 0.01, "heading_rad": 0.01}}
    shown, view, body = pictures(scene)
    ground, car = standing(scene, carsim_heights(Carsim()), body), car_marker(body, rectangle())

    ground = fit_heights([find_pose(corners, view, car, ground) for _, corners in shown], ground, 0.15)
    poses = [find_pose(corners, view, car, ground) for _, corners in shown]

    true = numpy.array([pose for pose, _ in shown])
    # From there on it falls onto its side.
    leans = (numpy.abs(true[:, 4:6]).max(axis=1) > math.radians(10)) & (true[:, 0] < 0.6)
    assert leans.sum() > 15 and numpy.abs(true[:, 5]).max() > math.radians(25)
    off = numpy.array([pose.values for pose in poses])[leans] - true[leans]
    error = numpy.sqrt([pose.covariance(0.15).diagonal() for pose in poses])[leans]
    assert abs(off[:, 1].mean()) < 0.0025 and abs(off[:, 2].mean()) < 0.002
    assert (abs(off[:, 1]) < 2 * error[:, 1]).mean() > 0.8


def test_a_car_with_wheels_of_two_radii_stands_tilted() -> None:
    body = body_json(compose("W_B_W", {"W2.radius": 50}))
    stance = standing({**SCENE, "terrain": []}, carsim_heights(Carsim()), body).stance_at(Place(0.5, 0.0, 0.3))

    # Axles 140 mm apart, the car's middle halfway between them.
    assert stance.values == pytest.approx([0.055, math.asin(10 / 140), 0.0], abs=3e-4)


def test_a_car_with_a_wheel_on_a_step_stands_on_a_diagonal() -> None:
    body = json.loads(car_texts(95, 8)[0])
    ahead, left = body["wheels"][0]["x_m"], body["track_m"] / 2
    box = {**BOX, "x_m": 0.5 + ahead, "y_m": left, "heading_rad": 0.0, "length_m": 0.06, "width_m": 0.06}
    ground = standing({**SCENE, "terrain": [box]}, carsim_heights(Carsim()), body)
    sure = ground.rescaled(ground.factors, 0 * ground.factors)

    stance = sure.stance_at(Place(0.5, 0.0, 0.0))

    # It leans between two planes: one has the other front wheel on the floor, one the other rear wheel.
    height, slope, bank = 0.025 / 2, 0.025 / 2 / ahead, 0.025 / 2 / left
    assert stance.values == pytest.approx([body["wheels"][0]["radius_m"] + height, slope / 2, bank / 2], abs=1e-3)
    for pitch, roll in ((0.0, bank), (slope, 0.0)):
        off = numpy.array([0.0, pitch, roll]) - [0.0, slope / 2, bank / 2]
        assert off @ numpy.linalg.inv(stance.covariance) @ off < 2
    assert numpy.sqrt(stance.covariance[0, 0]) < 0.005


def test_a_photo_gives_the_places_of_car_and_obstacles() -> None:
    thing = Obstacle("Bump", (0,), 0.49, 0.10, 0.18, 0.15, 0.15)
    back = 0.075 + COURSE.card_reach_m
    card = numpy.array([0.5 - back * numpy.sin(0.2), 0.09 + back * numpy.cos(0.2), 0.0])
    card_marker = marker(FIRST_OBSTACLE_ID, COURSE.obstacle_size_m, card, rotation(0.2))
    pose = numpy.array([0.104, -0.025, 0.06, 0.06, 0.0, 0.0])
    body = json.loads(car_texts()[0])

    picture = photo(COURSE, card_marker, pose=pose)
    ground = standing({**SCENE, "terrain": []}, carsim_heights(Carsim()), body)
    things = {"A": thing, "B": thing}
    placed = measure_placement(picture, "photo", COURSE, None, SCENE, things, car_marker(body, COURSE), ground)

    assert placed.missing == ("B",)
    for name, true in {"A": (0.01, -0.01, 0.02), "car": (0.004, -0.005, 0.03)}.items():
        off = numpy.abs(numpy.subtract(placed.deviations[name], true))
        assert (off < 3 * numpy.array(placed.errors[name])).all() and off[:2].max() < 0.003 and off[2] < 0.012, name
        assert max(placed.errors[name][:2]) < 0.004


def test_a_card_on_a_hill_or_a_hole_lies_as_high_as_these_carry_it() -> None:
    hill = {"kind": "hill", "x_m": 0.4, "y_m": 0.1, "heading_rad": 0.2, "sd_along_m": 0.08, "sd_across_m": 0.06}
    hole = {"kind": "pothole", "x_m": 0.8, "y_m": -0.1, "radius_m": 0.03, "depth_m": 0.02, "edge_m": 0.005}
    scene = {**SCENE, "terrain": [{**hill, "height_m": 0.04}, hole]}
    things = {
        "A": Obstacle("Hill", (0,), 0.4, 0.1, 0.2, 0.64, 0.48),
        "B": Obstacle("Pothole", (1,), 0.8, -0.1, 0.0, 0.06, 0.06),
    }
    # The card is wider than the hole; how it is turned says nothing.
    size, places = COURSE.obstacle_size_m, ((0.41, 0.085, 0.04, 0.25), (0.79, -0.08, 0.0, 0.7))
    cards = [marker(FIRST_OBSTACLE_ID + k, size, (x, y, z), rotation(turn)) for k, (x, y, z, turn) in enumerate(places)]
    body = json.loads(car_texts()[0])
    ground = standing(scene, carsim_heights(Carsim()), body)

    lid_marker = car_marker(body, COURSE)
    placed = measure_placement(photo(COURSE, *cards), "photo", COURSE, None, scene, things, lid_marker, ground)

    for name, true in {"A": (0.01, -0.015, 0.05), "B": (-0.01, 0.02, 0.0)}.items():
        off = numpy.abs(numpy.subtract(placed.deviations[name], true))
        assert (off < 3 * numpy.array(placed.errors[name])).all() and off[:2].max() < 0.004 and off[2] < 0.012, name
        assert 0.002 < max(placed.errors[name][:2]) < {"A": 0.012, "B": 0.006}[name]


def test_missing_and_moved_floor_markers_are_told() -> None:
    size = (FILMING.width, FILMING.height)
    whole = seen(COURSE)
    three = {number: marker for number, marker in whole.items() if number != 2}
    pushed = replace(COURSE, floor=tuple(replace(m, x_m=m.x_m + 0.04 * (m.id == 1)) for m in COURSE.floor))
    camera = Camera(FILMING)

    assert find_view(whole, COURSE, size, None, "photo").remarks == ()
    view = find_view(three, COURSE, size, None, "photo")
    assert view.remarks == ("floor marker 2 is not seen",)
    assert abs(view.lens.focal_px / camera.focal - 1) < 0.02 and numpy.abs(view.place_m - camera.place).max() < 0.03
    (remarks,) = find_view(seen(pushed), COURSE, size, None, "photo").remarks
    message = r"floor marker 1 lies (3[89]|4[012]) mm from its position, at 11[34]\d, \d+ mm; it is left out"
    assert re.fullmatch(message, remarks)
    turned = replace(COURSE, floor=(FloorMarker(0, 0.0, 0.4, 1.2), *COURSE.floor[1:]))
    assert find_view(seen(turned), turned, size, None, "photo").remarks == ()
    with pytest.raises(FoldcarError, match=r"^photo: floor markers 1, 2 not seen: 3 of 4 are needed$"):
        find_view({number: whole[number] for number in (0, 3)}, COURSE, size, None, "photo")
    with pytest.raises(FoldcarError, match=r"^photo: the floor markers do not have the positions or sizes of the course"):
        find_view(whole, rectangle(1.0, 0.9), size, None, "photo")


def test_the_lens_of_a_board_is_that_of_the_camera(tmp_path: Path) -> None:
    columns, rows = BOARD_SQUARES
    texture = board().generateImage((columns * 40, rows * 40), None, 0, 1).astype(numpy.float32)
    plate = Thing(numpy.eye(3), numpy.zeros(3), (columns * SQUARE_M / 2, rows * SQUARE_M / 2), texture)
    places = [
        *((0.0, -0.12, 0.3), (0.15, -0.1, 0.25), (-0.15, -0.12, 0.28), (0.05, 0.2, 0.25), (0.0, -0.25, 0.2)),
        *((0.2, 0.02, 0.22), (-0.2, 0.05, 0.25), (0.1, -0.02, 0.35), (-0.08, 0.1, 0.33), (0.12, 0.14, 0.24)),
    ]
    filming = Filming(width=640, height=360, k1=-0.05, k2=0.01, moments=1)
    for at, place in enumerate(places):
        moved = replace(filming, place_m=place, aim_m=(0.02 * (at % 3 - 1), 0.015 * (at % 4 - 1), 0.0))
        cv2.imwrite(str(tmp_path / f"{at}.png"), Film(moved, [plate], None, None).frame(0.0))

    lens, views = calibrate(sorted(tmp_path.glob("*.png")))

    camera = Camera(filming)
    assert views >= 8 and abs(lens.focal_px / camera.focal - 1) < 0.005
    assert numpy.abs(numpy.subtract(lens.middle_px, camera.middle)).max() < 4
    corner = numpy.array([[0.5, 0.28, 1.0]])
    true = camera.pixels(corner @ camera.turn + camera.place)
    assert numpy.abs(lens.pixels(corner) - true).max() < 2
    with pytest.raises(FoldcarError, match=r"^.*/0.png: 1 views show at least 20 corners"):
        calibrate([tmp_path / "0.png"])


def test_sheets_have_markers_of_their_size_that_are_read(tmp_path: Path, foldcar: Any) -> None:
    done = foldcar("markers", "-o", "m", "--course", "1100x800")

    assert (done.returncode, done.stdout.split()) == (0, ["m/markers.pdf", "m/course.json"])
    assert json.loads((tmp_path / "m" / "course.json").read_text()) == course_json(COURSE)
    pages = PdfReader(tmp_path / "m" / "markers.pdf").pages
    facts = {}
    for page in pages:
        assert [round(float(side) / 72 * 25.4) for side in page.mediabox[2:]] == [210, 297]
        picture = numpy.full((2970, 2100), 255, numpy.uint8)
        content = page.get_contents().get_data().decode("latin-1")
        # What is filled, not what is drawn as a line.
        filled = " ".join(re.findall(r"n ((?:[-.\d]+ [-.\d]+ [-.\d]+ [-.\d]+ re\s+)+)f", content))
        for words in re.findall(r"([-.\d]+) ([-.\d]+) ([-.\d]+) ([-.\d]+) re", filled):
            x, y, wide, high = (10 * float(number) for number in words)
            picture[round(2970 - y - high) : round(2970 - y), round(x) : round(x + wide)] = 0
        facts |= Detector().find(picture)
    sides = {number: float(numpy.linalg.norm(corners_px[0] - corners_px[1])) / 10 for number, corners_px in facts.items()}
    expected = {**dict.fromkeys(range(4), 120), 10: 50, **dict.fromkeys(range(20, 24), 60)}
    assert {number: round(side) for number, side in sides.items()} == expected


def test_a_byte_order_mark_is_no_part_of_a_course(tmp_path: Path) -> None:
    (tmp_path / "course.json").write_text("\ufeff" + json.dumps(course_json(COURSE)), encoding="utf-8")

    assert course_json(read_course(tmp_path / "course.json")) == course_json(COURSE)
