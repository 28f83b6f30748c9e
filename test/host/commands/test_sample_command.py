"""The command `foldcar sample`."""

import json
from pathlib import Path
from typing import Any

PYRAMIDS = Path(__file__).resolve().parents[3] / "scenarios" / "step_pyramids.scenic"
PNG = b"\x89PNG\r\n\x1a\n"


def test_lines_go_to_a_file_or_to_the_terminal_and_a_picture_beside_them(foldcar: Any, tmp_path: Path) -> None:
    file, picture = tmp_path / "scenes.jsonl", tmp_path / "scenes.png"
    done = foldcar("sample", PYRAMIDS, "-n", "3", "--seed", "42", "-o", file, "--plot", picture)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    lines = file.read_text().splitlines(keepends=True)
    assert "".join(lines[:2]) == foldcar("sample", PYRAMIDS, "-n", "2", "--seed", "42").stdout
    scenes = [json.loads(line)["scene"] for line in lines]
    assert [scene["id"] for scene in scenes] == ["42/0", "42/1", "42/2"]
    assert set(scenes[0]) == {"id", "friction", "terrain", "start", "goal", "course"}
    assert picture.read_bytes().startswith(PNG)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scenes.jsonl", "scenes.png"]


def test_a_picture_alone_comes_with_a_summary(foldcar: Any, tmp_path: Path) -> None:
    done = foldcar("sample", PYRAMIDS, "-n", "4", "--seed", "42", "--plot", "scenes.svg")
    first, friction, *terrain = done.stdout.splitlines()
    assert first == "step_pyramids.scenic, seed 42: 4 scenes, drawn in scenes.svg"
    assert friction.startswith("  friction 0.") and terrain and all(" in each scene" in line for line in terrain)
    picture = (tmp_path / "scenes.svg").read_text()
    assert picture.count("distance from the start (m)") == 4
    written = foldcar("sample", PYRAMIDS, "-n", "4", "--seed", "42", "-o", "-", "--plot", "scenes.svg")
    assert [json.loads(line)["scene"]["id"] for line in written.stdout.splitlines()] == [f"42/{k}" for k in range(4)]


def test_parameters_are_read_as_json_values(foldcar: Any) -> None:
    done = foldcar("sample", PYRAMIDS, "--param", "step_height=0.01", "--param", "friction=5e-1")
    scene = json.loads(done.stdout)["scene"]
    assert (scene["friction"], scene["terrain"][0]["height_m"]) == (0.5, 0.01)


def test_mistakes_are_one_line_and_leave_no_file(refused: Any, tmp_path: Path) -> None:
    file = tmp_path / "scenes.jsonl"
    file.write_text("kept\n")
    for arguments, part in (
        (["--param", "step_height=high"], "param step_height: 'high' is not a number"),
        (["--param", "friction"], "--param friction: not NAME=VALUE"),
        (["--param", "step_height=-1"], "height_m: -1 is not within 0.0001 to 1"),
        (["--plot", "a.gif"], "a picture's name ends in one of .png, .svg, .pdf"),
        (["--plot", "nowhere/deeper/a.png"], "the folder nowhere does not exist"),
    ):
        assert part in refused("sample", PYRAMIDS, *arguments, "-o", file)
    assert [path.name for path in tmp_path.iterdir()] == ["scenes.jsonl"]
    assert file.read_text() == "kept\n"


def test_a_picture_is_small_and_the_same_each_time(foldcar: Any, tmp_path: Path, carsim_binary: Path) -> None:
    """Pictures are kept with the documentation."""
    for file in ("a.png", "b.png"):
        done = foldcar("sample", PYRAMIDS.parent / "two_bumps.scenic", "-n", "3", "--seed", "42", "--plot", file)
        assert (done.returncode, done.stderr) == (0, "")

    assert len((tmp_path / "a.png").read_bytes()) < 150_000
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
