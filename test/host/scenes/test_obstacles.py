"""What stands on the floor as one thing has one letter and is moved as a whole, however many blocks it is made of."""

import math
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.scenes.obstacles import Obstacle, PlacedObject, obstacles_of
from foldcar.scenes.source import open_environment
from foldcar.scenes.terrain_kinds import KINDS
from foldcar.trials.placement import CAR, instructions, lettered, parse_deviation, scene_as_placed, show_placement
from study_car import empty_scene

BOX = {"kind": "box", "heading_rad": 0.1, "length_m": 0.2, "width_m": 0.3, "height_m": 0.02}
PYRAMID = [{**BOX, "x_m": 0.45, "y_m": 0.05}, {**BOX, "x_m": 0.45, "y_m": 0.05, "length_m": 0.1, "width_m": 0.1}]
HOLE = {"kind": "pothole", "x_m": 0.9, "y_m": -0.05, "radius_m": 0.1, "depth_m": 0.02, "edge_m": 0.01}
PROGRAM = """
model model
ego = new Robot at (0, 0), facing -90 deg
ramp = new Ramp at (0.6, 0.1), facing -60 deg, with run_up 0.2, with plateau 0.15, with run_down 0.1
kerb = new Kerb at (1.2, -0.2), facing -90 deg, with length 0.2, with width 0.4
rough = new RoughGround at (1.2, 0.4), with length 0.2, with width 0.2
pyramid = new StepPyramid at (1.6, 0.1)
hole = new Pothole at (0.3, -0.5)
low = new Bump at (1.6, -0.6), with width 0.3, with allowCollisions True
top = new Bump at (1.6, -0.6), with width 0.2, with height 0.03, with allowCollisions True
goal = new Goal at (1.95, 0), facing -90 deg
"""


@pytest.fixture
def sampled(tmp_path: Path) -> tuple[dict[str, Any], dict[str, Obstacle]]:
    (tmp_path / "e.scenic").write_text(PROGRAM)
    scene, obstacles = open_environment(tmp_path / "e.scenic", {}, 1).sample_with_obstacles(0)
    return scene, lettered(obstacles)


def test_each_object_of_several_blocks_is_one_letter(sampled: tuple[dict[str, Any], dict[str, Obstacle]]) -> None:
    scene, things = sampled

    assert [(letter, thing.name, len(thing.pieces)) for letter, thing in things.items()] == [
        ("A", "Ramp", 3), ("B", "Kerb", 2), ("C", "StepPyramid", 3), ("D", "Pothole", 1), ("E", "Bump", 2),
    ]  # fmt: skip
    assert sorted(index for thing in things.values() for index in thing.pieces) == [
        index for index, piece in enumerate(scene["terrain"]) if not KINDS[piece["kind"]].is_floor
    ]
    rows = {row[0]: row[1:] for row in instructions(scene, things)}
    # Scenic's heading of -60 degrees from +y is 30 degrees from +x.
    assert rows["A"][:3] == ("600", "100", "30.0")
    assert rows["A"][3].startswith("Ramp 450 × 600 mm of 3 pieces\n")
    assert rows["B"][:3] == ("1200", "-200", "0.0") and rows["B"][3].startswith("Kerb 200 × 400 mm of 2 pieces\n")
    assert rows["C"][:2] == ("1600", "100") and rows["C"][3].startswith("StepPyramid 230 × 230 mm of 3 pieces\n")
    assert rows["D"][3].startswith("hole 15.0 mm deep, radius 80 mm\n")
    # The slopes of the ramp end 225 mm from its middle, along 30 degrees; the second one is turned round.
    for number, ahead_mm, heading, text in (
        (1, -125, "30.0", "ramp 200 × 600 × 40.0 mm"),
        (2, 50, "30.0", "box 150 × 600 × 40.0 mm"),
        (3, 175, "-150.0", "ramp 100 × 600 × 40.0 mm"),
    ):
        place = 600 + 100j + ahead_mm * numpy.exp(1j * math.pi / 6)
        assert rows[f"A piece {number}"] == (f"{place.real:.0f}", f"{place.imag:.0f}", heading, text)
    # Heights count from the floor: each block of a pyramid is one step higher than the wider one around it.
    heights = [rows[f"C piece {number}"][3] for number in (1, 2, 3)]
    assert heights == [f"box {side} × {side} × {21.5 * level:.1f} mm" for level, side in enumerate((230, 150, 70), 1)]
    assert [rows[f"E piece {number}"][3] for number in (1, 2)] == ["box 60 × 300 × 20.0 mm", "box 60 × 200 × 30.0 mm"]


def test_a_tape_finds_the_edge_that_is_nearest_to_the_mark() -> None:
    rng = numpy.random.default_rng(1)
    for x_m, y_m, turned, length_m, width_m in rng.uniform([-2, -2, -4, 0.05, 0.05], [2, 2, 4, 0.6, 0.6], (50, 5)):
        piece = {**BOX, "x_m": x_m, "y_m": y_m, "heading_rad": turned, "length_m": length_m, "width_m": width_m}
        (thing,) = things_of([piece]).values()

        near, other = thing.near_edge_m([piece])

        # The corners by another way: complex numbers.
        z = (numpy.array([1, 1, -1, -1]) * length_m + 1j * numpy.array([1, -1, -1, 1]) * width_m) / 2
        z = z * numpy.exp(1j * turned) + complex(x_m, y_m)
        assert complex(*near) == pytest.approx(min(z, key=abs))
        assert min(abs(z - complex(*other))) == pytest.approx(0, abs=1e-9)
        assert abs(complex(*other) - complex(*near)) == pytest.approx(max(length_m, width_m))
        (row,) = (row for row in instructions(empty_scene([piece]), {"A": thing}) if row[0] == "A")
        _, edge, distances = (line.rpartition(": ")[2] for line in row[4].split("\n"))
        ends = [complex(*map(float, end.split(", "))) for end in edge.split(" to ")]
        assert [abs(end) for end in ends] == pytest.approx([float(far) for far in distances.split(" and ")], abs=1.3)


@pytest.mark.parametrize("middle", [0.5 + 0.2j, 0.1 - 0.05j, -0.02 + 0.19j])
def test_the_near_point_of_a_round_obstacle_is_the_nearest_of_its_edge(middle: complex) -> None:
    """The mark may lie inside the obstacle, as in a hole or on a hill."""
    piece = {"kind": "pothole", "x_m": middle.real, "y_m": middle.imag, "radius_m": 0.2, "depth_m": 0.02, "edge_m": 0.01}
    (thing,) = things_of([piece]).values()

    (near,) = thing.near_edge_m([piece])

    edge = middle + 0.2 * numpy.exp(1j * numpy.linspace(0, 2 * math.pi, 100_001))
    assert complex(*near) == pytest.approx(edge[abs(edge).argmin()], abs=1e-4)


def test_the_instructions_fit_into_80_columns(
    sampled: tuple[dict[str, Any], dict[str, Obstacle]], capsys: pytest.CaptureFixture[str]
) -> None:
    show_placement(*sampled)

    lines = capsys.readouterr().out.splitlines()

    assert max(map(len, lines)) <= 80
    # No place is broken, and no description becomes a column of single letters.
    assert [line.split()[:6] for line in lines if line.startswith("A piece 3")] == [
        ["A", "piece", "3", "752", "188", "-150.0"]
    ]
    assert next(line.strip() for line in lines if "from the mark:" in line) == "its ends from the mark: 355 and 618"
    text = " ".join(" ".join(lines[-2:]).split())
    assert text == "Heights count from the floor, also those of pieces that lie on or in other pieces."


def corners(piece: dict[str, Any]) -> numpy.ndarray:
    """The four corners of a block in the world, (4, 2) in m."""
    c, s = math.cos(piece["heading_rad"]), math.sin(piece["heading_rad"])
    half = numpy.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * [piece["length_m"] / 2, piece["width_m"] / 2]
    turned: numpy.ndarray = half @ [[c, s], [-s, c]] + [piece["x_m"], piece["y_m"]]
    return turned


def test_a_deviation_moves_a_ramp_rigidly(sampled: tuple[dict[str, Any], dict[str, Obstacle]]) -> None:
    scene, things = sampled
    name, by = parse_deviation("A 20 -10 15", [CAR, *things])

    moved = scene_as_placed(scene, things, {name: by})

    ramp = things["A"].pieces
    before = numpy.vstack([corners(scene["terrain"][k]) for k in ramp])
    after = numpy.vstack([corners(moved["terrain"][k]) for k in ramp])
    # One turn of 15 degrees around the ramp's middle and one shift explain all twelve corners, as complex numbers.
    middle = complex(0.6, 0.1)
    z = (before @ [1, 1j] - middle) * numpy.exp(1j * math.radians(15)) + middle + complex(0.020, -0.010)
    assert after @ [1, 1j] == pytest.approx(z, abs=1e-9)
    rest = [k for k in range(len(scene["terrain"])) if k not in ramp]
    assert [moved["terrain"][k] for k in rest] == [scene["terrain"][k] for k in rest]
    assert moved["start"] == scene["start"]


def things_of(terrain: list[dict[str, Any]]) -> dict[str, Obstacle]:
    """Each piece an object of its own."""
    return lettered(obstacles_of(terrain, [PlacedObject("Bump", 0.0, [k]) for k in range(len(terrain))]))


def test_what_stands_on_one_middle_is_one_obstacle() -> None:
    scene = empty_scene([*PYRAMID, HOLE], goal_x_m=1.3)
    things = things_of(scene["terrain"])

    assert [(letter, thing.pieces) for letter, thing in things.items()] == [("A", (0, 1)), ("B", (2,))]
    rows = {row[0]: row[1:] for row in instructions(scene, things)}
    assert rows["car"][:3] == ("0", "0", "0.0")
    assert rows["A"][:3] == ("450", "50", "5.7")
    assert rows["A"][3].startswith("Bump 200 × 300 mm of 2 pieces\n")
    assert rows["A piece 2"] == ("450", "50", "5.7", "box 100 × 100 × 20.0 mm")
    # A tape from the mark to the hole's middle passes its edge 100 mm before that.
    hole_text = "hole 20.0 mm deep, radius 100 mm\nnear edge: 800, -44\nfrom the mark: 801"
    assert rows["B"] == ("900", "-50", "0.0", hole_text)
    assert rows["goal"][0] == "1300"
