"""`foldcar repair`: what is whole of a damaged store is saved as it was, what is lost is told."""

import contextlib
import json
import random
import shutil
import sqlite3
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.check import check_store
from foldcar.store.errors import StoreError
from foldcar.store.opening import writing
from foldcar.store.reader import Store
from foldcar.store.repair import repair_store
from foldcar.store.salvage import records
from foldcar.store.tables import DRAW, SAMPLE, TABLES
from foldcar.store.trial_writer import write_trials
from foldcar.store.writer import write_store
from old_stores import alter, contents
from test_store import fill

TEXT_BYTES = 30_000


def rows(path: Path) -> dict[str, Counter[str]]:
    """All rows of foldcar's tables, checksums included, as SQLite reads them."""
    with contextlib.closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        chosen = {table.name: ", ".join(["checksum", *(column.name for column in table.columns)]) for table in TABLES}
        return {name: Counter(map(repr, connection.execute(f"SELECT {c} FROM {name}"))) for name, c in chosen.items()}


def killed_session(store: Path) -> Path:
    """A copy of the store with the write-ahead log of a session that was killed after several transactions."""
    target = store.parent / "killed" / "s.db"
    target.parent.mkdir()
    with write_trials(store) as writer:
        for note in ("a", "b", "c"):
            writer.correct(1, {"note": note}, "why", "")
        for suffix in ("", "-wal"):
            shutil.copyfile(f"{store}{suffix}", f"{target}{suffix}")
    shutil.copytree(store.parent / "s-logs", target.parent / "s-logs")
    return target


def test_a_sound_store_is_saved_whole(store: Path, foldcar: Any) -> None:
    answer = foldcar("repair", "s.db", "-o", "w.db")

    assert (answer.returncode, answer.stderr) == (0, "")
    count = sum(saved.total() for saved in rows(store).values())
    assert answer.stdout == f"w.db: {count} rows saved, 8 of them runs, 5 trials\n"
    assert rows(store.with_name("w.db")) == rows(store)
    assert check_store(store.with_name("w.db")).findings == []


def test_pages_are_read_as_sqlite_reads_them(tmp_path: Path) -> None:
    """Every kind of cell, long texts on pages of their own, trees of several levels, pages that are free again."""
    chance, path = random.Random(3), tmp_path / "x.db"
    kinds = (
        lambda: None, lambda: chance.randint(-(2**63), 2**63 - 1) >> chance.randrange(64), lambda: chance.uniform(-1, 1),
        lambda: "ä" * chance.randrange(60), lambda: bytes(chance.randrange(60)),
        lambda: "x" * int(10 ** chance.uniform(2, 4.5)),
    )  # fmt: skip
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE t (a, b, c)")
        connection.execute("CREATE TABLE k (a PRIMARY KEY, b) WITHOUT ROWID")
        for number in range(3000):
            connection.execute("INSERT INTO t VALUES (?, ?, ?)", [chance.choice(kinds)() for _ in range(3)])
            connection.execute("INSERT INTO k VALUES (?, ?)", (number * 7 % 3001, chance.choice(kinds)()))
        connection.execute("DELETE FROM t WHERE rowid % 5 < 2")
        connection.commit()
        expected = [*connection.execute("SELECT rowid, a, b, c FROM t"), *connection.execute("SELECT NULL, a, b FROM k")]

    found = Counter(repr((rowid, *cells)) for rowid, cells in records(path.read_bytes()))

    assert Counter(map(repr, expected)) - found == Counter()


def test_what_refers_to_a_lost_row_is_lost_but_for_trials(store: Path, tmp_path: Path, foldcar: Any) -> None:
    before = contents(store)
    trial = before["trial"][0]
    alter(store, f"UPDATE scene SET json = json || ' ' WHERE id = {trial['scene_id']}")
    content = store.read_bytes()
    lost_runs = sum(row["scene_id"] == trial["scene_id"] for row in before["run"])

    answer = foldcar("repair", "s.db", "-o", "w.db", "--json")

    told = json.loads(answer.stdout)
    assert answer.returncode == 1 and store.read_bytes() == content
    (finding,) = told["findings"]
    assert finding == f"scene (id={trial['scene_id']}): does not match its checksum"
    assert told["dependent"].get("run", 0) == lost_runs
    whole = contents(tmp_path / "w.db")
    touched = [row["id"] for row in before["trial"] if row["scene_id"] == trial["scene_id"]]
    assert told["trials"] == [f"trial {number}: its scene is lost" for number in touched]
    for old, new in zip(before["trial"], whole["trial"], strict=True):
        assert new == ({**old, "scene_id": None} if old["id"] in touched else old)
    with Store.open(tmp_path / "w.db") as opened:
        last = opened.corrections(touched[0])[-1]
    assert (last.field, last.before, last.after, last.operator) == ("scene_id", trial["scene_id"], None, "foldcar repair")
    # What was left out does not come back.
    repair_store(tmp_path / "w.db", tmp_path / "again.db")
    assert rows(tmp_path / "again.db") == rows(tmp_path / "w.db")
    assert check_store(tmp_path / "w.db").findings == []


def test_samples_behind_a_lost_one_are_sampled_again(tmp_path: Path) -> None:
    fill(tmp_path / "s.db")
    alter(tmp_path / "s.db", "UPDATE sample SET checksum = 1 WHERE sample = 0")

    done = repair_store(tmp_path / "s.db", tmp_path / "w.db")

    assert len(done.findings) == 1 and done.missing == {"sample": 1} and done.dependent == {"sample": 1}
    # All runs stay: they are those of their scenes.
    assert done.saved["run"] == 4
    with write_store(tmp_path / "w.db") as writer:
        assert [writer.sample_count(*one) for one in ((SAMPLE, 1), (DRAW, 1), (SAMPLE, 2))] == [0, 2, 0]
    assert fill(tmp_path / "w.db") == 0
    assert contents(tmp_path / "w.db")["sample"] == contents(tmp_path / "s.db")["sample"]


def test_a_lost_experiment_gets_its_own_place_again(tmp_path: Path) -> None:
    for name in ("1", "2"):
        fill(tmp_path / "s.db", name=name)
    alter(tmp_path / "s.db", "UPDATE experiment SET vehicle = 'x' WHERE id = '1'")

    done = repair_store(tmp_path / "s.db", tmp_path / "w.db")
    for name in ("1", "2"):
        fill(tmp_path / "w.db", name=name)

    assert done.findings == ["experiment (id=1): does not match its checksum"] and done.dependent["design"] > 0
    with Store.open(tmp_path / "w.db") as opened:
        assert opened.experiment_ids() == ["1", "2"]
        assert len(list(opened.results("1"))) == len(list(opened.results("2"))) == 4


@pytest.mark.parametrize("place", [0, 4096])
def test_a_lost_schema_or_root_costs_no_trial(store: Path, tmp_path: Path, place: int) -> None:
    content = bytearray(store.read_bytes())
    content[place : place + 4096] = bytes(4096)
    store.write_bytes(content)

    done = repair_store(store, tmp_path / "w.db")

    assert not done.is_whole and done.saved["trial"] == 5
    with Store.open(tmp_path / "w.db") as opened:
        assert [(t.id, t.outcome) for t in opened.trials()] == [
            (1, "tipped"), (2, "aborted"), (3, "passed"), (4, "passed"), (5, "not_passed")
        ]  # fmt: skip


def test_whatever_is_damaged_nothing_else_is_saved_than_was_there(store: Path, tmp_path: Path) -> None:
    sound, content, chance = rows(store), store.read_bytes(), random.Random(8)
    emptied = 0
    for number in range(40):
        damaged = bytearray(content)
        for _ in range(chance.choice((1, 1, 30))):
            damaged[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        if number % 4 == 1:
            block = 4096 * chance.randrange(len(content) // 4096)
            damaged[block : block + 4096] = bytes(4096)
        if chance.random() < 0.3:
            del damaged[chance.randrange(30_000, len(content)) :]
        store.write_bytes(damaged)
        whole = tmp_path / f"w{number}.db"

        done = repair_store(store, whole)

        saved = rows(whole)
        emptied += len(done.trials)
        for table, kept in saved.items():
            allowed = {"trial": len(done.trials), "correction": 4 * len(done.trials)}.get(table, 0)
            assert (kept - sound[table]).total() <= allowed, f"damage {number}: {table}"
        assert (saved == sound) or not done.is_whole or not check_store(store).findings, f"damage {number}"
        assert check_store(whole).findings == []
        whole.unlink()
    assert emptied > 0


def test_damage_in_the_log_of_a_killed_session_is_no_silent_end(store: Path, foldcar: Any) -> None:
    with Store.open(store) as opened:
        before_session = opened.trial(1).note
    killed = killed_session(store)
    log = killed.with_name("s.db-wal")
    content = bytearray(log.read_bytes())
    # The second page that was written; each has a header of 24 bytes before it.
    content[32 + 4120 + 24 + 2000] ^= 4
    log.write_bytes(content)
    before = {file.name: file.read_bytes() for file in killed.parent.glob("s.db*")}

    checked = foldcar("check", killed)
    assert checked.returncode == 1 and "write-ahead log s.db-wal: frame 2 of " in checked.stdout
    for words in (("trials", "list", killed), ("migrate", killed), ("export", killed, "--csv", "-")):
        answer = foldcar(*words)
        assert answer.returncode == 2 and answer.stderr.count("\n") == 1
        assert answer.stderr.startswith(f"foldcar: error: {killed}: its write-ahead log s.db-wal: frame 2 of ")
    repaired = foldcar("repair", killed, "-o", "w.db")
    assert repaired.returncode == 1 and "write-ahead log: frame 2 of " in repaired.stdout
    assert {name: killed.with_name(name).read_bytes() for name in before} == before
    with Store.open(store.with_name("w.db")) as opened:
        # SQLite takes no transaction behind the damage.
        assert opened.trial(1).note == before_session


def test_the_torn_end_of_a_log_is_no_damage(store: Path) -> None:
    killed = killed_session(store)
    log = killed.with_name("s.db-wal")
    content = log.read_bytes()
    frames = (len(content) - 32) // 4120
    assert frames > 3
    log.write_bytes(content[: 32 + 4120 * (frames - 1) + 24 + 100])

    with writing(killed):
        pass

    assert check_store(killed).findings == []
    with Store.open(killed) as opened:
        assert opened.trial(1).note == "b"


def test_in_another_folder_the_logs_are_copied_and_that_of_a_lost_trial_is_named(store: Path, foldcar: Any) -> None:
    alter(store, "DELETE FROM correction WHERE trial_id = 1")
    alter(store, "DELETE FROM trial WHERE id = 1")

    checked, repaired = foldcar("check", "s.db"), foldcar("repair", "s.db", "-o", "other/w.db")

    assert checked.returncode == 1 and "its trial is missing" in checked.stdout
    assert repaired.returncode == 1
    assert "trial: 4 rows saved; lost: 1 missing\n" in repaired.stdout
    assert ".tlog: its trial is lost; the log is kept\n" in repaired.stdout
    other = store.parent / "other"
    assert check_store(other / "w.db").findings == []
    assert len(list((other / "s-logs").iterdir())) == len(list((store.parent / "s-logs").iterdir())) - 1


def test_what_cannot_be_repaired_is_refused_and_nothing_written(store: Path, tmp_path: Path) -> None:
    (tmp_path / "text.db").write_text("no store " * 100)
    names = sorted(file.name for file in tmp_path.iterdir())

    for damaged, whole, message in (
        ("text", "w", "text.db: no row of it is whole, or it is no foldcar store"),
        ("none", "w", "none.db: no such store"),
        ("s", "text", "text.db: is there already; name a new store"),
        ("s", "s", "s.db: is there already; name a new store"),
    ):
        with pytest.raises(StoreError, match=message):
            repair_store(tmp_path / f"{damaged}.db", tmp_path / f"{whole}.db")
    assert sorted(file.name for file in tmp_path.iterdir()) == names


def test_trials_are_on_the_disk_at_each_commit(store: Path) -> None:
    with write_trials(store) as writer:
        # 2 is FULL: SQLite synchronises the log with every transaction.
        assert writer._run("PRAGMA synchronous").fetchone() == (2,)
