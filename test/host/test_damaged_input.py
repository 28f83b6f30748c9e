"""Input with values that no one means, and files with flipped bits: one line that names the place, never a traceback."""

import gzip
import json
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.store.rows import checksum
from foldcar.store.tables import TRIAL
from foldcar.study.listing_file import read_listing

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
