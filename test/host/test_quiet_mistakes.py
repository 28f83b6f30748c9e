"""Mistakes that once passed without a word: outputs over inputs, headings in degrees, speeds that no car reaches."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.reader import Store
from foldcar.study.listing import ListingError
from foldcar.study.listing_file import read_listing
from study_car import listing_of

PROGRAM = "model model\nego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (1, 0), facing -90 deg\n"
LISTING = listing_of("p.scenic", {"width": 95}, environments=2)


@pytest.fixture
def folder(tmp_path: Path, foldcar: Any) -> Path:
    """A folder with a program, its listing and a store of two runs."""
    (tmp_path / "p.scenic").write_text(PROGRAM)
    (tmp_path / "l.json").write_text(json.dumps(LISTING))
    assert foldcar("sweep", "l.json", "--store", "a.db").returncode == 0
    return tmp_path


def test_no_output_replaces_an_input_or_a_store(folder: Path, refused: Any) -> None:
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    for words, why in (
        (("export", "a.db", "--csv", "a.db"), "a.db: is a store"),
        (("export", "a.db", "--parquet", "./a.db"), "a.db: is a store"),
        (("export", "a.db", "--csv", "z", "--parquet", "z"), "z: is named twice"),
        (("sample", "p.scenic", "-o", "p.scenic"), "p.scenic: is read by this command"),
        (("sample", "p.scenic", "-o", "a.db"), "a.db: is a store"),
        (("view", "l.json", "-o", "l.json"), "l.json: is read by this command"),
        (("flash", "l.json", "--experiment", "1", "--file", "l.json"), "l.json: is read by this command"),
    ):
        assert why in refused(*words)
        assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("specifier", "why"),
    [
        ("facing -90", "`facing`: -90 is"),
        ("facing 7", "`facing`: 7 is"),
        ("facing Normal(-90, 0.1)", "`facing`: -90 is"),
        ("with yaw Range(0, 180)", "`with yaw`: 180 is"),
    ],
)
def test_a_heading_in_degrees_is_refused_at_its_line(tmp_path: Path, refused: Any, specifier: str, why: str) -> None:
    (tmp_path / "p.scenic").write_text(PROGRAM + f"new Bump at (0.5, 0),\n    {specifier}\n")

    assert f"line 5: {why}" in refused("sample", "p.scenic")


@pytest.mark.parametrize("specifier", ["facing -90 deg", "facing Range(-180, 180) deg", "facing 6", "with yaw 90 deg"])
def test_other_headings_are_taken(tmp_path: Path, foldcar: Any, specifier: str) -> None:
    (tmp_path / "p.scenic").write_text(PROGRAM + f"new Pothole at (0.5, 0), {specifier}\n")

    assert '"kind": "pothole"' in foldcar("sample", "p.scenic").stdout


def test_a_speed_above_the_cars_own_is_refused_before_the_first_run(tmp_path: Path, refused: Any) -> None:
    listing = listing_of("p.scenic", {"width": 95}, environments=2, speed=2.0)
    (tmp_path / "p.scenic").write_text(PROGRAM)
    (tmp_path / "l.json").write_text(json.dumps(listing))

    assert "experiments.1.params.speed: 2 is above 0." in refused("sweep", "l.json", "--store", "a.db")


def test_a_program_in_another_encoding_is_named(tmp_path: Path, refused: Any) -> None:
    (tmp_path / "p.scenic").write_bytes(PROGRAM.encode() + b"# \xe4\n")

    assert f"p.scenic: is not UTF-8 text (byte {len(PROGRAM) + 2})" in refused("sample", "p.scenic")


def test_a_list_is_no_listing(tmp_path: Path) -> None:
    (tmp_path / "l.json").write_text("[]")

    with pytest.raises(ListingError, match=r"l.json: the file: \[\] is not a JSON object"):
        read_listing(tmp_path / "l.json")


def test_a_report_is_written_where_names_are_no_text(folder: Path) -> None:
    words = [sys.executable, "-m", "foldcar", "report", "a.db", "-o", os.fsdecode(b"r\xe4")]
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0"}
    subprocess.run(words, cwd=folder, env=environment, check=True, capture_output=True)

    assert (folder / os.fsdecode(b"r\xe4") / "index.html").is_file()


def test_trials_of_other_experiments_and_samples_are_noticed_and_a_correction_that_changes_nothing_leaves_no_trail(
    folder: Path, foldcar: Any, refused: Any
) -> None:
    rows = ["experiment,vehicle_type,width_mm,sample,outcome,source", "1,W_B_W,95,7,passed,me", "7,W_B_W,95,,passed,me"]
    (folder / "t.csv").write_text("\n".join(rows))

    said = foldcar("trials", "import", "a.db", "t.csv").stderr
    told = refused("trials", "correct", "a.db", "1", "--outcome", "passed", "--reason", "same")

    assert 'note: experiment "1" was swept in samples 0 to 1; sample 7 has no runs' in said
    assert 'note: experiment "7" was not swept in a.db, only 1' in said
    assert told == "a.db: trial 1: outcome is 'passed' already"
    with Store.open(folder / "a.db") as store:
        assert list(store.corrections(1)) == []
