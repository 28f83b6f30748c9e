"""`foldcar new`: a project that runs as it is, and what is refused."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.commands.new import EXAMPLES, FILES
from foldcar.study.experiments import read_study

Command = Callable[..., "subprocess.CompletedProcess[str]"]
STARTER = Path(__file__).resolve().parents[3] / "host" / "foldcar" / "study" / "starter"


def test_a_new_project_is_whole_and_says_what_to_type_next(foldcar: Command, tmp_path: Path) -> None:
    done = foldcar("new", "my yard")

    assert (done.returncode, done.stderr) == (0, "")
    folder = tmp_path / "my yard"
    assert {file.name for file in folder.iterdir()} == set(FILES) == {file.name for file in STARTER.iterdir()}
    (experiment,) = read_study(folder / "study.json").experiments
    assert len(experiment.family) == 9
    # What it says to type is what a shell understands.
    cd, *commands = [line.strip() for line in done.stdout.splitlines()[1:]]
    assert cd == "cd 'my yard'"
    words = [line.split()[:3] for line in commands]
    assert words == [["foldcar", "sweep", "study.json"], ["foldcar", "report", "study.db"]]


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_has_what_its_commands_name(foldcar: Command, refused: Any, tmp_path: Path, example: str) -> None:
    done = foldcar("new", "study", "--example", example)

    assert (done.returncode, done.stderr) == (0, "")
    folder = tmp_path / "study"
    for command in done.stdout.splitlines()[2:]:
        for word in command.split():
            if Path(word).suffix in (".json", ".scenic", ".csv"):
                assert (folder / word).is_file(), command
    # With the environments that they name.
    for listing in folder.glob("scenarios/*.json"):
        assert read_study(listing).experiments
    # A name that is none.
    message = refused("new", "other", "--example", example + "s")
    assert message.startswith(f"--example {example}s: unknown example; choose one of width_study")
    assert not (tmp_path / "other").exists()


def test_the_projects_environment_tells_its_designs_apart(foldcar: Command, tmp_path: Path) -> None:
    foldcar("new", "yard")
    listing = tmp_path / "yard" / "study.json"
    done = foldcar("sweep", listing, "--store", "study.db", "--samples", "6", "--json")
    assert done.returncode == 0, done.stderr
    foldcar("report", "study.db", "-o", "report")

    (experiment,) = study_of(tmp_path / "report")["experiments"]
    k = [parameter["name"] for parameter in experiment["parameters"]].index("radius_mm")
    passed: dict[float, list[float]] = {}
    for values, rate in zip(experiment["designs"]["value"], experiment["designs"]["rate"], strict=True):
        passed.setdefault(experiment["parameters"][k]["values"][values[k]], []).append(rate)
    shares = {radius_mm: sum(rates) / len(rates) for radius_mm, rates in passed.items()}
    # A kerb of 30 mm is most of what the smallest wheels, of 44 mm, can climb; the largest have room.
    assert shares[44.0] < 0.8 < shares[60.0]


@pytest.mark.parametrize("content", ["README.md", ".hidden"])
def test_a_folder_with_anything_in_it_is_refused_and_left_alone(refused: Any, tmp_path: Path, content: str) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / content).write_text("mine", encoding="utf-8")

    assert refused("new", "full") == "full: is not empty; name a new folder"
    assert [(file.name, file.read_text()) for file in (tmp_path / "full").iterdir()] == [(content, "mine")]


def test_a_full_disk_leaves_nothing_half_written(tmp_path: Path) -> None:
    # The largest file that the process may write is shorter than the listing.
    done = subprocess.run(
        ["sh", "-c", 'trap "" XFSZ; ulimit -f 1; exec "$@"', "sh", sys.executable, "-m", "foldcar", "new", "yard"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2 and "yard: cannot be written: File too large" in done.stderr, done.stderr
    assert not (tmp_path / "yard").exists()
