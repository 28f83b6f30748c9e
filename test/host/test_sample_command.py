"""The command `foldcar sample`."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from foldcar.cli import main

PYRAMIDS = Path(__file__).resolve().parents[2] / "scenarios" / "step_pyramids.scenic"
PNG = b"\x89PNG\r\n\x1a\n"


@dataclass
class Command:
    """`foldcar sample` in this process: what it printed, and its exit code."""

    monkeypatch: pytest.MonkeyPatch
    capsys: pytest.CaptureFixture[str]

    def __call__(self, *arguments: str | Path) -> tuple[int, str, str]:
        self.monkeypatch.setattr(sys, "argv", ["foldcar", "sample", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        printed = self.capsys.readouterr()
        return int(end.value.code or 0), printed.out, printed.err


@pytest.fixture
def sample(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    return Command(monkeypatch, capsys)


def test_lines_go_to_a_file_or_to_the_terminal_and_a_picture_beside_them(sample: Command, tmp_path: Path) -> None:
    file, picture = tmp_path / "scenes.jsonl", tmp_path / "scenes.png"
    assert sample(PYRAMIDS, "-n", "3", "--seed", "42", "-o", file, "--plot", picture) == (0, "", "")
    _, shown, _ = sample(PYRAMIDS, "-n", "2", "--seed", "42")
    lines = file.read_text().splitlines(keepends=True)
    assert "".join(lines[:2]) == shown
    scenes = [json.loads(line)["scene"] for line in lines]
    assert [scene["id"] for scene in scenes] == ["42/0", "42/1", "42/2"]
    assert set(scenes[0]) == {"id", "friction", "terrain", "start", "goal", "course"}
    assert picture.read_bytes().startswith(PNG)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scenes.jsonl", "scenes.png"]


def test_parameters_are_read_as_json_values(sample: Command) -> None:
    _, shown, _ = sample(PYRAMIDS, "--param", "step_height=0.01", "--param", "friction=5e-1")
    scene = json.loads(shown)["scene"]
    assert (scene["friction"], scene["terrain"][0]["height_m"]) == (0.5, 0.01)


def test_mistakes_are_one_line_and_leave_no_file(sample: Command, tmp_path: Path) -> None:
    file = tmp_path / "scenes.jsonl"
    file.write_text("kept\n")
    for arguments, part in (
        (["--param", "step_height=high"], "param step_height: 'high' is not a number"),
        (["--param", "friction"], "--param friction: not NAME=VALUE"),
        (["--param", "step_height=-1"], "height_m: -1 is below the limit 0.0001"),
        (["--plot", str(tmp_path / "a.gif")], "a picture's name ends in one of .png, .svg, .pdf"),
        (["--plot", str(tmp_path / "nowhere" / "deeper" / "a.png")], "there is no folder"),
    ):
        output = [] if "nowhere" in arguments[1] else ["-o", file]
        code, _, said = sample(PYRAMIDS, *arguments, *output)
        assert code == 2
        assert said.startswith("foldcar: error: ")
        assert said.count("\n") == 1
        assert part in said
    assert [path.name for path in tmp_path.iterdir()] == ["scenes.jsonl"]
    assert file.read_text() == "kept\n"
