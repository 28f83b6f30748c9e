"""One writer at a time, whatever name it comes by; a killed one leaves no trace."""

import contextlib
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.errors import StoreError
from foldcar.store.opening import writing
from foldcar.store.reader import Store
from foldcar.store.writer import write_store
from test_store import STUDY, fill

IN_USE = "another sweep or trial is writing this store"
HOLD = """
import sys, time
from pathlib import Path
from foldcar.store.writer import write_store
with write_store(Path(sys.argv[1])) as writer:
    writer.begin_study({"command": "held"}, "b9")
    print("held", flush=True)
    time.sleep(600)
"""
TRY = """
import sys
from pathlib import Path
from foldcar.store.writer import write_store
with write_store(Path(sys.argv[1])):
    print("written")
"""


@pytest.fixture
def store(tmp_path: Path) -> Path:
    fill(tmp_path / "s.db")
    return tmp_path / "s.db"


def names_of(store: Path) -> list[Path]:
    """The store's name, a symbolic link and a hard link in another folder."""
    other = store.parent / "other"
    other.mkdir()
    (other / "soft.db").symlink_to(store)
    (other / "hard.db").hardlink_to(store)
    return [store, other / "soft.db", other / "hard.db"]


@contextlib.contextmanager
def held(store: Path) -> Iterator["subprocess.Popen[str]"]:
    """Another process writes the store."""
    with subprocess.Popen([sys.executable, "-c", HOLD, store], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "held\n"
            yield process
        finally:
            process.kill()


def attempt(store: Path) -> str:
    """What another process says that writes the store."""
    answer = subprocess.run([sys.executable, "-c", TRY, store], capture_output=True, text=True, timeout=60)
    return answer.stdout or answer.stderr.splitlines()[-1]


def test_the_lock_is_the_file_s_whatever_its_name(store: Path) -> None:
    names = names_of(store)

    with held(store):
        for name in names:
            with pytest.raises(StoreError, match=IN_USE), writing(name):
                pass
    for name in names:
        with writing(name):
            assert all(IN_USE in attempt(other) for other in names)
        assert attempt(name) == "written\n"
    assert sorted(file.name for file in store.parent.iterdir()) == ["other", "s.db"]


def test_a_killed_writer_leaves_the_way_free(store: Path) -> None:
    with held(store) as process:
        process.send_signal(signal.SIGKILL)
        process.wait()

    with write_store(store) as writer:
        writer.begin_study(STUDY, "b1")
    with Store.open(store) as reader:
        assert reader.info().command == STUDY["command"]
    assert [file.name for file in store.parent.iterdir()] == ["s.db"]


def test_a_refused_attempt_takes_nothing_from_the_writer(store: Path) -> None:
    """Closing a descriptor of a file drops SQLite's locks on it in the same process."""
    with write_store(store) as writer:
        writer.begin_study(STUDY, "b1")
        with pytest.raises(StoreError, match=IN_USE), writing(store):
            pass
        change = "import sqlite3, sys; sqlite3.connect(sys.argv[1], timeout=0).execute('PRAGMA journal_mode = DELETE')"
        other = subprocess.run([sys.executable, "-c", change, store], capture_output=True, text=True, timeout=60)

        assert "database is locked" in other.stderr


def test_a_log_that_stands_beside_another_name_is_not_passed_over(store: Path) -> None:
    _, soft, hard = names_of(store)
    with held(store) as process:
        with Store.open(soft) as reader:
            assert reader.info().command == "held"
        with pytest.raises(StoreError, match="under another name"):
            Store.open(hard)
        process.send_signal(signal.SIGKILL)
        process.wait()

    assert store.with_name("s.db-wal").exists()
    for use in (lambda: contextlib.closing(Store.open(hard)._connection), lambda: writing(hard)):
        with pytest.raises(StoreError, match="a sweep was killed there: use that name first"), use():
            pass
    with writing(store):
        pass
    with Store.open(hard) as reader:
        assert reader.info().command == "held"
    with writing(hard):
        pass


def test_a_store_that_cannot_be_written_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "round.db"
    path.symlink_to("round.db")

    with pytest.raises(StoreError, match=r"round\.db: cannot be written: Too many levels"), writing(path):
        pass


def test_a_store_of_another_process_is_read_meanwhile(store: Path) -> None:
    with held(store), Store.open(store) as reader:
        assert len(list(reader.results())) == 4
        with pytest.raises(sqlite3.OperationalError):
            reader._connection.execute("DELETE FROM run")


# A program that is killed in the middle of a transaction without a write-ahead log, as `sqlite3` writes one.
KILLED = """
import os, signal, sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("PRAGMA cache_size = 1")
connection.execute("BEGIN IMMEDIATE")
connection.execute("CREATE TABLE more AS WITH RECURSIVE k (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM k WHERE n < 9999) "
                   "SELECT n, hex(randomblob(50)) FROM k")
connection.execute("DELETE FROM run")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_another_program_left_half_done_is_named_and_undone(store: Path, foldcar: Any) -> None:
    with Store.open(store) as reader:
        before = list(reader.results())
    subprocess.run([sys.executable, "-c", KILLED, store], timeout=60)
    assert store.with_name("s.db-journal").stat().st_size > 0

    for words in (("check", "s.db"), ("report", "s.db", "-o", "out")):
        answer = foldcar(*words)
        assert answer.returncode == 2
        assert answer.stderr == "foldcar: error: s.db: a program was killed while it wrote; " \
            "`foldcar migrate s.db` undoes what is half done\n"  # fmt: skip
    saved = foldcar("repair", "s.db", "-o", "w.db")
    assert foldcar("migrate", "s.db").returncode == 0

    for name in ("s.db", "w.db"):
        with Store.open(store.with_name(name)) as reader:
            assert list(reader.results()) == before
        assert foldcar("check", name).returncode == 0
    assert saved.returncode == 0
