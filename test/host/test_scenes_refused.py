"""What is wrong with an environment is said in one line that names the file and, if it can, the line."""

from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes import open_environment

EGO = "ego = new Robot at (0, 0), facing -90 deg\n"
GOAL = "goal = new Goal at (1, 0), facing -90 deg\n"


def message(folder: Path, text: str, params: dict[str, Any] | None = None) -> str:
    """The message that the program ``text`` is refused with when it is opened and sampled once."""
    program = folder / "bad.scenic"
    program.write_text(text)
    with pytest.raises(FoldcarError) as caught:
        open_environment(program, params or {}, 1).sample(0)
    said = str(caught.value)
    assert said.startswith(f"{program}: ")
    assert "\n" not in said
    return said


@pytest.mark.parametrize(
    ("statement", "part"),
    [
        ("terminate when ego.position.x > 1", "terminate when: "),
        ("terminate simulation when ego.position.x > 1", "terminate simulation when: "),
        ("terminate after 10 seconds", "`timeout` in the listing"),
        ("record ego.position.x as x", "record: "),
        ("record initial ego.position.x as x", "record: "),
        ("record final ego.position.x as x", "record: "),
        ("require always ego.position.x < 3", "require always"),
        ("require eventually ego.position.x > 3", "require always/eventually"),
        ("monitor M():\n    wait\nrequire monitor M()", "require monitor: "),
        ("behavior B():\n    wait\nnew Marker at (0, 1), with behavior B", "a behavior: "),
    ],
)
def test_what_needs_a_running_simulation(tmp_path: Path, statement: str, part: str) -> None:
    said = message(tmp_path, f"model model\n{EGO}{GOAL}{statement}\n")
    assert part in said
    assert "cannot honour it" in said


def test_a_compose_block(tmp_path: Path) -> None:
    setup = f"    setup:\n        {EGO}        {GOAL}"
    text = f"model model\nscenario Main():\n{setup}    compose:\n        wait\n"
    assert "compose: " in message(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("model model\nego = = 3\n", "line 2: invalid syntax"),
        (f"model model\n{EGO}new Bump at (unknown, 0)\n", "line 3: NameError: name 'unknown' is not defined"),
        ("model nowhere\n", "could not import world model nowhere"),
        ("model model\nimport sys\nsys.exit(3)\n", "line 3: SystemExit: 3"),
        (f"model model\n{EGO}{GOAL}require 1 / ego.position.x > 0\n", "line 4: ZeroDivisionError"),
    ],
)
def test_programs_that_fail(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, text)


def test_an_error_in_an_imported_program_names_that_file(tmp_path: Path) -> None:
    (tmp_path / "other.scenic").write_text("model model\n\nnew Bump at (unknown, 0)\n")
    assert "other.scenic: line 3: NameError" in message(tmp_path, f"model model\nimport other\n{EGO}{GOAL}")


def test_requirements_that_never_hold(tmp_path: Path) -> None:
    said = message(tmp_path, f"model model\n{EGO}{GOAL}require ego.position.x > 3\n")
    assert "rejected all 2000 tries" in said
    assert "requirement on line 4" in said


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (GOAL, "no ego"),
        (EGO, "0 Goals"),
        (EGO + GOAL + GOAL, "2 Goals"),
        (GOAL + "ego = new Marker at (0, 0)\n", "the ego is a Marker, not a Robot"),
        (EGO + GOAL + "new Robot at (0, 0.5)\n", "Robot at (0, 0.5) is a second Robot"),
        (EGO + GOAL + "new Object at (0.5, 0), with allowCollisions True\n", "Object at (0.5, 0) is none of"),
        (
            EGO + GOAL + "new Bump at (0.5, 0), with height -0.1\n",
            "Bump at (0.5, 0): height: -0.1 is not above 0",
        ),
        (EGO + GOAL + "new Bump at (nowhere, 0)\n", "x: <EmptyRegion nowhere"),
        (EGO + GOAL + 'new Bump at (0.5, 0), with length float("nan")\n', "length: nan is not finite"),
        (EGO + GOAL + "new StepPyramid at (0.5, 0), with steps 2.5\n", "StepPyramid at (0.5, 0): TypeError"),
        (EGO + GOAL + "new StepPyramid at (0.5, 0), with steps 0\n", "is made of no boxes"),
        (EGO + GOAL + "new Bump at (0.5, 0, 1)\n", "z: 1.0 m: everything stands on the ground"),
        (EGO + GOAL + "new Bump at (0.5, 0), with pitch 0.3\n", "pitch: 0.3 rad: everything stands upright"),
        (EGO + GOAL + "param friction = 0\n", "param friction: 0.0 is not above 0"),
        (EGO + GOAL + "param course_x_max = -1\n", "course_x_min: -0.5 is not below course_x_max -1.0"),
        (EGO + GOAL + "param course_x_max = 0.5\n", "the goal: x: 1.0 m is outside the course, -0.5 to 0.5"),
        (EGO + "new Goal at (1, 0)\n", "the start is not before the goal line"),
        (EGO + "new Goal at (1, 0), with reach 2\n", "the start is within the goal's reach of 2.0 m"),
        (EGO + "new Goal at (1, 0), with reach 0\n", "reach: 0 is not above 0"),
    ],
)
def test_what_the_simulator_cannot_represent(tmp_path: Path, text: str, part: str) -> None:
    assert part in message(tmp_path, f"model model\n{text}")


def test_parameters_are_checked(tmp_path: Path) -> None:
    text = f"model model\nparam far = 3, label = 'a'\n{EGO}{GOAL}"
    assert "param near: unknown; the program's parameters are: course_x_max" in message(
        tmp_path, text, {"near": 1}
    )
    assert "param far: 'x' is no number" in message(tmp_path, text, {"far": "x"})
    assert "param far: nan is not finite" in message(tmp_path, text, {"far": float("nan")})


def test_missing_files(tmp_path: Path) -> None:
    with pytest.raises(FoldcarError, match=r"none\.scenic: no such Scenic program"):
        open_environment(tmp_path / "none.scenic", {}, 1)
    other = tmp_path / "other.py"
    other.write_text("")
    with pytest.raises(FoldcarError, match=r"name ends in \.scenic"):
        open_environment(other, {}, 1)


def test_a_copy_of_the_model_beside_the_program_is_used(tmp_path: Path) -> None:
    model = Path(__file__).resolve().parents[2] / "scenarios" / "model.scenic"
    (tmp_path / "model.scenic").write_text(model.read_text().replace("friction = 0.6", "friction = 0.3"))
    program = tmp_path / "own.scenic"
    program.write_text(f"model model\n{EGO}{GOAL}")
    assert open_environment(program, {}, 1).sample(0)["friction"] == 0.3
