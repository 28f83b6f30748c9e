"""Remarks on scenes that their authors probably did not mean."""

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

    why = "the higher one counts, so it has no effect there"
    assert hidden == [f"the rough ground at (0.65, 0) lies under the block at (0.65, 0): {why}"]
    assert beside == []


def test_a_hill_that_is_higher_than_the_block_on_it_counts(foldcar: Any, tmp_path: Path) -> None:
    hill = "new GaussianHill at (0.65, 0), with height {}, with sd_along 0.05\n"

    low, high = (notes(foldcar, tmp_path, RAMP + hill.format(height_m) + FACING) for height_m in (0.03, 0.3))

    assert "the hill at (0.65, 0) lies under the block" in str(low) and high == []


@pytest.mark.parametrize(("facing", "remarked"), [(-90, False), (-20, False), (90, True), (45, True), (170, True)])
def test_a_start_that_faces_away_from_its_goal_is_remarked_on(
    facing: int, remarked: bool, foldcar: Any, tmp_path: Path
) -> None:
    found = notes(foldcar, tmp_path, FACING.replace("(0, 0), facing -90", f"(0, 0), facing {facing}", 1))

    assert found == (["the start faces away from the goal: a car that drives straight on never reaches it"] * remarked)


def test_a_sweep_says_so_too(foldcar: Any, tmp_path: Path, write_listing: Any, listing_data: Any) -> None:
    (tmp_path / "p.scenic").write_text("model model\n" + FACING.replace("facing -90", "facing 90", 1))
    listing_data["environments"] = {"1": {"scenic_filename": "p.scenic"}}
    listing_data["experiments"]["1"]["env_id"] = 1
    listing = write_listing(listing_data)

    first = foldcar("sweep", listing, "--store", "s.db", "--experiment", "1")

    assert "experiment 1: sample 0: the start faces away from the goal" in first.stderr, first.stderr


def test_the_projects_environments_have_no_remarks() -> None:
    from foldcar.scenes.source import open_environment

    for program in sorted((PROJECT / "scenarios").glob("*.scenic")):
        assert scene_notes(open_environment(program, {}, 1).sample(0)) == [], program
