"""Samples do not depend on Python's hash seed, by which it orders sets of strings."""

import json
import os
import random
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.commands.options import check_scheduler_option
from foldcar.scenes import fixed_hash
from foldcar.scenes.fixed_hash import open_fixed_environment
from foldcar.scenes.source import open_environment

PROGRAM = """
model model
names = {"alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta"}
width = float(open(localPath("width.txt")).read())
ego = new Robot at (0, 0), facing -90 deg
for k, name in enumerate(names):
    new Bump at (0.3 + 0.2 * k, 0.05 * len(name)), facing -90 deg, with width width
goal = new Goal at (1.9, 0), facing -90 deg
"""
RANDOM = """
model model
ego = new Robot at (0, 0), facing -90 deg
for k in range(20):
    new Bump at (0.3 + 0.07 * k, Range(-0.2, 0.2)), facing -90 deg, with length 0.03
goal = new Goal at (1.9, 0), facing -90 deg
"""
# Both order the names of the program differently, and neither as the seed 0 does.
SEEDS = ("1", "2")
SESSION = """
import json, sys, foldcar
environment = foldcar.environment(sys.argv[1], seed=3)
print(json.dumps([json.loads(environment.scene(k).json) for k in range(2)]))
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    (tmp_path / "width.txt").write_text("0.4")
    file = tmp_path / "names.scenic"
    file.write_text(PROGRAM)
    return file


def scenes_by(run: Callable[[dict[str, str]], str]) -> list[Any]:
    """The scenes that a process prints under each hash seed."""
    return [json.loads(run({**os.environ, "PYTHONHASHSEED": seed})) for seed in SEEDS]


def test_the_command_draws_the_same_scenes_in_each_process(program: Path, new_foldcar: Any) -> None:
    def sampled(environment: dict[str, str]) -> str:
        answer = new_foldcar("sample", program, "-n", "2", "--seed", "3", "--json", env=environment)
        assert answer.returncode == 0, answer.stderr
        return str(answer.stdout)

    first, *others = scenes_by(sampled)

    assert len(first["scenes"]) == 2 and others == [first]


def test_a_python_session_draws_the_scenes_of_the_command(program: Path, foldcar: Any) -> None:
    def sampled(environment: dict[str, str]) -> str:
        words = [sys.executable, "-c", SESSION, str(program)]
        return subprocess.run(words, capture_output=True, text=True, check=True, env=environment).stdout

    sessions = scenes_by(sampled)
    command = json.loads(foldcar("sample", program, "-n", "2", "--seed", "3", "--json").stdout)["scenes"]

    assert sessions == [[{key: value for key, value in scene.items() if key != "id"} for scene in command]] * 2


def test_a_session_knows_the_files_and_the_errors_of_its_samples(program: Path) -> None:
    script = """
import sys
from pathlib import Path
from foldcar.errors import FoldcarError
from foldcar.commands.options import check_scheduler_option
from foldcar.scenes import fixed_hash
from foldcar.scenes.fixed_hash import open_fixed_environment
program = Path(sys.argv[1])
source = open_fixed_environment(program, {}, 3)
print(sorted(source.fixed_files()))
program.with_name("width.txt").write_text("0.5")
print(source.files.unchanged())
program.write_text("model model\\nego = new Robot at (0, 0)\\nparam friction = Range(-2, -1)\\n")
try:
    open_fixed_environment(program, {}, 3).sample(0)
except FoldcarError as error:
    print(error)
"""
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    words = [sys.executable, "-c", script, str(program)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True, env=environment).stdout.splitlines()

    assert printed[:2] == ["['names.scenic', 'width.txt']", "False"]
    with pytest.raises(Exception, match="friction") as local:
        open_environment(program, {}, 3).sample(0)
    assert printed[2] == str(local.value)


@pytest.mark.parametrize("option", ["-E", "-R"])
def test_python_that_ignores_the_hash_seed_is_refused(option: str, program: Path) -> None:
    words = [sys.executable, option, "-c", "from foldcar.__main__ import main; main()", "sample", str(program)]
    answer = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)

    assert (answer.returncode, answer.stdout, answer.stderr.count("\n")) == (2, "", 1)
    assert answer.stderr.startswith("foldcar: error: python -E, -I and -R ignore PYTHONHASHSEED")


def test_another_process_gives_the_parameters_of_objects_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "stair.scenic"
    lines = ["stair = new StepPyramid at (0.8, 0), with steps 2, with step_height Range(0.01, 0.02)"]
    ends = ["ego = new Robot at (0, 0), facing -90 deg", "goal = new Goal at (1.9, 0), facing -90 deg"]
    file.write_text("\n".join(["model model", *lines, *ends]))
    monkeypatch.setattr("foldcar.scenes.fixed_hash.draws_here", False)

    scene, objects = open_fixed_environment(file, {}, 3).sample_with_parameters(1)

    assert (scene, objects) == open_environment(file, {}, 3).sample_with_parameters(1)
    ((name, parameters),) = objects
    assert (name, parameters["steps"]) == ("stair", 2)
    assert parameters["step_height_m"] == pytest.approx(min(piece["height_m"] for piece in scene["terrain"]))


@pytest.mark.parametrize(
    "written", ["{Bump, Kerb, Step}", "{Bump, None}", "{ego, goal}", "{kind for kind in (1, 2)} | {Kerb}"]
)
def test_a_set_of_what_has_no_lasting_order_is_refused(written: str, tmp_path: Path, foldcar: Any) -> None:
    head, goal = (
        "model model\nego = new Robot at (0, 0), facing -90 deg\n",
        "goal = new Goal at (1.9, 0), facing -90 deg\n",
    )
    (tmp_path / "kinds.scenic").write_text(f"{head}{goal}for kind in {written}:\n    pass\n")
    (tmp_path / "asks.scenic").write_text(
        f'{head}{goal}kind = Bump if 1 in {{1, 2}} and Bump in {{Bump, Kerb}} else "x"\n'
    )

    done = foldcar("sample", "kinds.scenic", "-n", "1")

    reason = "line 4: a set of names has another order in each process, and so would the scenes: write a list, [...]"
    assert done.returncode == 2 and done.stderr.startswith(f"foldcar: error: kinds.scenic: {reason}\n"), done.stderr
    open_environment(tmp_path / "asks.scenic", {}, 0).sample(0)


def test_threads_that_draw_random_numbers_do_not_change_the_samples_beside_a_scheduler(
    program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scheduler's threads use Python's global random generators, with which samples are drawn."""
    monkeypatch.setattr(fixed_hash, "draws_here", True)
    (program.parent / "random.scenic").write_text(RANDOM)
    quiet = open_environment(program.parent / "random.scenic", {}, 3)
    expected = [quiet.sample(k) for k in range(4)]
    ended = threading.Event()

    def draw() -> None:
        while not ended.is_set():
            random.random()

    check_scheduler_option("local:1", None)
    thread, interval_s = threading.Thread(target=draw), sys.getswitchinterval()
    thread.start()
    # Threads take turns so often that the other one draws between any two numbers of a sample.
    sys.setswitchinterval(1e-6)
    try:
        source = open_fixed_environment(program.parent / "random.scenic", {}, 3)
        assert [source.sample(k) for k in range(4)] == expected
    finally:
        sys.setswitchinterval(interval_s)
        ended.set()
        thread.join()
