"""Mistakes that once passed without a word: outputs over inputs, names that are no text, trials of other samples."""

import contextlib
import json
import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from forked_foldcar import original

PROGRAM = "model model\nego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (1, 0), facing -90 deg\n"
LISTING: dict[str, Any] = {
    "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"environments": 2}}},
    "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": 95}}]}},
    "environments": {"1": {"scenic_filename": "p.scenic"}},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a program, its listing and a store of two runs."""
    folder = tmp_path_factory.mktemp("quiet")
    (folder / "p.scenic").write_text(PROGRAM)
    (folder / "l.json").write_text(json.dumps(LISTING))
    foldcar(folder, "sweep", "l.json", "--store", "a.db")
    return folder


def foldcar(folder: Path, *words: str, fails: str | None = None) -> str:
    """What the command prints; ``fails`` is in its one line of error, with exit code 2."""
    done = original().run(words, folder)
    assert done.returncode == (0 if fails is None else 2), done.stderr
    if fails is not None:
        (line,) = [line for line in done.stderr.splitlines() if line.startswith("foldcar: error:")]
        assert fails in line and "Traceback" not in done.stderr, done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize("section", ["experiments", "vehicles", "environments"])
def test_a_name_of_a_listing_cannot_forge_a_line(folder: Path, section: str) -> None:
    (key,) = LISTING[section]
    name = "a\nfoldcar: error: b"
    (folder / "forged.json").write_text(json.dumps({**LISTING, section: {name: LISTING[section][key]}}))

    printed = foldcar(folder, "sweep", "forged.json", "--store", "forged.db", fails=f"{section}.a\\nfoldcar: error: b")

    assert "a name has no line breaks" in printed and printed.count("\n") <= 2
    assert not (folder / "forged.db").exists()


@pytest.mark.parametrize(
    ("sql", "what"),
    [
        ("UPDATE experiment SET vehicle = 'a' || char(10) || 'b'", "such a value of vehicle"),
        ("UPDATE experiment SET facts = json_set(facts, '$.success_rule', 'a' || char(10))", "such a value of facts"),
    ],
)
def test_a_name_of_a_store_cannot_forge_a_line(folder: Path, sql: str, what: str) -> None:
    shutil.copy(folder / "a.db", folder / "b.db")
    with contextlib.closing(sqlite3.connect(folder / "b.db")) as database, database:
        database.execute(sql)

    foldcar(folder, "select", "b.db", fails=f"b.db: experiment (id=1) is damaged: foldcar does not write {what}")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("export", "a.db", "--csv", "a.db"), "a.db: is a store"),
        (("export", "a.db", "--parquet", "./a.db"), "a.db: is a store"),
        (("export", "a.db", "--csv", "z", "--parquet", "z"), "z: is named twice"),
        (("sample", "p.scenic", "-o", "p.scenic"), "p.scenic: is read by this command"),
        (("sample", "p.scenic", "-o", "a.db"), "a.db: is a store"),
        (("view", "l.json", "-o", "l.json"), "l.json: is read by this command"),
        (("flash", "l.json", "--experiment", "1", "--file", "l.json"), "l.json: is read by this command"),
    ],
)
def test_no_output_replaces_an_input_or_a_store(folder: Path, words: tuple[str, ...], why: str) -> None:
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    foldcar(folder, *words, fails=why)

    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def test_a_report_is_written_where_names_are_no_text(folder: Path) -> None:
    words = [sys.executable, "-m", "foldcar", "report", "a.db", "-o", os.fsdecode(b"r\xe4")]
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0"}
    subprocess.run(words, cwd=folder, env=environment, check=True, capture_output=True)

    assert (folder / os.fsdecode(b"r\xe4") / "index.html").is_file()


def test_imported_trials_of_other_experiments_and_samples_are_noticed(folder: Path) -> None:
    rows = ["experiment,vehicle_type,width_mm,sample,outcome,source", "1,W_B_W,95,7,passed,me", "7,W_B_W,95,,passed,me"]
    (folder / "t.csv").write_text("\n".join(rows))

    done = foldcar(folder, "trials", "import", "a.db", "t.csv")

    assert 'note: experiment "1" was swept in samples 0 to 1; sample 7 has no runs' in done
    assert 'note: experiment "7" was not swept in a.db, only 1' in done
