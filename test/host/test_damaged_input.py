"""Input with values that no one means, and files with flipped bits: one line that names the place, never a traceback."""

import gzip
import json
import random
import re
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.cli import app
from foldcar.errors import FoldcarError
from foldcar.store.rows import checksum
from foldcar.store.tables import TRIAL
from foldcar.study.listing_file import read_listing
from foldcar.trials.csv_import import read_trials

STORES = Path(__file__).parent / "stores"
Foldcar = Callable[..., Any]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ('{"from": 65, "to": 1e300, "step": 1e-300}', r"width\.to: 1e\+300 is no number to compute with"),
        ('{"from": 1e-300, "to": 1, "step": 1}', r"width\.from: 1e-300 is no number"),
        ("1e999", "width: inf is no number"),
        ("9" * 400, "width: a number of 400 digits is above the limit"),
        ('"\\ud800"', "holds what is no character"),
    ],
)
def test_a_number_beyond_computing_is_named(tmp_path: Path, listing_data: Any, value: str, message: str) -> None:
    file = tmp_path / "l.json"
    file.write_text(json.dumps(listing_data).replace("[95, 245]", value))

    with pytest.raises(FoldcarError, match=message):
        read_listing(file)


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        ("note", "x" * 140_000, r"line 2: field larger than field limit \(131072\)"),
        ("sample", str(2**63), "sample: 9223372036854775808 is above the maximum 9223372036854775807"),
        ("sample", "9" * 400, "sample: 9+ is below the minimum 0 or not finite"),
        ("started_utc", "2026-13-45", 'started_utc: "2026-13-45" is not a date'),
        ("started_utc", "yesterday", "such as 2026-05-01T09:30:00"),
    ],
)
def test_a_cell_that_no_store_keeps_is_named(tmp_path: Path, column: str, cell: str, message: str) -> None:
    file = tmp_path / "t.csv"
    file.write_text(f"vehicle_type,width_mm,outcome,source,experiment,{column}\nW_B_W,95,passed,paper,1,{cell}\n")

    with pytest.raises(FoldcarError, match=message):
        read_trials(file, None)


@pytest.mark.parametrize(
    "words",
    [
        ("sample", "flat.scenic", "--param", "x=" + "9" * 5000),
        ("run", "l.json", "--experiment", "1", "--sample", str(2**63)),
    ],
)
def test_an_option_beyond_computing_is_one_line(foldcar: Foldcar, tmp_path: Path, words: tuple[str, ...]) -> None:
    answer = foldcar(*words)

    assert answer.returncode == 2 and "Traceback" not in answer.stderr
    assert len(answer.stderr.splitlines()[-1]) < 400


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_store_with_flipped_bytes_is_read_or_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = gzip.decompress((STORES / "version_1.db.gz").read_bytes())
    texts = [(found.start(), found.end()) for found in re.finditer(rb"[\x20-\x7e]{6,}", whole)]
    chance = random.Random(seed)
    (tmp_path / "t.csv").write_text("vehicle_type,outcome,source,experiment,width_mm\nW_B_W,passed,paper,1,95\n")
    commands = (
        ("export", "s.db", "--csv", "o.csv"), ("export", "s.db", "--trials", "t2.csv"), ("check", "s.db"),
        ("trials", "list", "s.db"), ("export", "s.db", "--folder", "all"), ("trials", "import", "s.db", "t.csv"),
    )  # fmt: skip
    refused = 0
    for turn in range(30):
        damaged = bytearray(whole)
        for _ in range(chance.choice((1, 2, 8))):
            damaged[chance.randrange(*chance.choice(texts))] = chance.choice(b'\xff"{1\0')
        for suffix in ("", "-wal", "-shm", "-journal"):
            Path(f"s.db{suffix}").unlink(missing_ok=True)
        shutil.rmtree("all", ignore_errors=True)
        Path("s.db").write_bytes(damaged)
        try:
            app([*commands[turn % len(commands)]], standalone_mode=False)
        except FoldcarError as error:
            assert str(error)
            refused += 1
    assert refused >= 3


@pytest.mark.parametrize("column", ["design", "deviations"])
def test_json_that_is_none_is_named_though_its_checksum_is_right(tmp_path: Path, foldcar: Foldcar, column: str) -> None:
    stored(tmp_path, column, "{")

    for words in (("trials", "list", "s.db"), ("export", "s.db", "--trials", "t.csv"), ("trials", "replay", "s.db", "1")):
        answer = foldcar(*words)
        assert answer.returncode == 2
        where = "foldcar: error: s.db: trial (id=1) is damaged"
        assert answer.stderr == f"{where}: its {column} is not what foldcar writes\n"


def test_a_log_path_that_leads_out_of_the_folder_is_refused_wherever_it_is_read(tmp_path: Path, foldcar: Foldcar) -> None:
    stored(tmp_path, "log", "../../etc/passwd")

    for words in (("trials", "export", "s.db", "1", "--mcap", "x.mcap"), ("export", "s.db", "--folder", "all")):
        answer = foldcar(*words)
        assert answer.returncode == 2, words
        assert '"../../etc/passwd" leads out of the folder' in answer.stderr
    checked = foldcar("check", "s.db")
    assert checked.returncode != 0 and "leads out of the folder" in checked.stdout + checked.stderr


def stored(folder: Path, column: str, value: str) -> None:
    """A store s.db whose first trial has that value, with the right checksum."""
    path = folder / "s.db"
    path.write_bytes(gzip.decompress((STORES / "version_1.db.gz").read_bytes()))
    with sqlite3.connect(path) as connection:
        connection.row_factory = sqlite3.Row
        connection.execute(f"UPDATE trial SET {column} = ? WHERE id = 1", (value,))
        row = dict(connection.execute("SELECT * FROM trial WHERE id = 1").fetchone())
        connection.execute("UPDATE trial SET checksum = ? WHERE id = 1", (checksum(TRIAL, row),))
    connection.close()
