"""Remarks on scenes that their authors probably did not mean."""

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import PROJECT
from foldcar.scenes.scene_notes import scene_notes

FACING = "ego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (1.5, 0), facing -90 deg\n"
RAMP = "new Ramp at (0.5, 0), facing -90 deg, with run_up 0.3, with plateau 0.5\n"


def notes(foldcar: Any, folder: Path, program: str) -> list[str]:
    (folder / "p.scenic").write_text(f"model model\n{program}")
    done = foldcar("sample", "p.scenic", "-n", "3")
    assert done.returncode == 0, done.stderr
    return [line.removeprefix("note: 3 samples (first 0): ") for line in done.stderr.splitlines()]


def test_gravel_under_a_ramp_is_remarked_on(foldcar: Any, tmp_path: Path) -> None:
    gravel = "new RoughGround at (0.65, 0), with length 0.3, with width 0.3, with amplitude 0.003\n"

    hidden = notes(foldcar, tmp_path, RAMP + gravel + FACING)
    beside = notes(foldcar, tmp_path, RAMP + gravel.replace("(0.65, 0)", "(0.65, 0.5)") + FACING)

    why = "where both are, only the higher one counts"
    assert hidden == [f"the rough ground at (0.65, 0) lies under the block at (0.65, 0): {why}"]
    assert beside == []


def test_a_course_with_many_stones_on_gravel_gets_one_remark(foldcar: Any, tmp_path: Path) -> None:
    gravel = "new RoughGround at (1, 0), with length 1, with width 1, with amplitude 0.003\n"
    stones = "for i in range(6):\n    new Kerb at (0.6 + 0.15 * i, 0), facing -90 deg, with height 0.03\n"
    (remark,) = notes(foldcar, tmp_path, gravel + stones + FACING)
    # A kerb has a slanted edge and a block behind it.
    assert "lies under the block at (0.605, 0) (and 10 more like it)" in remark


def test_a_hill_that_is_higher_than_the_block_on_it_counts(foldcar: Any, tmp_path: Path) -> None:
    hill = "new GaussianHill at (0.65, 0), with height {}, with sd_along 0.05\n"

    low, high = (notes(foldcar, tmp_path, RAMP + hill.format(height_m) + FACING) for height_m in (0.03, 0.3))

    assert "the hill at (0.65, 0) lies under the block" in str(low) and high == []


@pytest.mark.parametrize(("facing", "remarked"), [(-90, False), (-20, False), (90, True), (45, True), (170, True)])
def test_a_start_that_does_not_face_its_goal_is_remarked_on(
    facing: int, remarked: bool, foldcar: Any, tmp_path: Path
) -> None:
    found = notes(foldcar, tmp_path, FACING.replace("(0, 0), facing -90", f"(0, 0), facing {facing}", 1))

    assert found == (["the start does not face the goal: a car that drives straight on never reaches it"] * remarked)


@pytest.mark.parametrize(
    ("facing", "goal", "passes"),
    [
        # The goal's point lies behind the car or aside, but its line has no ends.
        (-30, "at (1.5, -0.9), facing -90 deg", True),
        (10, "at (1.5, 0.9), facing -90 deg", False),
        (-90, "at (0.5, 0.8), facing 0 deg", False),
        (-88, "at (0.5, 0.05), facing -90 deg", True),
        (-90, "at (1.5, 0.1), with reach 0.2", True),
        (-90, "at (1.5, 0.4), with reach 0.2", False),
        (90, "at (1.5, 0), with reach 0.2", False),
    ],
)
def test_a_remark_on_the_start_is_true_of_a_car_that_drives_straight_on(
    facing: int, goal: str, passes: bool, foldcar: Any, tmp_path: Path, write_listing: Any, listing_data: Any
) -> None:
    course = "param course_x_min = -4, course_x_max = 4, course_y_min = -4, course_y_max = 4\n"
    ego = f"ego = new Robot at (0, 0), facing {facing} deg\n"

    remarks = notes(foldcar, tmp_path, f"{course}{ego}goal = new Goal {goal}\n")

    listing_data["environments"] = {"1": {"scenic_filename": "p.scenic"}}
    listing_data["experiments"]["1"] |= {"env_id": 1}
    run = foldcar("run", write_listing(listing_data), "--experiment", "1", "--set", "width=95", "--json")
    assert (json.loads(run.stdout)["outcome"] == "passed") == passes, run.stdout + run.stderr
    assert bool(remarks) != passes


def test_a_remark_counts_a_sample_once(foldcar: Any, tmp_path: Path) -> None:
    gravel = "new RoughGround at (0.8, 0), with length 0.1, with width 0.1\n"
    pyramid = "new StepPyramid at (0.8, 0), facing -90 deg, with top_side 0.3\n"

    (remark,) = notes(foldcar, tmp_path, gravel + pyramid + FACING)

    assert remark.startswith("the rough ground at (0.8, 0) lies under the block at (0.8, 0)")


def test_a_sweep_says_so_too(foldcar: Any, tmp_path: Path, write_listing: Any, listing_data: Any) -> None:
    (tmp_path / "p.scenic").write_text("model model\n" + FACING.replace("facing -90", "facing 90", 1))
    listing_data["environments"] = {"1": {"scenic_filename": "p.scenic"}}
    listing_data["experiments"]["1"]["env_id"] = 1
    listing = write_listing(listing_data)

    first = foldcar("sweep", listing, "--store", "s.db", "--experiment", "1")

    assert "experiment 1: sample 0: the start does not face the goal" in first.stderr, first.stderr


def test_the_projects_environments_have_no_remarks() -> None:
    from foldcar.scenes.source import open_environment

    for program in sorted((PROJECT / "scenarios").glob("*.scenic")):
        assert scene_notes(open_environment(program, {}, 1).sample(0)) == [], program
