"""`foldcar log` as a session: second thoughts, photos and films, answers that are tapped on a phone beside the course."""

import contextlib
import hashlib
import http.client
import json
import os
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from browser import Tab
from foldcar.store.check import check_store
from foldcar.store.merge import merge_stores
from foldcar.store.reader import Store
from foldcar.trials.drive_view import KEYS
from foldcar.trials.media import SETTLED_S, Arrivals
from foldcar.trials.person import Answers
from live_car import LOG, car_at_port, moving, trials_in
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
        assert person.ends() == 0, person.said

    assert "Trial 1: tipped" in person.said
    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.note, first.standing) == ("tipped", "wheel slipped; twice", "withdrawn")
    assert (second.outcome, second.standing, second.sample) == ("passed", "simulated", first.sample)
    with Store.open(tmp_path / "s.db") as opened:
        trail = [(c.trial, c.field, c.before, c.after, c.operator) for c in opened.corrections()]
    assert trail == [(1, "outcome", "passed", "tipped", "Ada"), (1, "withdrawn", 0, 1, "Ada")]
    summary = person.said[person.said.index("This session") :]
    assert "1 of 1 passed in experiment 1; 1 more trial aborted or withdrawn" in summary
    assert "was not swept in s.db" in summary


def test_a_late_or_second_tap_answers_nothing() -> None:
    taps, phone = os.pipe()
    answers = Answers(lambda: tapped(phone, answers.question["number"] - 1, "late"), taps)  # type: ignore[index]
    with answers.keys(KEYS) as pressed:
        assert pressed() is None
        tapped(phone, 7, "p")
        assert pressed() is None
        # To stop is never late.
        tapped(phone, 7, "s")
        assert pressed() == "s"
        number = answers.question["number"]  # type: ignore[index]
        tapped(phone, number, "p", number, "p")
        assert pressed() == "p" and pressed() is None
    os.close(phone)
    with answers.keys(KEYS) as pressed:
        assert pressed() is None and pressed() is None


def tapped(pipe: int, *said: Any) -> None:
    for question, answer in zip(said[::2], said[1::2], strict=True):
        os.write(pipe, (json.dumps({"question": question, "answer": answer}) + "\n").encode())


NOW = "(document.querySelector('#running .now')?.textContent || '')"


def tap(tab: Tab, person: Typist, label: str) -> None:
    """Wait for a button, then click it as a finger does."""
    button = f"[...document.querySelectorAll('#running .taps > button')].find(one => one.textContent === {label!r})"
    person.watches_until(lambda: tab.ask(f"Boolean({button}) && !{button}.disabled"))
    tab.ask(f"{button}.click()")


def test_a_phone_beside_the_course_drives_a_session(tmp_path: Path, free_course: Path) -> None:
    # Time enough for a busy machine's browser.
    free_course.write_text(free_course.read_text().replace('"timeout": 3', '"timeout": 60'))
    with (
        car_at_port(goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "1", "--lan") as person,
    ):
        said = person.sees("Measured deviations")
        found = re.search(r"live page: (http://([0-9.]+):(\d+)/\?(\S+))", said)
        assert found is not None and "█" in said
        url, host, port, token = found[1], found[2], int(found[3]), found[4]
        assert host != "127.0.0.1" and len(token) >= 32
        refuses_strangers(host, port, token)
        with Tab(url, 390, 844) as tab:
            person.watches_until(lambda: tab.ask(f"{NOW} === 'Put car and obstacles in place'"))
            assert "500, 600" not in tab.ask("document.querySelector('#running table').innerText")
            tap(tab, person, "All is in place")
            tap(tab, person, "Start")
            person.watches_until(lambda: tab.ask(f"{NOW}.startsWith('Driving')"))
            person.watches_until(lambda: moving(tmp_path))
            tab.picture(tmp_path / "driving.png")
            tap(tab, person, "Stop")
            person.sees("stopped by key")
            tap(tab, person, "off course")
            person.sees("Trial 1: off_course")
            tap(tab, person, "Other outcome")
            tap(tab, person, "stuck")
            person.watches_until(lambda: tab.ask(f"{NOW} === 'Trial 1: stuck'"))
            tab.ask("document.querySelector('#running .taps input').value = 'n it leans'")
            tab.ask("document.querySelector('#running .taps form').requestSubmit()")
            person.sees("Trial 1: it leans")
            tab.picture(tmp_path / "after.png")
            tap(tab, person, "End")
            assert person.ends() == 0, person.said

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending, trial.note) == ("stuck", "stopped by key", "it leans")


def refuses_strangers(host: str, port: int, token: str) -> None:
    """Nobody without the token gets anything, and no other site's page posts with it."""
    own = {"X-Foldcar-Token": token, "Origin": f"http://{host}:{port}", "Content-Type": "application/json"}
    body = json.dumps({"question": 1, "answer": "q"})

    def asked(method: str, path: str, headers: dict[str, str]) -> int:
        connection = http.client.HTTPConnection(host, port, timeout=60)
        connection.request(method, path, body if method == "POST" else None, headers)
        return connection.getresponse().status

    wrong = ("x" if token[0] != "x" else "y") + token[1:]
    for method, path, headers in [
        ("GET", "/", {}),
        ("GET", f"/?{wrong}", {}),
        ("GET", f"/?{token}x", {}),
        ("GET", "/study.json", {}),
        ("GET", f"/study.json?{token}", {}),
        ("GET", f"/?{token}", {"Host": f"evil.example:{port}"}),
        ("POST", "/tap", own | {"X-Foldcar-Token": wrong}),
        ("POST", f"/tap?{token}", {name: value for name, value in own.items() if name != "X-Foldcar-Token"}),
        ("POST", "/tap", own | {"Origin": "http://evil.example"}),
        ("POST", "/tap", {name: value for name, value in own.items() if name != "Origin"}),
    ]:
        assert asked(method, path, headers) == 403, (method, path, headers)
    assert asked("GET", f"/?{token}", {}) == 200
    # The loopback address is not served.
    with pytest.raises(OSError):
        http.client.HTTPConnection("127.0.0.1", port, timeout=5).request("GET", f"/?{token}")


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
        yield
    finally:
        stop.set()
        thread.join()


def test_photos_and_films_belong_to_their_trials(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    folder = tmp_path / "phone"
    assert "--media phone: is no folder" in foldcar(*LOG, "--media", "phone").stderr
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
            person.sees("waiting for drive.mp4")
        film = (folder / "drive.mp4").read_bytes()
        assert person.ends() == 0, person.said

    store = tmp_path / "s.db"
    with Store.open(store) as opened:
        found = {one.file: (one.trial, one.kind, one.sha256) for one in opened.media()}
    assert found == {
        "extra.png": (1, "photo", hashlib.sha256(b"extra").hexdigest()),
        "phone/drive.mp4": (1, "film", hashlib.sha256(film).hexdigest()),
    }
    (folder / "drive.mp4").rename(folder / "moved.mp4")
    assert "trial 1: film phone/drive.mp4 (missing)\n" in foldcar("trials", "list", "s.db").stdout
    track = foldcar("track", "--trial", "1", "--store", "s.db")
    assert (track.returncode, track.stderr) == (
        2, "foldcar: error: phone/drive.mp4: no such file, which trial 1 of s.db names\n",
    )  # fmt: skip
    (folder / "drive.mp4").write_bytes(b"another")
    assert "its SHA-256 is another" in foldcar("track", "--trial", "1", "--store", "s.db").stderr
    (folder / "moved.mp4").replace(folder / "drive.mp4")
    assert "phone/drive.mp4: is no film that can be read" in foldcar("track", "--trial", "1", "--store", "s.db").stderr
    # In a store elsewhere the files are the same ones.
    (tmp_path / "m").mkdir()
    merge_stores([store], tmp_path / "m" / "s.db")
    with Store.open(tmp_path / "m" / "s.db") as opened:
        assert {one.file for one in opened.media()} == {str(tmp_path.resolve() / name) for name in found}
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
