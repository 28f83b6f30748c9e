"""The command `foldcar gallery`."""

import subprocess
from collections.abc import Callable
from pathlib import Path

Foldcar = Callable[..., "subprocess.CompletedProcess[str]"]
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def test_named_programs_are_drawn_into_a_folder(foldcar: Foldcar, tmp_path: Path, carsim_binary: Path) -> None:
    programs = [SCENARIOS / "two_bumps.scenic", SCENARIOS / "gaussian_hills.scenic"]
    done = foldcar("gallery", *programs, "-o", "pictures")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["pictures/two_bumps.png", "pictures/gaussian_hills.png"]
    files = {file.name: file.read_bytes() for file in (tmp_path / "pictures").iterdir()}
    assert set(files) == {"two_bumps.png", "gaussian_hills.png"}
    # They are kept with the documentation.
    assert all(len(content) < 150_000 for content in files.values())
    foldcar("gallery", programs[0], "-o", "again")
    assert (tmp_path / "again" / "two_bumps.png").read_bytes() == files["two_bumps.png"]


def test_two_programs_of_one_name_and_a_file_as_folder_are_refused(foldcar: Foldcar, tmp_path: Path) -> None:
    program = SCENARIOS / "two_bumps.scenic"
    twice = foldcar("gallery", program, program, "-o", "pictures")
    assert (twice.returncode, twice.stdout) == (2, "")
    assert "pictures/two_bumps.png: two programs have this name" in twice.stderr
    (tmp_path / "file").write_text("")
    taken = foldcar("gallery", program, "-o", "file")
    assert taken.returncode == 2
    assert taken.stderr.count("\n") == 1
    assert "file" in taken.stderr
