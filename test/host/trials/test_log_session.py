"""`foldcar log` as a session: second thoughts, photos and films."""

import contextlib
import hashlib
import json
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.check import check_store
from foldcar.store.merge import merge_stores
from foldcar.store.reader import Store
from foldcar.trials.media import SETTLED_S, Arrivals
from live_car import LOG, car_at_port, trials_in
from typist import Typist


def test_second_thoughts_are_kept_at_once(tmp_path: Path, free_course: Path) -> None:
    with (
        car_at_port() as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--operator", "Ada", "--trials", "1") as person,
    ):
        person.answers(("deviation: ", ""), ("Enter starts", ""), ("Outcome:", ""), ("Enter: next", "u"))
        person.answers(("[passed]: ", "t"), ("Enter: next", "n wheel slipped"), ("Enter: next", "n twice"))
        person.answers(("Enter: next", "x"), ("type Enter, u, r, q", "r"), ("(w)ithdrawn", "w"))
        person.sees("Trial 2: sample 0")
        person.answers(("A stays", ""), ("Enter starts", ""), ("Outcome:", ""), ("Enter: next", "r"), ("(w)ithdrawn", ""))
        person.answers(("deviation: ", ""), ("Enter starts", "q"))
        assert person.ends() == 0, person.output

    assert "Trial 1: tipped" in person.output
    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.note, first.standing) == ("tipped", "wheel slipped; twice", "withdrawn")
    assert (second.outcome, second.standing, second.sample) == ("passed", "simulated", first.sample)
    with Store.open(tmp_path / "s.db") as opened:
        trail = [(c.trial, c.field, c.before, c.after, c.operator) for c in opened.corrections()]
    assert trail == [(1, "outcome", "passed", "tipped", "Ada"), (1, "withdrawn", 0, 1, "Ada")]
    summary = person.output[person.output.index("This session") :]
    assert "1 of 1 passed in experiment 1; 1 more trial aborted or withdrawn" in summary
    assert "was not swept in s.db" in summary


@contextlib.contextmanager
def growing(file: Path) -> Iterator[None]:
    """Within the block a file grows, as a network brings it."""
    stop = threading.Event()

    def grow() -> None:
        with file.open("wb", buffering=0) as film:
            while not stop.wait(SETTLED_S / 8):
                film.write(b"frame")

    thread = threading.Thread(target=grow)
    thread.start()
    try:
        while not file.exists() or not file.stat().st_size:
            time.sleep(0.01)
        yield
    finally:
        stop.set()
        thread.join()


def test_photos_and_films_belong_to_their_trials(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    folder = tmp_path / "phone"
    assert "--media phone: not a folder" in foldcar(*LOG, "--media", "phone").stderr
    folder.mkdir()
    (folder / "before.jpg").write_bytes(b"before")
    with (
        car_at_port() as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--media", folder) as person,
    ):
        person.answers(("deviation: ", ""), ("Enter starts", ""), ("Outcome:", ""))
        (folder / ".copying.mp4").write_bytes(b"half")
        (folder / "list.txt").write_bytes(b"no film")
        (tmp_path / "extra.png").write_bytes(b"extra")
        person.answers(("Enter: next", "m nothing.mp4"), ("nothing.mp4: no such file", "m free.scenic"))
        person.answers(("neither a photo nor a film", "m extra.png"))
        person.sees("Trial 1: photo extra.png")
        with growing(folder / "drive.mp4"):
            person.answers(("Enter: next", "q"))
            person.sees("waiting until drive.mp4")
        film = (folder / "drive.mp4").read_bytes()
        assert person.ends() == 0, person.output

    store = tmp_path / "s.db"
    with Store.open(store) as opened:
        media = {medium.file: (medium.trial, medium.kind, medium.sha256) for medium in opened.media()}
    assert media == {
        "extra.png": (1, "photo", hashlib.sha256(b"extra").hexdigest()),
        "phone/drive.mp4": (1, "film", hashlib.sha256(film).hexdigest()),
    }
    (folder / "drive.mp4").rename(folder / "moved.mp4")
    assert "trial 1: film phone/drive.mp4 (missing)\n" in foldcar("trials", "list", "s.db").stdout
    # In a store elsewhere the files are the same ones.
    (tmp_path / "m").mkdir()
    merge_stores([store], tmp_path / "m" / "s.db")
    with Store.open(tmp_path / "m" / "s.db") as opened:
        assert {medium.file for medium in opened.media()} == {str(tmp_path.resolve() / name) for name in media}
    assert check_store(tmp_path / "m" / "s.db").findings == []


def test_a_file_belongs_to_the_trial_when_it_was_last_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foldcar.trials.media.SETTLED_S", 0.0)
    arrivals = Arrivals(tmp_path)
    arrivals.begin(4)
    begun_s = time.time()
    time.sleep(0.05)
    arrivals.begin(5)
    for name, time_s in {"late.mp4": begun_s + 0.01, "now.mp4": begun_s + 10, "clockless.mp4": begun_s - 1e6}.items():
        (tmp_path / name).write_bytes(b"film")
        os.utime(tmp_path / name, (time_s, time_s))

    assert {file.name: trial for trial, file in arrivals.take()} == {"late.mp4": 4, "now.mp4": 5, "clockless.mp4": 5}
    assert arrivals.take() == []


def test_a_file_with_a_time_in_the_future_is_whole_when_it_was_seen_to_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("foldcar.trials.media.SETTLED_S", 0.2)
    arrivals, film = Arrivals(tmp_path), tmp_path / "drive.mp4"
    arrivals.begin(1)
    for size in (1, 2, 3):
        film.write_bytes(bytes(size))
        os.utime(film, (time.time() + 3600,) * 2)
        assert arrivals.growing() == [film] and arrivals.take() == []
        time.sleep(0.1)
    time.sleep(0.15)

    assert arrivals.take() == [(1, film)]


def test_an_experiments_name_may_have_a_slash(tmp_path: Path, free_course: Path) -> None:
    data = json.loads(free_course.read_text())
    data["experiments"] = {"a/b": data["experiments"]["1"]}
    free_course.write_text(json.dumps(data))
    words = [word if word != "1" else "a/b" for word in LOG]
    with car_at_port() as car, Typist(tmp_path, *words, "--port", car.port, "--countdown", "0") as person:
        person.answers(("deviation: ", ""), ("Enter starts", "q"))
        assert person.ends() == 0, person.output

    (picture,) = (tmp_path / "s-logs").glob("place-a_b_*-0.png")
    assert picture.name in person.output


def test_a_trial_with_deviations_keeps_its_sample_although_a_file_was_added_beside_the_program(
    tmp_path: Path, free_course: Path, foldcar: Any
) -> None:
    sweep = ("sweep", "l.json", "--store", "s.db", "--realities", "0")
    assert foldcar(*sweep).returncode == 0
    # The program might import it, so its environment is another one. Its samples are the same.
    (tmp_path / "analysis.py").write_text("X = 1\n")
    with car_at_port() as car:
        words = ("--port", car.port, "--countdown", "0", "--yes", "--sample", "1", "--deviation", "A 5 -3 1.5")
        assert foldcar(*LOG, *words).returncode == 0
    (trial,) = trials_in(tmp_path / "s.db")
    assert trial.deviations

    for _ in range(2):
        (experiment,) = json.loads(foldcar("compare", "s.db", "--simulated-trials", "--json").stdout)["experiments"]
        assert [design["trials"] for design in experiment["designs"]] == [1]
        assert not any("left out" in remark for remark in experiment["remarks"])
        # The next sweep stores the samples of the new environment.
        assert foldcar(*sweep).stdout.startswith("0 new runs")
    assert foldcar("check", "s.db").returncode == 0
