"""Damage in a store: every flipped bit of a row is found and named, and no command answers it with a traceback."""

import contextlib
import random
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.errors import FoldcarError
from foldcar.store.check import check_store
from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file
from foldcar.store.migrations import VERSION
from foldcar.store.reader import Store
from foldcar.store.tables import TABLES, TRIAL
from foldcar.store.trial_writer import write_trials
from foldcar.store.writer import write_store
from old_stores import alter, change, old_store

# By table, what is changed there behind foldcar's back.
CHANGES = {
    "study": "value = value || '.'",
    "build": "name = 'other'",
    "body": "json = replace(json, '0', '1')",
    "scene": "json = replace(json, '0', '1')",
    "settings": "json = replace(json, '0', '1')",
    "variation": "json = '{\"a\":1}'",
    "environment": "dynamic = 7",
    "sample": "scene_id = 3 - scene_id",
    "spread": "fingerprint = 'x' || id",
    "draw": "variation_id = 1 + variation_id % 2",
    "experiment": "environments = 1",
    "design": "position = position + 50",
    "run": "max_roll_rad = coalesce(max_roll_rad, 0) + 1e-12",
    "recorded": "value = '0'",
    "path": "row_count = row_count + 1",
    "trial": "outcome = 'stuck'",
    "correction": "before = 1",
    "track": "start_s = start_s + 0.001",
    "media": "kind = 'photo'",
    "calibration": "created_utc = 'x'",
}


def raw(path: Path) -> Any:
    """All values of all rows without using any index, texts as bytes; None if SQLite cannot read them."""
    try:
        with contextlib.closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
            connection.text_factory = bytes
            return [connection.execute(f"SELECT * FROM {table.name} NOT INDEXED").fetchall() for table in TABLES]
    except (sqlite3.Error, UnicodeError):
        return None


def test_a_changed_value_is_named_with_table_and_key(store: Path) -> None:
    assert set(CHANGES) == {table.name for table in TABLES}
    for table, changed in CHANGES.items():
        alter(store, f"UPDATE OR IGNORE {table} SET {changed}")

    findings = check_store(store).findings

    named = [finding for finding in findings if finding.endswith(": does not match its checksum")]
    assert {finding.partition(" (")[0] for finding in named} == set(CHANGES), findings


def test_every_flipped_bit_of_a_row_is_found_and_no_damage_ends_in_a_traceback(
    store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(store.parent)
    sound, content, chance = store.read_bytes(), raw(store), random.Random(12)
    commands = (
        ["trials", "list", store], ["migrate", store],
        ["export", store, "--csv", "a.csv", "--trials", "t.csv", "--folder", "f"],
    )  # fmt: skip
    changed = refused = 0
    for number in range(160):
        damaged = bytearray(sound)
        for _ in range(20 if number % 8 == 7 else 1):
            damaged[chance.randrange(len(sound))] ^= 1 << chance.randrange(8)
        store.write_bytes(damaged)
        if raw(store) == content and number % 8 != 7:
            continue
        changed += 1
        try:
            found = check_store(store).findings
        except StoreError as error:
            found = [str(error)]
        assert found, f"damage {number}"
        if changed % 3 == 0:
            answer = CliRunner().invoke(app, [str(word) for word in commands[changed % 9 // 3]])
            assert isinstance(answer.exception, FoldcarError | None), answer.exc_info
            refused += answer.exception is not None
    # A fourth of the file is rows; the rest is free room, indexes and bookkeeping of SQLite.
    assert changed > 20 and refused > 0


def test_reports_refuse_damaged_rows_in_one_line(store: Path, foldcar: Any) -> None:
    alter(store, "UPDATE run SET outcome = 'pbssed' WHERE outcome = 'passed'")

    for words in (("report", "s.db", "-o", "out"), ("export", "s.db", "--csv", "-"), ("export", "s.db", "--folder", "f")):
        answer = foldcar(*words)
        assert answer.returncode == 2 and answer.stderr.count("\n") == 1
        assert answer.stderr.startswith("foldcar: error: s.db: run (build_id=1, body_id=1, scene_id=1,")
        assert "is damaged: it does not match its checksum; `foldcar check`" in answer.stderr
    checked = foldcar("check", "s.db")
    assert checked.returncode == 1 and checked.stdout.count("run (build_id=1, ") == 6
    assert checked.stdout.splitlines()[-1].startswith("s.db: 6 damaged; ")


def test_lost_references_views_and_indexes_are_found(store: Path, tmp_path: Path) -> None:
    alter(store, "DELETE FROM scene WHERE id = 1")
    alter(store, "DELETE FROM run WHERE outcome = 'passed'")
    findings = check_store(store).findings
    assert "table sample: 1 rows refer to rows of scene that are not there" in findings
    assert any(finding.startswith("table recorded: ") and "rows of run" in finding for finding in findings)

    old_store(VERSION, tmp_path / "v.db")
    alter(tmp_path / "v.db", "DROP VIEW result")
    alter(tmp_path / "v.db", "CREATE VIEW result AS SELECT * FROM run")
    assert check_store(tmp_path / "v.db").findings == [f"view result: is not declared as in version {VERSION}"]


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
def test_json_that_is_none_is_named_though_its_checksum_is_right(store: Path, foldcar: Any, column: str) -> None:
    change(store, TRIAL, "id = 1", **{column: "{"})

    answer = foldcar("trials", "list", "s.db")

    where = "foldcar: error: s.db: trial (id=1) is damaged"
    assert (answer.returncode, answer.stderr) == (2, f"{where}: its {column} is not what foldcar writes\n")


def test_logs_outside_of_the_folder_are_refused(tmp_path: Path, store: Path, foldcar: Any) -> None:
    (tmp_path / "s-logs" / "link").symlink_to("/etc/passwd")
    for log in ("../../etc/passwd", "/etc/passwd", "s-logs/../../x", "s-logs/link", "", "a\x00b"):
        change(store, TRIAL, "id = 1", log=log)

        with Store.open(store) as opened, pytest.raises(StoreError, match="leads out of the folder"):
            log_file(store, str(opened.trial(1).log))
        assert any("leads out of the folder" in finding for finding in check_store(store).findings)
    for words in (("trials", "export", "s.db", "1", "--mcap", "x.mcap"), ("export", "s.db", "--folder", "f")):
        answer = foldcar(*words)
        assert answer.returncode == 2 and "leads out of the folder" in answer.stderr, answer.stderr
        assert answer.stderr.count("\n") == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s-logs", "s.db"]


def test_what_was_not_read_is_not_blessed(store: Path) -> None:
    """A damaged row that is changed afterwards does not get a new checksum."""
    alter(store, "UPDATE trial SET operator = 'Eve' WHERE id = 1")

    with write_trials(store) as writer, pytest.raises(StoreError, match=r"trial \(id=1\) is damaged"):
        writer.correct(1, {"note": "n"}, "why", "")
    with write_store(store) as study, Store.open(store) as reader:
        assert study.texts("body", [1])[1]
        assert [t.id for t in reader.trials("nothing")] == []

    assert check_store(store).findings == ["trial (id=1): does not match its checksum"]
