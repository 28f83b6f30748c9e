"""Errors of environments are one line that names the file and, where known, the line number."""

from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes import program as scenic_program
from foldcar.scenes import source
from foldcar.scenes.source import open_environment

EGO = "ego = new Robot at (0, 0), facing -90 deg\n"
GOAL = "goal = new Goal at (1, 0), facing -90 deg\n"
PIECES = "class Own(Terrain):\n    def pieces(self):\n"


def message(folder: Path, text: str, params: dict[str, Any] | None = None) -> str:
    """The message that the program ``text`` is refused with when it is opened and sampled once."""
    program = folder / "bad.scenic"
    program.write_text(text)
    with pytest.raises(FoldcarError) as caught:
        open_environment(program, params or {}, 1).sample(0)
    line = str(caught.value)
    assert line.startswith(f"{program}: ")
    assert "\n" not in line
    return line


def accepted(folder: Path, text: str) -> dict[str, Any]:
    """Sample 0 of the program ``text``, with the goal 1 m ahead of the car."""
    program = folder / "good.scenic"
    program.write_text(text)
    scene = open_environment(program, {}, 1).sample(0)
    assert scene["goal"]["x_m"] == 1
    return scene


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("model model\nego = = 3\n", "line 2: invalid syntax"),
        (f"model model\n{EGO}new Bump at (unknown, 0)\n", "line 3: NameError: name 'unknown' is not defined"),
        (f"{EGO}{GOAL}", "line 1: NameError: name 'Robot' is not defined"),
        ("model model\nparam a = 1\nx = globalParameters.b\n", "line 3: KeyError: 'b'"),
        (f"model model\n{EGO}goal = new Goal at 1.2\n", 'specifier "at X" with X not a vector'),
        ("model nowhere\n", "could not import world model nowhere"),
        ("model model\nimport sys\nsys.exit(3)\n", "line 3: SystemExit: 3"),
        (f"model model\n{EGO}{GOAL}require 1 / ego.position.x > 0\n", "line 4: ZeroDivisionError"),
        (f"model model\n{EGO}{GOAL}import sys\nrequire sys.exit(0)\n", "sample 0: line 5: SystemExit: 0"),
        (f"model model\n{EGO}{GOAL}assert 1 > 2\n", "line 4: AssertionError"),
        (f"model model\n{EGO}{GOAL}require ego.position.x > 3\n", "requirement on line 4; relax the program"),
    ],
)
def test_programs_that_fail(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "hint", "excerpt"),
    [
        (f"{EGO}{GOAL}", "the line `model model` at the top of the program", [f"  {EGO.rstrip()}", "            ^"]),
        ("model modle\n", "could not import world model modle; foldcar's is `model model`", ["  model modle", "  ^"]),
        ("model model\nif 1:\n\tnew Kerbs at 1\n", 'did you mean "Kerb"?', ["  \tnew Kerbs at 1", "  \t    ^"]),
        ("model model\nk = new Curb at (1, 0)\n", "Bump, Flat, Fric", ["  k = new Curb at (1, 0)", "          ^"]),
        ("model model\nfar = 1\nx = 2 * farr\n", 'did you mean "far"?', ["  x = 2 * farr", "          ^"]),
        ("model model\nego = = 3\n", "line 2: invalid syntax", ["  ego = = 3", "        ^"]),
    ],
)
def test_mistakes_of_programs_show_the_line_and_what_was_meant(
    tmp_path: Path, text: str, hint: str, excerpt: list[str]
) -> None:
    program = tmp_path / "bad.scenic"
    program.write_text(text)
    with pytest.raises(FoldcarError) as caught:
        open_environment(program, {}, 1)
    first, *shown = caught.value.lines()
    assert hint in first
    assert shown == excerpt


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("ego = new Robot at (0, 0), at (1, 0)\n", "line 3: Cannot use At"),
        ("if True:\n    x = 1\n    ego = new Robot at (7, 0)\n" + GOAL, "line 5: Robot at (7, 0): x: 7.0 m is outside"),
        ("ego = new Robot at (0, 0), with heigth 3\n", "line 3: Robot has no property heigth; did you mean height?"),
    ],
)
def test_errors_about_the_ego_name_its_line(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, f"model model\n\n{text}")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("new Bump at (0.5, 0), with heigth 0.1\n", "line 4: Bump has no property heigth; did you mean height?"),
        (
            "class Own(Bump):\n    rise: 0.01\nnew Own at (0.5, 0), with rize 0.1\n",
            "Own has no property rize; did you",
        ),
        ("\nparam frictoin = 0.1\n", "line 5: nothing reads param frictoin; did you mean friction?"),
    ],
)
def test_misspelt_properties(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, f"model model\n{EGO}{GOAL}{text}")


@pytest.mark.parametrize(
    "text",
    [
        "post = new Marker at (0.5, 0), with visits 0\nrecord post.visits as visits\n",
        "new Bump at (0.5, 0), facing -90 deg, with mutator None, with name 'x', with color (1, 0, 0)\n",
        "class Own(Kerb):\n    faces: 3\n    def pieces(self):\n        return [block(0.1, 0.1, 0.01)] * self.faces\n"
        "new Own at (0.5, 0), facing -90 deg, with faces 2\n",
        "param friction_sd = 0.1\nnew FrictionPatch at (0.5, 0), with friction globalParameters.friction_sd\n",
        "new Pothole at (0.5, 0), facing Range(-180, 180) deg\n",
        "new Pothole at (0.5, 0), facing 6\n",
    ],
)
def test_properties_that_the_program_or_scenic_uses(tmp_path: Path, text: str) -> None:
    accepted(tmp_path, f"model model\n{EGO}{GOAL}{text}")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("terminate when distance from ego to target <= 0.05\n", 4),
        ("def far():\n    return [distance to target\n        for _ in range(3)]\nrecord far() as far\n", 5),
        ("scenario Main():\n    compose:\n        while target:\n            wait\n", 6),
    ],
)
def test_names_that_only_a_run_would_evaluate(tmp_path: Path, text: str, line: int) -> None:
    assert f"line {line}: NameError: name 'target' is not defined" in message(tmp_path, f"model model\n{EGO}{GOAL}{text}")


def test_names_that_the_program_defines_somewhere(tmp_path: Path) -> None:
    text = (
        f"model model\n{EGO}{GOAL}if 1 > 2:\n    target = goal\n"
        "monitor Near():\n    global seen\n    seen = 0\n    local = seen\n    while local + seen < 3:\n        wait\n"
        "require monitor Near()\nrecord (lambda near: min(near, 3))(2) as three\ndef never():\n    return target\n"
    )
    accepted(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("terminate when ego.position.x > 1\n", "line 3: `terminate when`: Scenic drops such statements"),
        ("terminate after 5 seconds\n", "`terminate after`: "),
        ("monitor M():\n    wait\nrequire monitor M()\n", "line 5: `require monitor`: "),
    ],
)
def test_statements_that_an_import_would_lose(tmp_path: Path, text: str, part: str) -> None:
    (tmp_path / "other.scenic").write_text(f"model model\n{EGO}{text}")
    line = message(tmp_path, f"model model\nfrom other import ego\n{GOAL}")
    assert f"other.scenic: {part}" in line or ("line 0" in line and part in line)
    assert line.endswith("move them to the program, or into the scenario, that is run")


def test_what_an_import_takes_over_is_accepted(tmp_path: Path) -> None:
    (tmp_path / "other.scenic").write_text(f"model model\n{EGO}{GOAL}require always ego.position.x < 3\n")
    program = tmp_path / "good.scenic"
    program.write_text("from other import ego, goal\nterminate when ego.position.x > 1\n")
    assert open_environment(program, {}, 1).dynamic


def test_statements_beside_a_scenario_that_scenic_would_drop(tmp_path: Path) -> None:
    scenario = "scenario Main():\n    setup:\n        ego = new Robot at (0, 0)\n"
    text = message(tmp_path, f"model model\nterminate when 1 > 2\n{scenario}")
    assert "bad.scenic: line 2: `terminate when`: Scenic drops" in text


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("new Bump at (0.5, 0),\n    facing -90\n", "line 5: `facing`: -90 is"),
        ("new Bump at (0.5, 0),\n    with yaw Range(0, 180)\n", "line 5: `with yaw`: 180 is"),
        ("param timestep = 0\n", "param timestep: 0 is not within 0.004167 to 60 s"),
        ("param outer_step_s = 0\n", "param outer_step_s: 0 is not within 0.004167 to 60 s"),
        ("param friction = 0.5, outer_step_s = 'soon'\n", "param outer_step_s: soon is not a number"),
        (
            "record ego.position.x as a\nrecord final ego.position.y as a\n",
            "line 5: `record final … as a`: line 4 records under this name already",
        ),
        (
            "record initial ego.position.x < 1 as passed\n",
            "line 4: `record initial … as passed` says nothing about the end of a run: write `record final`",
        ),
    ],
)
def test_statements_that_can_only_fail_in_a_run(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, f"model model\n{EGO}{GOAL}{text}")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (GOAL, "no ego"),
        (EGO, "no Goal: the program must place one"),
        (EGO + GOAL + GOAL, "line 4: Goal at (1, 0): is a second Goal"),
        (EGO + GOAL + "new Robot at (0, 0.5)\n", "line 4: Robot at (0, 0.5): is a second Robot"),
        (
            EGO + GOAL + "new Bump at (0.5, 0), with height -0.1\n",
            "line 4: Bump at (0.5, 0): box: height_m: -0.1 is not within 0.0001 to 1",
        ),
        (EGO + GOAL + 'new Bump at (0.5, 0), with length float("nan")\n', "length_m: nan is not finite"),
        (EGO + GOAL + "new Bump at (0.5, 0, 1)\n", "z: 1.0 m: everything stands on the ground"),
        (EGO + GOAL + "new Bump at (0.5, 0), with pitch 0.3\n", "pitch: 0.3 rad: everything stands upright"),
        (EGO + GOAL + "param friction = 0\n", "param friction: 0.0 is not above 0 and at most 5"),
        (
            EGO + GOAL + "param course_x_max = 0.5\n",
            "line 3: Goal at (1, 0): x: 1.0 m is outside the course, -0.5 to 0.5",
        ),
        (EGO + "new Goal at (1, 0)\n", "the start is not before the goal line"),
        (EGO + "new Goal at (1, 0), with reach 2\n", "the start is within the goal's reach of 2.0 m"),
        (EGO + GOAL + "new Ramp at (0.15, 0), facing -90 deg\n", "across the edge of a ramp at (0.15, 0)"),
        (EGO + GOAL + "new Bump at (0.5, 0)\nnew Bump at (0.51, 0)\n", "`with allowCollisions True` permits it"),
        (EGO + GOAL + "new Bump at (0.5, 0), with height 20\n", "height_m: 20 is not within 0.0001 to 1; lengths are in"),
        (EGO + GOAL + "new Pothole at (0.5, 0), with edge 0.1\n", "edge_m: 0.1 is above the radius, 0.08"),
        (
            EGO + GOAL + "new RoughGround at (0.5, 0), with correlation 0.0015\n",
            "rough: correlation_m: makes 1.71e+07 heights, the limit is 4e+06",
        ),
        (EGO + GOAL + "new RoughGround at (0.5, 0), with seed 1.5\n", "rough: seed: 1.5 is not an integer"),
        (
            EGO + GOAL + f"{PIECES}        return [{{'kind': 'box', 'length_m': 1}}]\nnew Own at (0.5, 0)\n",
            "line 7: Own at (0.5, 0): box: width_m is missing",
        ),
        (
            f"{EGO}{GOAL}for _ in range(101):\n    new StepPyramid at (0.5, 0), with steps 100, with step_height 0.001\n",
            "the terrain has more than 10000 pieces",
        ),
    ],
)
def test_what_the_simulator_cannot_represent(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, f"model model\n{text}")


def test_mistakes_in_an_imported_program_name_that_file(tmp_path: Path) -> None:
    for place, part in (("(unknown, 0)", "NameError"), ("(30, 0)", "Bump at (30, 0): x: 30.0 m is outside")):
        (tmp_path / "other.scenic").write_text(f"model model\n\nnew Bump at {place}\n")
        assert f"other.scenic: line 3: {part}" in message(tmp_path, f"model model\nimport other\n{EGO}{GOAL}")


@pytest.mark.parametrize("obstacle", ["Bump at (0.14, 0)", "Step at (0, 0)", "GaussianHill at (0.05, 0)"])
def test_starts_beside_a_block_wholly_on_one_or_on_a_hill_are_fine(tmp_path: Path, obstacle: str) -> None:
    assert len(accepted(tmp_path, f"model model\n{EGO}{GOAL}new {obstacle}, facing -90 deg\n")["terrain"]) == 1


def test_too_many_objects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenic_program, "MAX_OBJECTS", 20)
    text = f"model model\n{EGO}{GOAL}for _ in range(19):\n    new Marker at (0, 0)\n"
    assert "21 objects are above the limit 20 of a scene" in message(tmp_path, text)


@pytest.mark.parametrize(
    ("loop", "what"),
    [
        ("while True:\n    pass\n", "compiling"),
        ("def never(x):\n    while True:\n        x += 1\nrequire never(ego.position.x)\n", "sample 0"),
        (f"{PIECES}        while True:\n            pass\nnew Own at (0.5, 0)\n", "sample 0"),
    ],
)
def test_a_program_that_loops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, loop: str, what: str) -> None:
    limit = (scenic_program, "COMPILE_LIMIT_S") if what == "compiling" else (source, "SAMPLE_LIMIT_S")
    monkeypatch.setattr(*limit, 0.5)
    text = message(tmp_path, f"model model\n{EGO}{GOAL}{loop}")
    assert f"{what} takes longer than the limit of 0.5 s" in text


def test_parameters_are_checked(tmp_path: Path) -> None:
    text = f"model model\nparam far = 3, label = 'a'\n{EGO}{GOAL}"
    assert "param near: unknown; the program's parameters are: course_x_max" in message(tmp_path, text, {"near": 1})
    assert message(tmp_path, text, {"labl": 1}).endswith('outer_step_s; did you mean "label"?')
    assert "param far: 'x' is not a number" in message(tmp_path, text, {"far": "x"})
    assert "param far: nan is not finite" in message(tmp_path, text, {"far": float("nan")})


def test_missing_files(tmp_path: Path) -> None:
    with pytest.raises(FoldcarError, match=r"none\.scenic: no such Scenic program"):
        open_environment(tmp_path / "none.scenic", {}, 1)
    (tmp_path / "bumps.scenic").touch()
    with pytest.raises(FoldcarError, match=r'bump\.scenic: no such Scenic program; did you mean "bumps\.scenic"\?'):
        open_environment(tmp_path / "bump.scenic", {}, 1)
    other = tmp_path / "other.py"
    other.write_text("")
    with pytest.raises(FoldcarError, match=r"name ends in \.scenic"):
        open_environment(other, {}, 1)
    latin = tmp_path / "latin.scenic"
    latin.write_bytes(b"model model\n# \xe4\n")
    with pytest.raises(FoldcarError, match=r"latin\.scenic: is not UTF-8 text \(byte 14\)"):
        open_environment(latin, {}, 1)
