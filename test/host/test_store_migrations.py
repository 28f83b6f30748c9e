"""Stores of every version so far: read without being changed, migrated in place with a copy, never half."""

import contextlib
import json
import math
import resource
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.check import check_store
from foldcar.store.errors import StoreError
from foldcar.store.migrations import VERSION
from foldcar.store.opening import writing
from foldcar.store.reader import Store
from old_stores import VERSIONS, contents, old_store

OLDER = [version for version in VERSIONS if version < VERSION]


def version_of(path: Path) -> int:
    with contextlib.closing(sqlite3.connect(path)) as connection:
        (version,) = connection.execute("PRAGMA user_version").fetchone()
    return int(version)


def shown(path: Path) -> list[Any]:
    with Store.open(path) as store:
        return [store.info(), list(store.results()), [(t, store.corrections(t.id)) for t in store.trials()]]


def test_there_is_a_store_of_every_version() -> None:
    assert list(range(1, VERSION + 1)) == VERSIONS


@pytest.mark.parametrize("version", OLDER)
def test_every_row_survives(tmp_path: Path, version: int) -> None:
    path = old_store(version, tmp_path / "s.db")
    before = contents(path)

    with writing(path):
        pass

    after = contents(path)
    assert version_of(path) == VERSION
    assert set(after) >= set(before)
    for table, rows in before.items():
        kept = [{name: row[name] for name in rows[0]} for row in after[table]] if rows else after[table]
        if table == "experiment":
            # Only the facts of version 1 gain some.
            assert [json.loads(row.pop("facts")).items() <= json.loads(new.pop("facts")).items()
                    for row, new in zip(rows, kept, strict=True)] == [True] * len(rows)  # fmt: skip
        assert kept == rows, table
    assert check_store(path).findings == []
    assert contents(tmp_path / f"s.version{version}.db") == {**before, "experiment": contents(
        old_store(version, tmp_path / "again.db"))["experiment"]}  # fmt: skip


@pytest.mark.parametrize("version", OLDER)
def test_reading_shows_the_same_before_and_after_and_changes_nothing(tmp_path: Path, version: int) -> None:
    path = old_store(version, tmp_path / "s.db")
    before = path.read_bytes()

    as_it_was = shown(path)

    assert path.read_bytes() == before
    assert {file.name for file in tmp_path.iterdir()} - {"s-logs"} == {"s.db"}
    with writing(path):
        pass
    assert shown(path) == as_it_was
    info, results, _ = as_it_was
    assert sum(experiment.stored_runs for experiment in info.experiments.values()) == len(results) > 0
    assert {experiment.planned_runs - experiment.stored_runs for experiment in info.experiments.values()} == {0}


def test_trials_with_their_trail_and_logs_come_out_of_version_3(tmp_path: Path) -> None:
    path = old_store(3, tmp_path / "s.db")
    with writing(path):
        pass

    with Store.open(path) as store:
        trials, trail = list(store.trials()), store.corrections(1)
        drive = store.trial_drive(1)

    assert [(t.outcome, t.ending, t.corrections, t.source) for t in trials] == [
        ("tipped", "goal", 3, None),
        ("aborted", "goal", 0, None),
        ("passed", "imported", 0, "a paper"),
        ("passed", "imported", 0, "a paper"),
        ("not_passed", "imported", 0, "a paper"),
    ]
    assert [(c.field, c.before, c.after) for c in trail[::2]] == [("outcome", "passed", "tipped"), ("note", "first", "")]
    assert trail[1].before == pytest.approx(0.420834) and trail[1].after == trials[0].elapsed_time_s == 0.4
    assert trials[0].deviations["A"] == pytest.approx((0.005, -0.003, math.radians(1.5)))
    assert drive is not None and all(isinstance(json.loads(text), dict) for text in drive)
    assert check_store(path).logs == 2


def test_the_command_says_where_the_copy_is_and_overwrites_none(tmp_path: Path, foldcar: Any) -> None:
    old_store(3, tmp_path / "s.db")
    (tmp_path / "s.version3.db").write_text("mine")

    first, second = foldcar("migrate", "s.db"), foldcar("migrate", "s.db")

    assert first.stderr == f"s.db: migrated from version 3 to {VERSION}; as it was: s.version3-2.db\n"
    assert (first.stdout, second.stdout, second.stderr) == (f"s.db: version {VERSION}\n",) * 2 + ("",)
    assert (tmp_path / "s.version3.db").read_text() == "mine"
    assert version_of(tmp_path / "s.version3-2.db") == 3
    assert foldcar("migrate", "none.db").returncode == 2 and not (tmp_path / "none.db").exists()


def test_views_and_tables_of_the_user_stay(tmp_path: Path) -> None:
    path = old_store(3, tmp_path / "s.db")
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE VIEW passed AS SELECT * FROM run WHERE outcome = 'passed'")
        connection.execute("CREATE TABLE mine AS SELECT 7 AS seven")
        (passed,) = connection.execute("SELECT count(*) FROM passed").fetchone()
        connection.commit()

    with writing(path):
        pass

    with contextlib.closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT count(*) FROM passed").fetchone() == (passed,) and passed > 0
        assert connection.execute("SELECT seven FROM mine").fetchone() == (7,)


def big(path: Path) -> Path:
    """A store of version 3 that is larger than what SQLite keeps in memory, so that a migration writes early."""
    old_store(3, path)
    with contextlib.closing(sqlite3.connect(path)) as connection:
        row = connection.execute("SELECT * FROM recorded LIMIT 1").fetchone()
        value = json.dumps("x" * 1000)
        for number in range(6000):
            changed = (*row[:5], f"n{number}", row[6], value)
            connection.execute("INSERT INTO recorded VALUES (?, ?, ?, ?, ?, ?, ?, ?)", changed)
        connection.commit()
    return path


MIGRATE = "from foldcar.store import migrations; from foldcar.cli import main; import os, signal, sys\n{}\nmain()"
KILLED_AFTER = """
real = migrations.{0}
def die(*arguments):
    real(*arguments)
    os.kill(os.getpid(), signal.SIGKILL)
migrations.{0} = die
"""


@pytest.mark.parametrize("step", ["create_tables", "_rebuild"])
def test_a_migration_that_is_killed_leaves_the_old_store(tmp_path: Path, step: str) -> None:
    path = big(tmp_path / "s.db")
    before = contents(path)

    command = [sys.executable, "-c", MIGRATE.format(KILLED_AFTER.format(step)), "migrate", "s.db"]
    killed = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120)

    assert killed.returncode == -signal.SIGKILL, killed.stderr
    if step == "_rebuild":
        assert (tmp_path / "s.db-wal").stat().st_size > 1_000_000
    assert contents(path) == before and version_of(path) == 3
    with writing(path):
        pass
    assert version_of(path) == VERSION and len(contents(path)["recorded"]) == len(before["recorded"])
    assert sorted(file.name for file in tmp_path.glob("s.*")) == ["s.db", "s.version3-2.db", "s.version3.db"]


@pytest.mark.parametrize("share", [0.5, 1.05])
def test_a_full_disk_leaves_the_old_store(tmp_path: Path, share: float) -> None:
    """The disk is full in the middle of the copy, or of the migration."""
    path = big(tmp_path / "s.db")
    before, limit = contents(path), int(share * path.stat().st_size)

    answer = subprocess.run(
        [sys.executable, "-c", MIGRATE.format(""), "migrate", "s.db"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip

    assert answer.returncode == 2 and answer.stderr.count("\n") == 1, answer.stderr
    assert answer.stderr.startswith("foldcar: error: s.db: ")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s-logs", "s.db"]
    assert contents(path) == before and version_of(path) == 3


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("UPDATE run SET outcome = 'pbssed' WHERE rowid_of", "outcome: 'pbssed' is none of passed, "),
        ("UPDATE run SET max_roll_rad = x'00' WHERE rowid_of", "max_roll_rad: \"b'\\\\x00'\" is no number"),
        ("UPDATE design SET parameters = '{\"width_mm\": 95' || char(7)", "parameters: is no JSON"),
        ("UPDATE scene SET json = CAST(x'ff' AS TEXT) WHERE id = 1", "Could not decode to UTF-8"),
    ],
)
def test_a_damaged_old_store_is_left_as_it_is(tmp_path: Path, statement: str, message: str) -> None:
    path = old_store(3, tmp_path / "s.db")
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute(statement.replace("rowid_of", "scene_id = 1 AND body_id = 1"))
        connection.commit()
    before = path.read_bytes()

    with pytest.raises(StoreError) as refused, writing(path):
        pass
    with pytest.raises(StoreError), Store.open(path):
        pass

    assert message in str(refused.value) and str(refused.value).startswith(f"{path}: ")
    assert contents_bytes(path) == contents_bytes_of(before, tmp_path)
    assert any(message in finding for finding in check_store(path).findings)
    assert not list(tmp_path.glob("*version*"))


def contents_bytes(path: Path) -> list[str]:
    """All rows with texts as bytes: some of them are no UTF-8."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.text_factory = bytes
        tables = [name.decode() for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return [repr(row) for table in tables for row in connection.execute(f"SELECT * FROM {table}")]


def contents_bytes_of(content: bytes, folder: Path) -> list[str]:
    copy = folder / "copy"
    copy.write_bytes(content)
    try:
        return contents_bytes(copy)
    finally:
        copy.unlink()


NEWER = """
import foldcar.simulation.results as results
results.METRICS += (results.Metric("slip_m", "m", "way slipped"),)
results.NUMBERS += ("slip_m",)
from foldcar.cli import main
main()
"""


def test_a_new_metric_comes_into_old_stores_by_itself(tmp_path: Path, foldcar: Any) -> None:
    path = old_store(VERSION, tmp_path / "s.db")
    before = contents(path)

    def newer(*words: str) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-c", NEWER, *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    read = newer("export", "s.db", "--csv", "-")
    assert ",max_pitch_rad,slip_m,message," in read.stdout and contents(path) == before
    assert newer("check", "s.db").returncode == 0
    assert newer("migrate", "s.db").returncode == 0
    assert newer("export", "s.db", "--csv", "-").stdout == read.stdout
    checked = newer("check", "s.db")
    assert checked.returncode == 0, checked.stdout

    after = contents(path)
    assert [{**row, "slip_m": None} for row in before["run"]] == after["run"] and version_of(path) == VERSION
    old = foldcar("export", "s.db", "--csv", "-")
    assert (old.returncode, old.stdout) == (2, "")
    assert old.stderr.startswith('foldcar: error: s.db: has the metric "slip_m", which this foldcar does not know')
    assert not list(tmp_path.glob("*version*"))
