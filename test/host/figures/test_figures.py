"""Pictures of scenes and runs: they show the scene's ground, and files are complete."""

import math
from pathlib import Path
from typing import Any

import matplotlib
import numpy
import pytest

from foldcar.errors import FoldcarError
from foldcar.figures import run, scenes, style
from foldcar.figures.ground import Extent, HeightMap, height_map, height_scale, shaded
from foldcar.figures.profile import ACROSS, driven_line, strip_heights_m, travelled_m
from foldcar.figures.run import draw_run, poses_to_draw, segment_places
from foldcar.figures.scenes import draw_environment
from foldcar.figures.top_view import view_of
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import Heights, carsim_heights

FIRST_BYTES = {".png": b"\x89PNG\r\n\x1a\n", ".svg": b"<?xml", ".pdf": b"%PDF"}


def box(x_m: float, y_m: float, length_m: float, width_m: float, height_m: float, heading_rad: float = 0.0) -> Any:
    return {
        "kind": "box", "x_m": x_m, "y_m": y_m, "length_m": length_m, "width_m": width_m, "height_m": height_m,
        "heading_rad": heading_rad,
    }  # fmt: skip


def wheel(side: str, x_m: float) -> dict[str, Any]:
    return {"side": side, "segment": 0, "x_m": x_m, "radius_m": 0.06, "width_m": 0.012}


BODY = {
    "id": "w95",
    "segments": [{"x_m": 0.0, "length_m": 0.2, "width_m": 0.095, "height_m": 0.05, "center_z_m": 0.0}],
    "hinges": [],
    "track_m": 0.111,
    "wheels": [wheel(side, x_m) for x_m in (0.07, -0.07) for side in ("left", "right")],
}
SCENE = {
    "id": "1/0",
    "friction": 0.6,
    "terrain": [box(0.4, 0.05, 0.2, 0.2, 0.02), box(0.4, 0.05, 0.1, 0.1, 0.04)],
    "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
    "goal": {"kind": "line", "x_m": 1.0, "y_m": 0.0, "heading_rad": 0.3},
    "course": {"x_min_m": -0.5, "x_max_m": 2.0, "y_min_m": -1.0, "y_max_m": 1.0},
}
PATH = [[0.05 * i, 0.02 * i, 0.0, 0.06, 0.0, 0.0, 0.0] for i in range(52)]


@pytest.fixture(scope="module")
def heights(carsim_binary: Path) -> Heights:
    return carsim_heights(Carsim(carsim_binary))


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of few cells, which take less time."""
    for room, name in ((run, "CELLS"), (scenes, "FINE_CELLS")):
        monkeypatch.setattr(room, name, 60)


def circle_path(radius_m: float, points: int) -> list[list[float]]:
    """Once round to the left from the origin, starting along +x."""
    angles = numpy.linspace(0.0, 2 * math.pi, points)
    return [[a, radius_m * math.sin(a), radius_m * (1 - math.cos(a)), 0.06, a, 0.0, 0.0] for a in angles]


def test_the_way_is_driven_round_a_circle_and_backwards_and_goes_on_straight() -> None:
    assert travelled_m(circle_path(0.5, 721))[-1] == pytest.approx(math.pi, rel=1e-4)

    heading, x = 0.7, [0.0, 0.1, 0.2, 0.3, 0.25, 0.2]
    path = [[0.1 * i, s * math.cos(heading), s * math.sin(heading), 0.06, heading, 0, 0] for i, s in enumerate(x)]
    assert travelled_m(path) == pytest.approx(x)
    line = driven_line(path, margin_m=0.05)
    # Rolling back draws no new ground.
    assert (line.distance_m[0], line.distance_m[-1]) == pytest.approx((-0.05, 0.35))
    assert line.x_m == pytest.approx(line.distance_m * math.cos(heading))
    assert line.y_m == pytest.approx(line.distance_m * math.sin(heading))


def test_strip_heights_agree_with_points_tried_one_by_one(heights: Heights) -> None:
    generator = numpy.random.default_rng(4)
    terrain = [
        box(x, y + 0.3, *generator.uniform(0.05, 0.3, 2), height, generator.uniform(-3, 3))
        for x, y, height in generator.uniform([-0.4, -0.4, 0.01], [0.4, 0.4, 0.05], (25, 3))
    ]
    line = driven_line(circle_path(0.3, 200), margin_m=0.1, spacing_m=0.01)
    width, left = 0.03, 0.1
    strip = strip_heights_m(heights, {**SCENE, "terrain": terrain}, line, left, width)
    assert len(set(strip)) > 5
    for index, height in enumerate(strip):
        across = numpy.array([-math.sin(line.heading_rad[index]), math.cos(line.heading_rad[index])])
        seen = numpy.linspace(left - width / 2, left + width / 2, ACROSS)
        inner = [highest_box(terrain, line, index, offset * across, -1e-6) for offset in seen]
        outer = [highest_box(terrain, line, index, offset * across, 1e-6) for offset in seen]
        assert max(inner) <= height <= max(outer)


def highest_box(terrain: Any, line: Any, index: int, offset: Any, tolerance_m: float) -> float:
    """The height of the highest box at a point of a line, boxes being larger by a tolerance."""
    x, y = numpy.array([line.x_m[index], line.y_m[index]]) + offset
    result = 0.0
    for piece in terrain:
        cos, sin = math.cos(piece["heading_rad"]), math.sin(piece["heading_rad"])
        dx, dy = x - piece["x_m"], y - piece["y_m"]
        outside = max(abs(dx * cos + dy * sin) - piece["length_m"] / 2, abs(dy * cos - dx * sin) - piece["width_m"] / 2)
        result = max(result, piece["height_m"] if outside <= tolerance_m else 0.0)
    return result


def test_a_map_of_a_hill_is_its_formula_at_the_middles_of_cells(heights: Heights) -> None:
    hill = {"kind": "hill", "x_m": 0.5, "y_m": 0.2, "heading_rad": math.pi / 2}
    scene = {**SCENE, "terrain": [{**hill, "sd_along_m": 0.1, "sd_across_m": 0.2, "height_m": -0.03}]}
    block_map = height_map(heights, scene, Extent(0.0, 1.0, 0.0, 0.5), 20)
    assert block_map.z_m.shape == (10, 20)
    for row, column in ((4, 10), (0, 0), (9, 19)):
        x, y = 0.05 * (column + 0.5) - 0.5, 0.05 * (row + 0.5) - 0.2
        expected = -0.03 * math.exp(-((y / 0.1) ** 2 + (x / 0.2) ** 2) / 2)
        assert block_map.z_m[row, column] == pytest.approx(expected, abs=1e-9)


def test_level_ground_has_its_colour_and_slopes_towards_the_light_are_brighter() -> None:
    extent = Extent(0.0, 0.3, 0.0, 0.3)
    slope = numpy.linspace(0.0, 0.03, 30)[None, :].repeat(30, axis=0)
    maps = [HeightMap(extent, 0.01, z) for z in (numpy.zeros((30, 30)), slope, slope[:, ::-1], slope - 0.05)]
    scale = height_scale(maps)
    assert scale.get_clim() == pytest.approx((-50.0, 30.0))
    level, rises, falls, below = (shaded(height_map_, scale) for height_map_ in maps)
    assert level == pytest.approx(numpy.broadcast_to(scale.to_rgba(0.0)[:3], level.shape), abs=1e-6)
    assert (rises.mean(axis=2) > falls[:, ::-1].mean(axis=2)).all()
    assert (below[..., 2] > below[..., 0]).all()


def test_the_view_holds_start_goal_and_path_within_the_course() -> None:
    extent = view_of([SCENE], [[0.0, -0.4, 0.3, 0, 0, 0, 0]])
    assert extent == Extent(-0.5, pytest.approx(1.2), pytest.approx(0.05 - 0.1 * math.sqrt(2) - 0.2), pytest.approx(0.5))
    assert view_of([{**SCENE, "goal": None}]) == Extent(-0.5, 2.0, -1.0, 1.0)
    wide = {**SCENE, "terrain": [box(0.4, 0.0, 0.1, 50.0, 0.02)]}
    assert view_of([wide]) == Extent(pytest.approx(-0.2), pytest.approx(1.2), pytest.approx(-0.6), pytest.approx(0.6))


def test_poses_keep_their_distance_and_end_with_the_last() -> None:
    travelled = [0.01 * i for i in range(101)] + [1.0] * 50
    chosen = poses_to_draw(travelled, 0.3)
    assert chosen[0] == 0
    assert chosen[-1] == len(travelled) - 1
    gaps = numpy.diff([travelled[index] for index in chosen])
    assert gaps.min() >= 0.3 * 0.8
    assert poses_to_draw([0.0], 0.3) == [0]


def test_runs_are_drawn_in_every_format_the_same_each_time(tmp_path: Path, heights: Heights) -> None:
    for suffix, start in FIRST_BYTES.items():
        files = [tmp_path / f"{name}{suffix}" for name in ("one", "two")]
        for file in files:
            draw_run(BODY, SCENE, {"outcome": "off_course", "elapsed_time_s": 2.55}, PATH, heights, file)
        first, second = (file.read_bytes() for file in files)
        assert first.startswith(start) and first == second
    assert b"off course after 2.55 s, car w95, scene 1/0" in (tmp_path / "one.svg").read_bytes()


def test_a_run_without_a_path_or_with_another_suffix_is_refused(tmp_path: Path, heights: Heights) -> None:
    result = {"outcome": "passed", "elapsed_time_s": 2.55}
    with pytest.raises(FoldcarError, match="no path to draw"):
        draw_run(BODY, SCENE, result, [], heights, tmp_path / "a.png")
    with pytest.raises(FoldcarError, match=r"a.gif: a picture's name ends in one of .png, .svg, .pdf"):
        draw_run(BODY, SCENE, result, PATH, heights, tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []


def test_up_to_nine_scenes_are_drawn(tmp_path: Path, heights: Heights) -> None:
    disc = {**SCENE, "goal": {"kind": "disc", "x_m": 1.0, "y_m": 0.0, "radius_m": 0.05}, "terrain": []}
    file = tmp_path / "scenes.svg"
    patches = [{**every_kind()[-1], "friction": 0.2 + 0.01 * k} for k in range(11)]
    scenes = [{**(disc if k == 1 else SCENE), "terrain": [patches[k]], "id": f"7/{k}"} for k in range(11)]
    draw_environment(scenes, file, heights, "eleven")
    text = file.read_text()
    assert [f"scene 7/{k}" in text for k in range(11)] == [True] * 9 + [False] * 2


def every_kind() -> list[dict[str, Any]]:
    size = {"length_m": 0.2, "width_m": 0.3, "height_m": 0.02, "heading_rad": 0.2}
    hill = {"sd_along_m": 0.05, "sd_across_m": 0.08, "height_m": 0.03, "heading_rad": 0.4}
    rough = {"length_m": 0.3, "width_m": 0.3, "height_sd_m": 0.003, "correlation_m": 0.03, "seed": 3}
    shapes = [
        *({"kind": kind, **size} for kind in ("box", "ramp", "half_round")),
        {"kind": "hill", **hill},
        {"kind": "pothole", "radius_m": 0.1, "depth_m": 0.02, "edge_m": 0.03},
        {"kind": "rough", "heading_rad": 0.3, **rough},
        {"kind": "patch", "heading_rad": 0.3, "length_m": 0.3, "width_m": 0.3, "friction": 0.25},
    ]
    return [{"x_m": 0.3 * i, "y_m": 0.1, **shape} for i, shape in enumerate(shapes)]


def test_an_environment_shows_every_kind_of_terrain_and_equal_scenes_once(tmp_path: Path, heights: Heights) -> None:
    scene = {**SCENE, "terrain": every_kind()}
    drawn = [scene, {**scene, "goal": None, "id": "1/1"}, {**scene, "id": "1/2"}]
    draw_environment(drawn, tmp_path / "environment.svg", heights, "every kind")
    text = (tmp_path / "environment.svg").read_text()
    assert text.count("friction 0.25") == 2
    assert [f"scene 1/{k}" in text for k in range(3)] == [True, True, False]
    stuck = {"outcome": "stuck", "elapsed_time_s": 2.5}
    draw_run(BODY, {**scene, "goal": None}, stuck, PATH, heights, tmp_path / "r.png")
    assert (tmp_path / "r.png").read_bytes().startswith(FIRST_BYTES[".png"])


def test_segments_hang_together_in_their_hinges_and_fold_as_the_path_says() -> None:
    segments = [{"x_m": x, "length_m": 0.09} for x in (0.1, 0.0, -0.1)]
    hinges = [{"x_m": 0.05, "z_m": 0.01}, {"x_m": -0.05, "z_m": -0.02}]
    folds = (-0.3, 0.2)
    row = [1.0, 0.5, 0.0, 0.06, 0.0, 0.1, 0.0, *folds]

    places = segment_places({"segments": segments, "hinges": hinges}, row)

    # The main segment is the middle one: its pose is that of the path.
    assert places[1][1] == pytest.approx([0.0, 0.0])
    forwards = [numpy.array([1.0, 0.0]) @ turn for turn, _ in places]
    pitches = [math.atan2(z, x) for x, z in forwards]
    assert pitches[1] == pytest.approx(0.1)
    assert [pitches[0] - pitches[1], pitches[1] - pitches[2]] == pytest.approx(folds)
    for index, hinge in enumerate(hinges):
        joint = numpy.array([hinge["x_m"], hinge["z_m"]])
        (a, at_a), (b, at_b) = places[index : index + 2]
        assert joint @ a + at_a == pytest.approx(joint @ b + at_b)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["$a_^$", r"\$\frac$", "庭院 정원 $x$", "_a\n$b"])
def test_names_are_drawn_as_they_are(tmp_path: Path, heights: Heights, name: str) -> None:
    scene, passed = {**SCENE, "id": name}, {"outcome": "passed", "elapsed_time_s": 1.0}
    for suffix in FIRST_BYTES:
        draw_environment([scene], tmp_path / f"e{suffix}", heights, title=name)
        draw_run({**BODY, "id": name}, scene, passed, PATH, heights, tmp_path / f"r{suffix}")
    assert name.split("\n")[0] in (tmp_path / "e.svg").read_text(encoding="utf-8")


def test_installed_fonts_supply_what_the_styles_font_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(style, "CJK_FONTS", ("No Such Font", "DejaVu Serif"))
    style._cjk_fonts.cache_clear()
    try:
        with style.drawing_style():
            assert matplotlib.rcParams["font.family"] == ["sans-serif", "DejaVu Serif"]
    finally:
        style._cjk_fonts.cache_clear()
