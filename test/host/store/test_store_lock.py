"""One writer at a time, whatever name it comes by; a killed one leaves no trace."""

import contextlib
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.connection import writing
from foldcar.store.errors import StoreError
from foldcar.store.reader import Store
from foldcar.store.writer import write_store
from test_store import fill
from written_study import FACTS

IN_USE = "another sweep or trial is writing this store"
HOLD = """
import sys, time
from pathlib import Path
from foldcar.store.writer import write_store
with write_store(Path(sys.argv[1])) as writer:
    writer.begin_study({"command": "held"}, "b9")
    print("waits", flush=True)
    time.sleep(600)
"""
TRY = """
import sys
from pathlib import Path
from foldcar.store.writer import write_store
with write_store(Path(sys.argv[1])) as writer:
    writer.begin_study({"command": "tried"}, "b9")
    print("written")
"""
# Another program that reads, without a write-ahead log, until its standard input ends.
READ = """
import sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("BEGIN")
connection.execute("SELECT count(*) FROM run").fetchone()
print("waits", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def store(tmp_path: Path) -> Path:
    fill(tmp_path / "s.db")
    return tmp_path / "s.db"


def linked(store: Path) -> Path:
    """A symbolic link to the store in another folder."""
    link = store.parent / "other" / "soft.db"
    link.parent.mkdir()
    link.symlink_to(store)
    return link


@contextlib.contextmanager
def another(program: str, store: Path) -> Iterator["subprocess.Popen[str]"]:
    """Another Python runs the program on the store, and has said that it is where it waits."""
    command = [sys.executable, "-c", program, store]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "waits\n"
            yield process
        finally:
            process.kill()


def writing_process(store: Path) -> contextlib.AbstractContextManager["subprocess.Popen[str]"]:
    """Another process writes the store."""
    return another(HOLD, store)


def attempt(store: Path) -> str:
    """What another process says that writes the store."""
    answer = subprocess.run([sys.executable, "-c", TRY, store], capture_output=True, text=True, timeout=60)
    return answer.stdout or answer.stderr.splitlines()[-1]


def test_the_lock_is_the_file_s_whatever_its_name(store: Path) -> None:
    names = [store, linked(store)]

    with writing_process(store):
        for name in names:
            with pytest.raises(StoreError, match=IN_USE), writing(name):
                pass
    for name in names:
        with writing(name):
            assert all(IN_USE in attempt(other) for other in names)
        assert attempt(name) == "written\n"
    assert sorted(file.name for file in store.parent.iterdir()) == ["other", "s.db"]


def test_a_killed_writer_leaves_the_way_free(store: Path) -> None:
    with writing_process(store) as process:
        process.send_signal(signal.SIGKILL)
        process.wait()

    with write_store(store) as writer:
        writer.begin_study(FACTS, "b1")
    with Store.open(store) as reader:
        assert reader.info().command == FACTS["command"]
    assert [file.name for file in store.parent.iterdir()] == ["s.db"]


def test_a_refused_attempt_takes_nothing_from_the_writer(store: Path) -> None:
    """Closing a descriptor of a file drops SQLite's locks on it in the same process."""
    with write_store(store) as writer:
        writer.begin_study(FACTS, "b1")
        with pytest.raises(StoreError, match=IN_USE), writing(store):
            pass
        change = "import sqlite3, sys; sqlite3.connect(sys.argv[1], timeout=0).execute('PRAGMA journal_mode = DELETE')"
        other = subprocess.run([sys.executable, "-c", change, store], capture_output=True, text=True, timeout=60)

        assert "database is locked" in other.stderr


def test_a_reader_keeps_no_writer_out_and_sees_one_moment(store: Path) -> None:
    with Store.open(store) as reader:
        assert attempt(store) == "written\n"

        assert reader.info().command == FACTS["command"]
        assert len(list(reader.results())) == 4
    with writing_process(store), Store.open(store) as reader:
        assert reader.info().command == "held"
        with pytest.raises(sqlite3.OperationalError):
            reader._connection.execute("DELETE FROM run")
    with writing(store):
        pass
    assert [file.name for file in store.parent.iterdir()] == ["s.db"]


def test_a_store_too_large_to_copy_is_read_where_it_is(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foldcar.store.connection.MAX_COPIED_BYTES", 0)
    with Store.open(store) as reader:
        assert len(list(reader.results())) == 4
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            reader._connection.execute("DELETE FROM run")


def test_a_writer_is_patient_with_another_program_and_then_says_so(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with another(READ, store) as other:
        command = [sys.executable, "-c", TRY, store]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            time.sleep(2)
            assert other.stdin is not None and writer.poll() is None
            other.stdin.close()
            assert writer.communicate(timeout=60)[0] == "written\n"
    monkeypatch.setattr("foldcar.store.connection.BUSY_S", 0.1)
    message = r"s\.db: is locked by another program; close that"
    with another(READ, store), pytest.raises(StoreError, match=message), write_store(store):
        pass


def test_where_there_is_no_shared_memory_a_store_is_written_with_a_journal(store: Path) -> None:
    shared = store.with_name("s.db-shm")
    shared.symlink_to(shared)

    with write_store(store) as writer:
        writer.begin_study({**FACTS, "command": "again"}, "b1")
        assert not store.with_name("s.db-wal").exists() or store.with_name("s.db-wal").stat().st_size == 0
    with Store.open(store) as reader:
        assert reader.info().command == "again"
        assert len(list(reader.results())) == 4


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


def test_what_another_program_left_half_done_is_undone(store: Path, foldcar: Any) -> None:
    with Store.open(store) as reader:
        before = list(reader.results())
    subprocess.run([sys.executable, "-c", KILLED, store], timeout=60)
    assert store.with_name("s.db-journal").stat().st_size > 0

    checked = foldcar("check", "s.db")

    assert checked.returncode == 0, checked.stderr
    with Store.open(store) as reader:
        assert list(reader.results()) == before
    assert [file.name for file in store.parent.iterdir()] == ["s.db"]
