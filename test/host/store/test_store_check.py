"""Damage in a store: found by `foldcar check`, and refused by other commands in one line."""

import shutil
import sqlite3
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.errors import FoldcarError
from foldcar.store.check import check_store
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_files import log_file
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME, EXPERIMENT, MEDIA, SAMPLE, TABLES, TRIAL, Table
from full_store import alter, change, contents, full_store


def test_a_full_store_has_rows_in_every_table_and_is_sound(store: Path, foldcar: Any) -> None:
    assert all(contents(store)[table.name] for table in TABLES)
    answer = foldcar("check", "s.db")
    assert (answer.returncode, answer.stdout.startswith("s.db: sound; ")) == (0, True), answer.stdout


def test_a_table_of_an_earlier_release_is_left_unread(store: Path, foldcar: Any) -> None:
    alter(store, "CREATE TABLE track (id INTEGER NOT NULL REFERENCES trial (id), film TEXT, PRIMARY KEY (id)) STRICT")
    trials_and_runs = contents(store)["trial"], contents(store)["run"]
    alter(store, "INSERT INTO track VALUES (1, 'trial.mp4')")

    for words in (("check", "s.db"), ("trials", "list", "s.db"), ("merge", "s.db", "s.db", "-o", "m.db")):
        answer = foldcar(*words)
        assert (answer.returncode, answer.stderr) == (0, ""), answer.stderr
    changed = foldcar("trials", "correct", "s.db", "1", "--note", "slipped", "--reason", "forgotten")
    assert changed.returncode == 0, changed.stderr
    merged = contents(store.with_name("m.db"))
    assert (merged["trial"], merged["run"]) == trials_and_runs and "track" not in merged
    assert contents(store)["track"] == [{"id": 1, "film": "trial.mp4"}]


def test_values_that_a_table_does_not_take_are_found_and_refused(store: Path, foldcar: Any) -> None:
    alter(store, "PRAGMA ignore_check_constraints = ON", "UPDATE run SET outcome = 'pbssed' WHERE outcome = 'passed'")

    for words in (("report", "s.db", "-o", "out"), ("export", "s.db", "--csv", "-")):
        answer = foldcar(*words)
        assert answer.returncode == 2
        assert answer.stderr == (
            "foldcar: error: s.db: is damaged: CHECK constraint failed in run; `foldcar check s.db` lists all damage\n"
        )
    checked = foldcar("check", "s.db")
    assert checked.returncode == 1 and "CHECK constraint failed in run" in checked.stdout


def test_lost_references_are_found(store: Path) -> None:
    alter(store, "DELETE FROM scene WHERE id = 1")
    alter(store, "DELETE FROM run WHERE outcome = 'passed'")
    findings = check_store(store).findings
    assert "table sample: 1 row refers to missing rows of scene" in findings
    assert any(finding.startswith("table recorded: ") and "rows of run" in finding for finding in findings)


def test_logs_are_compared_with_their_hash(store: Path, tmp_path: Path, foldcar: Any) -> None:
    first, second = sorted((tmp_path / "s-logs").iterdir())
    first.write_bytes(first.read_bytes()[:-1])
    second.unlink()

    findings = check_store(store).findings

    assert findings == [
        f"trial (id=1): its log {first} does not match its SHA-256",
        f"trial (id=2): its log {second} is missing",
    ]
    assert foldcar("check", "s.db").returncode == 1


@pytest.mark.parametrize("column", ["design", "deviations"])
def test_json_that_is_none_is_named(store: Path, foldcar: Any, column: str) -> None:
    change(store, TRIAL, "id = 1", **{column: "{"})

    answer = foldcar("trials", "list", "s.db")

    where = "foldcar: error: s.db: trial (id=1) is damaged"
    assert (answer.returncode, answer.stderr) == (2, f"{where}: foldcar does not write such a value of {column}\n")


DAMAGED_TEXTS = ("{", "null", "[]", "{}", "NaN", "[" * 3000 + "]" * 3000)


def test_no_damaged_json_ends_in_a_traceback(store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    full_store(tmp_path / "other" / "s.db")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.csv").write_text("experiment,vehicle_type,width_mm,outcome,source,sample\n1,W_B_W,95,stuck,table,0\n")
    commands = (
        ["trials", "list", "s.db"],
        ["trials", "import", "s.db", "t.csv"],
        ["export", "s.db", "--csv", "a.csv", "--trials", "t2.csv"],
        ["merge", "other/s.db", "s.db", "-o", "m.db"],
        ["check", "s.db"],
    )
    sound, refused = store.read_bytes(), 0
    for table in TABLES:
        for column, text in product(table.json_columns, DAMAGED_TEXTS):
            store.write_bytes(sound)
            change(store, table, "1", **{column: text})
            for words in commands:
                (tmp_path / "m.db").unlink(missing_ok=True)
                answer = CliRunner().invoke(app, words)
                assert isinstance(answer.exception, FoldcarError | SystemExit | None), (table.name, text, answer.exc_info)
                refused += answer.exception is not None
    assert refused > 150


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("DROP TABLE correction", "is damaged: correction is missing"),
        ("DROP VIEW result", "is damaged: result is missing"),
        ("ALTER TABLE trial RENAME COLUMN note TO notes", "is damaged: trial is changed"),
        ("CREATE TRIGGER own BEFORE UPDATE ON trial BEGIN SELECT RAISE(IGNORE); END",
         "has a trigger that foldcar does not make: own"),
    ],
)  # fmt: skip
def test_tables_and_views_that_are_not_as_foldcar_makes_them_are_refused(
    store: Path, foldcar: Any, statement: str, message: str
) -> None:
    alter(store, statement)

    for words in (("trials", "list", "s.db"), ("trials", "withdraw", "s.db", "1", "--reason", "practice")):
        answer = foldcar(*words)
        assert (answer.returncode, answer.stderr) == (2, f"foldcar: error: s.db: {message}\n")


def test_experiments_without_a_study_are_refused(store: Path, foldcar: Any) -> None:
    alter(store, "DELETE FROM study")

    answer = foldcar("export", "s.db", "--csv", "-")

    assert answer.returncode == 2 and "s.db: has no study" in answer.stderr and answer.stderr.count("\n") == 1


@pytest.mark.parametrize("table", ["body", "settings", "scene"])
def test_simulated_texts_are_compared_with_their_hash(store: Path, foldcar: Any, table: str) -> None:
    change(store, BY_NAME[table], "id = 1", json='{"friction": 0.61}')

    damage = f"{table} (id=1) is damaged: its json does not match its hash"
    answer = foldcar("merge", "s.db", "s.db", "-o", "m.db")
    assert (answer.returncode, answer.stderr) == (2, f"foldcar: error: s.db: {damage}\n")
    assert damage in check_store(store).findings


@pytest.mark.parametrize(
    ("table", "column", "value", "shown"),
    [
        (SAMPLE, "sample", -1, "-1"),
        (EXPERIMENT, "environments", 2**62, "4.61169e+18"),
        (TRIAL, "elapsed_time_s", 9e999, "inf"),
    ],
)
def test_numbers_beyond_their_limits_are_refused(
    store: Path, foldcar: Any, table: Table, column: str, value: float, shown: str
) -> None:
    change(store, table, f"{column} > 1", **{column: value})

    answer = foldcar("export", "s.db", "--csv", "-")

    assert answer.returncode == 2
    assert f"is damaged: its {column} is {shown}, not " in answer.stderr and answer.stderr.count("\n") == 1


def test_logs_outside_of_the_folder_are_refused(tmp_path: Path, store: Path, foldcar: Any) -> None:
    (tmp_path / "s-logs" / "link").symlink_to("/etc/passwd")
    for log in ("../../etc/passwd", "/etc/passwd", "s-logs/../../x", "s-logs/link", "", "a\x00b"):
        change(store, TRIAL, "id = 1", log=log)

        with Store.open(store) as opened, pytest.raises(StoreError, match="is outside the folder"):
            log_file(store, str(opened.trial(1).log))
        assert any("is outside the folder" in finding for finding in check_store(store).findings)
    answer = foldcar("merge", "s.db", "s.db", "-o", "m.db")
    assert answer.returncode == 2 and "is outside the folder" in answer.stderr and answer.stderr.count("\n") == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s-logs", "s.db"]


def test_logs_may_be_on_another_disk(tmp_path: Path, store: Path, foldcar: Any) -> None:
    """The folder of logs is a symbolic link."""
    disk = tmp_path / "disk"
    disk.mkdir()
    (tmp_path / "s-logs").rename(disk / "logs")
    (tmp_path / "s-logs").symlink_to(disk / "logs")
    (tmp_path / "new").mkdir()
    names = sorted(file.name for file in (disk / "logs").iterdir())
    assert names and check_store(store).findings == []

    for command in (("merge", "s.db", "s.db", "-o", "new/m.db"), ("trials", "import", "new/n.db", "s.db")):
        answer = foldcar(*command)
        assert answer.returncode == 0 and answer.stderr == "", answer.stderr
        copied = sorted(file.name for file in (tmp_path / "new" / "s-logs").iterdir())
        assert copied == names
        shutil.rmtree(tmp_path / "new" / "s-logs")


def test_a_store_brings_no_file_that_a_program_would_read(tmp_path: Path, store: Path, foldcar: Any) -> None:
    """A log is copied by `merge` only under a name that foldcar gives to logs."""
    (tmp_path / "new").mkdir()
    for log in (
        "model.scenic", "s-logs/helper.py", "s-logs/trial-0001-20261122T113100Z.py", "trial-0001-20261122T113100Z.tlog",
        "scenes/trial-0001-20261122T113100Z.tlog", "a/s-logs/trial-0001-20261122T113100Z.tlog",
        "s-logs/trial-0001-20261122T113100Z.tlog\n", "s\x1b-logs/trial-0001-20261122T113100Z.tlog",
    ):  # fmt: skip
        (tmp_path / log).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / log).write_text("of others")
        change(store, TRIAL, "id = 1", log=log, log_sha256=None)

        answer = foldcar("merge", "s.db", "s.db", "-o", "new/m.db")

        assert answer.returncode == 2 and "is not named as `foldcar log` names logs" in answer.stderr, log
        assert answer.stderr.count("\n") == 1 and not list((tmp_path / "new").iterdir())
        assert any("is not named as" in finding for finding in check_store(store).findings)


def test_a_film_that_is_none_is_not_linked(tmp_path: Path, store: Path, foldcar: Any) -> None:
    change(store, MEDIA, "trial_id = 1", file="/etc/passwd")

    answer = foldcar("report", "s.db", "-o", "r", "--simulated-trials")

    assert answer.returncode == 2 and 'file: "/etc/passwd" is neither a photo nor a film' in answer.stderr
    assert answer.stderr.count("\n") == 1 and not (tmp_path / "r").exists()


def test_a_store_that_sqlite_cannot_open_is_not_called_another_file(tmp_path: Path) -> None:
    # A store on a read-only file system whose last writer was stopped: SQLite cannot create the file s.db-shm.
    missing = f"{(tmp_path / 'missing' / 's.db').as_uri()}?mode=ro"
    with pytest.raises(StoreError) as refusal, store_errors(tmp_path / "s.db", "is not a foldcar store: "):
        sqlite3.connect(missing, uri=True).execute("SELECT 1")
    assert "s.db: cannot be opened" in str(refusal.value) and "the file s.db-wal" in str(refusal.value)
    assert "is not a foldcar store" not in str(refusal.value)
