"""A store of an older version: refused with the way out, migrated in place with a copy, never half.

There is no older version yet: the commands here are those of a foldcar of the version after this one.
"""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.migrations import VERSION
from old_stores import VERSIONS, alter, contents

# Its step gives every trial a note.
NEXT = """
import os, signal, sys
from foldcar.store import migrations
migrations.VERSION += 1
migrations.STEPS[migrations.VERSION - 1] = lambda connection: connection.execute("UPDATE trial SET note = 'stepped'")
{}
from foldcar.cli import main
main()
"""
KILLED_AFTER = """
real = migrations.{0}
def die(*arguments):
    real(*arguments)
    os.kill(os.getpid(), signal.SIGKILL)
migrations.{0} = die
"""


def run(folder: Path, program: str, *words: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)


def newer(folder: Path, *words: str, more: str = "") -> "subprocess.CompletedProcess[str]":
    return run(folder, NEXT.format(more), *words)


def version_of(path: Path) -> int:
    with closing(sqlite3.connect(path)) as connection:
        return int(connection.execute("PRAGMA user_version").fetchone()[0])


def test_there_is_a_store_of_every_version() -> None:
    assert list(range(1, VERSION + 1)) == VERSIONS


def test_every_row_survives_and_a_copy_stays(tmp_path: Path, store: Path) -> None:
    before = contents(store)
    content = store.read_bytes()
    (tmp_path / "s.version1.db").write_text("mine")
    for words in (("export", "s.db", "--csv", "-"), ("check", "s.db"), ("trials", "list", "s.db")):
        refused = newer(tmp_path, *words)
        assert refused.returncode == 2
        assert refused.stderr == "foldcar: error: s.db: is of version 1; `foldcar migrate s.db` brings it to 2\n"
    assert store.read_bytes() == content

    first, second = newer(tmp_path, "migrate", "s.db"), newer(tmp_path, "migrate", "s.db")

    assert first.stderr == "s.db: migrated from version 1 to 2; as it was: s.version1-2.db\n"
    assert (first.stdout, second.stdout, second.stderr) == ("s.db: version 2\n",) * 2 + ("",)
    assert contents(store) == {**before, "trial": [{**row, "note": "stepped"} for row in before["trial"]]}
    assert contents(tmp_path / "s.version1-2.db") == before and version_of(tmp_path / "s.version1-2.db") == 1
    assert (tmp_path / "s.version1.db").read_text() == "mine"
    assert newer(tmp_path, "check", "s.db").returncode == 0


def test_what_is_no_store_is_not_made_one(tmp_path: Path, foldcar: Any) -> None:
    (tmp_path / "empty.db").touch()

    assert foldcar("migrate", "empty.db").stderr == "foldcar: error: empty.db: is no foldcar store\n"
    assert foldcar("migrate", "none.db").stderr == "foldcar: error: none.db: no such store\n"
    assert [file.name for file in tmp_path.iterdir()] == ["empty.db"]


def test_views_and_tables_of_the_user_stay(tmp_path: Path, store: Path) -> None:
    alter(store, "CREATE VIEW passed AS SELECT * FROM run WHERE outcome = 'passed'")
    alter(store, "CREATE TABLE mine AS SELECT count(*) AS passed FROM passed")

    assert newer(tmp_path, "migrate", "s.db").returncode == 0

    with closing(sqlite3.connect(store)) as connection:
        (passed,) = connection.execute("SELECT count(*) FROM passed").fetchone()
        assert passed > 0 and connection.execute("SELECT passed FROM mine").fetchone() == (passed,)


@pytest.fixture
def big(store: Path) -> Path:
    """A store that is larger than what SQLite keeps in memory, so that a migration writes early."""
    with closing(sqlite3.connect(store)) as connection:
        row = connection.execute("SELECT * FROM recorded LIMIT 1").fetchone()
        value = json.dumps("x" * 1000)
        for number in range(6000):
            changed = (*row[:5], f"n{number}", row[6], value, 0)
            connection.execute("INSERT INTO recorded VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", changed)
        connection.commit()
    return store


@pytest.mark.parametrize("step", ["create_tables", "_rebuild"])
def test_a_migration_that_is_killed_leaves_the_old_store(tmp_path: Path, big: Path, step: str) -> None:
    before = contents(big)

    killed = newer(tmp_path, "migrate", "s.db", more=KILLED_AFTER.format(step))

    assert killed.returncode == -signal.SIGKILL, killed.stderr
    if step == "_rebuild":
        assert (tmp_path / "s.db-wal").stat().st_size > 1_000_000
    assert contents(big) == before and version_of(big) == 1
    assert newer(tmp_path, "migrate", "s.db").returncode == 0
    assert version_of(big) == 2 and len(contents(big)["recorded"]) == len(before["recorded"])
    assert sorted(file.name for file in tmp_path.glob("s.*")) == ["s.db", "s.version1-2.db", "s.version1.db"]


@pytest.mark.parametrize("share", [0.5, 1.05])
def test_a_full_disk_leaves_the_old_store(tmp_path: Path, big: Path, share: float) -> None:
    """The disk is full in the middle of the copy, or of the migration."""
    before, limit = contents(big), int(share * big.stat().st_size)

    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))"
    answer = newer(tmp_path, "migrate", "s.db", more=limited)

    assert answer.returncode == 2 and answer.stderr.count("\n") == 1, answer.stderr
    assert answer.stderr.startswith("foldcar: error: s.db: ")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s-logs", "s.db"]
    assert contents(big) == before and version_of(big) == 1


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("UPDATE run SET outcome = 'pbssed' WHERE scene_id = 1", "outcome: 'pbssed' is none of passed, "),
        ("UPDATE run SET max_roll_rad = x'00' WHERE scene_id = 1", "max_roll_rad: \"b'\\\\x00'\" is no number"),
        ("UPDATE design SET parameters = '{\"width_mm\": 95' || char(7)", "parameters: is no JSON"),
        ("UPDATE scene SET json = CAST(x'ff' AS TEXT) WHERE id = 1", "Could not decode to UTF-8"),
    ],
)
def test_a_damaged_old_store_is_left_as_it_is(tmp_path: Path, store: Path, statement: str, message: str) -> None:
    alter(store, statement)
    before = store.read_bytes()

    refused = newer(tmp_path, "migrate", "s.db")

    assert refused.returncode == 2 and refused.stderr.startswith("foldcar: error: s.db: ") and message in refused.stderr
    # The header counts changes and says which SQLite wrote.
    assert store.read_bytes()[100:] == before[100:]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s-logs", "s.db"]


@pytest.fixture
def slipping(tmp_path: Path, carsim_binary: Path) -> dict[str, str]:
    """An environment with a carsim that has a metric more."""
    told = json.loads(subprocess.run([carsim_binary, "metrics"], capture_output=True, check=True).stdout)
    more = [*told, {"name": "slip_m", "unit": "m", "optional": False, "help": "way slipped"}]
    program = tmp_path.with_name("slipping")
    program.write_text(f"#!/bin/sh\n[ \"$1\" = metrics ] || exec {carsim_binary} \"$@\"\necho '{json.dumps(more)}'\n")
    program.chmod(0o755)
    return {**os.environ, "FOLDCAR_CARSIM": str(program)}


def test_a_new_metric_of_carsim_comes_into_stores_by_itself(
    store: Path, slipping: dict[str, str], foldcar: Any, new_foldcar: Any
) -> None:
    before = contents(store)

    read = new_foldcar("export", "s.db", "--csv", "-", env=slipping)
    assert ",slip_m,message," in read.stdout and contents(store) == before
    for words in (("check",), ("migrate",), ("check",), ("repair", "-o", "w.db")):
        whole = new_foldcar(words[0], "s.db", *words[1:], env=slipping)
        assert whole.returncode == 0, whole.stdout
    assert new_foldcar("export", "s.db", "--csv", "-", env=slipping).stdout == read.stdout

    after = contents(store)
    assert [{**row, "slip_m": None} for row in before["run"]] == after["run"] == contents(store.with_name("w.db"))["run"]
    old = foldcar("export", "s.db", "--csv", "-")
    assert (old.returncode, old.stdout) == (2, "")
    assert old.stderr.startswith('foldcar: error: s.db: has the metric "slip_m", which this foldcar does not know')
