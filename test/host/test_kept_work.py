"""Work that its store does not take is kept in a file, and `foldcar import` takes it in."""

import dataclasses
import json
import signal
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.store.calibrations import Calibration, calibration_named
from foldcar.store.errors import StoreError
from foldcar.store.kept_work import keep_calibration, keep_trial, take_in
from foldcar.store.reader import Store
from foldcar.store.trial_records import RUNNING, Ending, Trial
from foldcar.store.trial_writer import TrialWriter, write_trials
from foldcar.trials.driving import DriveEnd
from foldcar.trials.session import record_outcome
from live_car import LOG, car_at_port, moving, trials_in
from test_store_lock import another, held
from test_trial_store import begin
from typist import Typist

# What a person entered after the first trial.
END = Ending("tipped", "goal", 12.5, "on the second step", "ab" * 32)
# A program that has begun to write and does not end, until its standard input does.
WRITE = """
import sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("BEGIN IMMEDIATE")
print("waits", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """A store with a trial that has begun."""
    with write_trials(tmp_path / "s.db") as writer:
        assert begin(writer) == 1
    return tmp_path / "s.db"


def first(store: Path) -> Trial:
    with Store.open(store) as opened:
        return opened.trial(1)


def full(*arguments: Any) -> None:
    """Instead of a method that writes."""
    raise StoreError("s.db: database or disk is full")


def test_what_a_person_entered_is_kept_when_the_disk_is_full(
    begun: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], foldcar: Any
) -> None:
    log = begun.parent / "logs" / "t.tlog"
    log.parent.mkdir()
    log.write_bytes(b"log")
    with write_trials(begun) as writer, monkeypatch.context() as broken:
        broken.setattr(TrialWriter, "complete", full)
        with pytest.raises(StoreError) as caught:
            record_outcome(writer, 1, DriveEnd("goal", "passed", 12.5), log, "tipped", "on the second step", None)

    kept = begun.with_name("s.db.trial-1.json")
    assert f"trial 1 is kept in {kept}: `foldcar import {kept} --store {begun}` takes it in" in str(caught.value)
    assert "disk is full; trial 1 is kept in" in capsys.readouterr().err
    assert first(begun).ending == RUNNING
    taken = foldcar("import", kept, "--store", begun)
    assert (taken.returncode, taken.stdout) == (0, f"{begun}: trial 1: tipped\n")
    trial = first(begun)
    assert (trial.outcome, trial.ending, trial.elapsed_time_s) == ("tipped", "goal", 12.5)
    assert trial.note == "on the second step" and trial.log_sha256 is not None
    assert sorted(file.name for file in begun.parent.iterdir()) == ["logs", "s.db"]


def test_a_kept_trial_is_taken_in_once_and_only_by_its_store(begun: Path, foldcar: Any) -> None:
    kept = begun.with_name("s.db.trial-1.json")
    keep_trial(begun, 1, "logs/other.tlog", END)
    other = foldcar("import", kept, "--store", begun)
    assert other.returncode == 2 and "trial 1 is another one: its log is logs/t.tlog, not logs/other.tlog" in other.stderr
    keep_trial(begun, 1, "logs/t.tlog", END)
    content = kept.read_text()
    assert foldcar("import", kept, "--store", begun).returncode == 0 and not kept.exists()
    kept.write_text(content)
    again = foldcar("import", kept, "--store", begun)

    assert again.returncode == 2 and "trial 1 is complete already: tipped, goal" in again.stderr
    assert kept.read_text() == content and first(begun).log_sha256 == END.log_sha256


def test_a_file_that_is_no_kept_work_is_refused_in_one_line(begun: Path) -> None:
    file = begun.with_name("k.json")
    for text in ("{", "[]", '{"foldcar_kept_trial": 1}', '{"foldcar_kept_trial": NaN}', "\u0000"):
        file.write_text(text)
        with pytest.raises(FoldcarError, match=r"k\.json: is neither an exported folder nor work"):
            take_in(file, begun)


def test_where_no_file_can_be_written_the_text_itself_is_told(
    begun: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    begun.with_name("s.db.trial-1.json").mkdir()
    (tmp_path / "temporary").mkdir()
    told = keep_trial(begun, 1, "logs/t.tlog", END)
    assert f"kept in {tmp_path}/temporary/s.db.trial-1.json" in told

    (tmp_path / "temporary" / "s.db.trial-1.json").unlink()
    (tmp_path / "temporary" / "s.db.trial-1.json").mkdir()
    told = keep_trial(begun, 1, "logs/t.tlog", END)
    text = told.partition("takes it in:\n")[2]
    assert json.loads(text)["ending"] == dataclasses.asdict(END)


def test_a_calibration_whose_store_is_in_use_is_kept(begun: Path, foldcar: Any) -> None:
    made = Calibration("mine", "1", "b1", "2026-01-01T00:00:00+00:00", ({"track_m": 0.25},), {"seed": 1})
    kept = begun.with_name("s.db.calibration-mine.json")
    assert f"`foldcar import {kept} --store {begun}` takes it in" in keep_calibration(begun, made, False)
    with held(begun):
        refused = foldcar("import", kept, "--store", begun)
    assert refused.returncode == 2 and kept.exists()

    assert foldcar("import", kept, "--store", begun).stdout == f'{begun}: calibration "mine"\n'
    with Store.open(begun) as store:
        assert calibration_named(store, "mine") == made
    assert not kept.exists()


def test_a_trial_that_waits_for_another_program_is_kept_at_ctrl_c(
    tmp_path: Path, free_course: Path, foldcar: Any
) -> None:
    store = tmp_path / "s.db"
    with (
        car_at_port(goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person,
    ):
        person.watches_until(lambda: moving(tmp_path))
        with another(WRITE, store):
            person.sees("waiting for another program")
            person.process.send_signal(signal.SIGINT)
            person.sees("trial 1 is kept in")
            assert person.ends() == 130

    assert trials_in(store)[0].ending == RUNNING
    assert foldcar("import", "s.db.trial-1.json", "--store", "s.db").stdout == "s.db: trial 1: timeout\n"
    (trial,) = trials_in(store)
    assert (trial.outcome, trial.ending, trial.elapsed_time_s) == ("timeout", "time limit", pytest.approx(3, abs=0.05))
