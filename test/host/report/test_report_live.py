"""`report --live` and `sweep --live`: the page in a browser follows a sweep that is killed and resumed."""

import contextlib
import http.client
import json
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from browser import Tab
from foldcar.report.live import LiveStudy
from shell_signals import like_a_shell
from study_car import listing_of
from swept_listing import WriteListing, foldcar, stored_runs, swept

Command = Callable[..., "subprocess.CompletedProcess[str]"]
FOLDCAR = [sys.executable, "-c", "from foldcar.cli import main; main()"]
STATE = "document.getElementById('live')?.dataset.state"
# The page's own count of runs.
SHOWN = "(window.study?.e ? study.e.designs.runs.reduce((sum, one) => sum + one, 0) : 0)"
SELECTED = "[study.state.design, study.state.env, document.querySelector('#design h3').firstChild.data]"
SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


@contextlib.contextmanager
def started(*words: object) -> Iterator["subprocess.Popen[str]"]:
    command = [*FOLDCAR, *map(str, words)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=like_a_shell
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def url_of(line: str) -> str:
    match = re.search(r"http://127\.0\.0\.1:\d+/", line)
    assert match is not None, line
    return match[0]


def note_of(process: "subprocess.Popen[str]") -> str:
    """The address of the page of a sweep."""
    assert process.stderr is not None
    return url_of(next(line for line in process.stderr if "live page" in line))


# A minute of real time, as a browser and a sweep have it.
@pytest.mark.slow
def test_page_follows_a_sweep_that_is_killed_and_resumed(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    store = tmp_path / "s.db"
    words = ["sweep", write_listing(listing_data), "--store", store, "--environments", "20000", "--jobs", "1", "--live"]
    with started(*words, "--port", "0") as sweep:
        url = note_of(sweep)
        with Tab(url) as tab:
            tab.wait(f"{SHOWN} > 0 && {STATE} === 'running'")
            tab.ask("window.mark = 'not loaded again'; study.set({design: study.e.designs.name[1], env: 1})")
            tab.ask("for (const one of document.querySelectorAll('#belief .behind')) one.open = true; scrollTo(0, 700)")
            scrolled, first = tab.ask("scrollY"), tab.ask(SHOWN)
            selected = tab.ask(SELECTED)
            assert scrolled > 0
            tab.wait(f"{SHOWN} > {first}")

            assert tab.ask(SELECTED) == selected
            assert tab.ask("scrollY") == scrolled
            assert tab.ask("document.querySelector('#belief .behind').open")
            live_text = "document.querySelector('#live .told').textContent"
            tab.wait(rf"/ of 40,000 runs · about \S+ (s|min|h) left · changed/.test({live_text})")

            sweep.kill()
            assert tab.wait(f"['killed', 'gone'].includes({STATE}) && {STATE}")
            tab.wait(f"{STATE} === 'gone'")
            state = tab.ask("document.querySelector('#live .state').textContent")
            assert state == "Killed: the same command resumes it. The server has ended"
            stored = stored_runs(store)
            assert tab.ask(SHOWN) == stored
            port = url.rstrip("/").rpartition(":")[2]
            with started(*words, "--port", port) as resumed:
                assert note_of(resumed) == url
                tab.wait(f"{SHOWN} > {stored} && {STATE} === 'running'")
                assert tab.ask("window.mark") == "not loaded again"
                assert tab.ask("study.state.design") == selected[0]
                resumed.send_signal(signal.SIGINT)
                resumed.wait(60)
                assert resumed.stderr is not None
                errors = resumed.stderr.read()
                assert resumed.returncode == 130 and "\nstopped: " in f"\n{errors}", errors
                tab.wait(f"{STATE} === 'gone'")
                state = tab.ask("document.querySelector('#live .state').textContent")
                assert state == "Stopped: the same command resumes it. The server has ended"
                assert tab.ask(SHOWN) == stored_runs(store)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["listing.json", "s.db"]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A store of a sweep that stopped when it knew."""
    folder = tmp_path_factory.mktemp("live")
    listing = listing_of(SCENARIOS / "two_bumps.scenic", {"width": [80, 95, 245]}, timeout=60, environments=40)
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--until", "20pp")
    return folder / "s.db"


def test_report_live_answers_its_page_alone_and_changes_nothing(store: Path, carsim_binary: Path) -> None:
    with started("report", store, "--live", "--port", "0") as report:
        assert report.stdout is not None
        port = int(url_of(report.stdout.readline()).rstrip("/").rpartition(":")[2])

        def request(path: str, method: str = "GET", **headers: str) -> tuple[int, bytes]:
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
            connection.request(method, path, headers=headers)
            answer = connection.getresponse()
            return answer.status, answer.read()

        for status, path, method, headers in [
            (403, "/", "GET", {"Host": "evil.example"}),
            (403, "/study.json", "GET", {"Host": f"evil.example:{port}"}),
            (403, "/study.json", "GET", {"Host": ""}),
            (404, "/s.db", "GET", {}),
            (404, "/../s.db", "GET", {}),
            (501, "/", "POST", {}),
            (501, "/study.json", "PUT", {}),
            (501, "/", "DELETE", {}),
        ]:
            assert request(path, method, **headers)[0] == status, (path, method, headers)
        assert request("/", "HEAD") == (200, b"")
        assert request("/", Host=f"localhost:{port}")[1].startswith(b"<!doctype html>")
        # Other addresses of this machine are not served.
        with pytest.raises(OSError):
            socket.create_connection(("127.0.0.2", port), timeout=5)
        until = time.monotonic() + 120
        while (answer := json.loads(request("/study.json")[1]))["study"] is None:
            assert time.monotonic() < until
            time.sleep(0.1)
        assert answer["state"] == "done" and answer["planned"] == answer["done"] == stored_runs(store)
        assert (answer["designs"], answer["decided"], answer["error"]) == (3, 3, "")
        (experiment,) = answer["study"]["experiments"]
        assert sum(experiment["designs"]["runs"]) == stored_runs(store)
        # Who has this version is not sent it again.
        assert json.loads(request(f"/study.json?{answer['version']}")[1])["study"] is None
        report.send_signal(signal.SIGINT)
        _, errors = report.communicate(timeout=60)
    assert report.returncode == 130
    assert errors == f"foldcar: http://127.0.0.1:{port}/ is closed\n"


def test_data_are_made_only_when_the_store_has_changed(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    live = LiveStudy(tmp_path / "s.db")
    live.refresh()
    none = json.loads(live.poll(""))
    assert (none["state"], none["study"], none["done"]) == ("waiting", None, 0)

    listing = write_listing(listing_data)
    versions = []
    for environments in (1, 2):
        swept(listing, tmp_path / "s.db", carsim_binary, environments=environments)
        before = (tmp_path / "s.db").stat().st_mtime_ns
        for _ in range(2):
            live.refresh()
            versions.append(json.loads(live.poll(""))["version"])
        assert (tmp_path / "s.db").stat().st_mtime_ns == before
    assert versions[0] == versions[1] != versions[2] == versions[3]
    last = json.loads(live.poll(""))
    assert (last["done"], last["state"]) == (stored_runs(tmp_path / "s.db"), "done")

    (tmp_path / "s.db").write_bytes(b"no store" * 100)
    live.refresh()
    broken = json.loads(live.poll(versions[-1]))
    assert "not a foldcar store" in broken["error"] and broken["study"] is None and broken["done"] == last["done"]


def test_live_refuses_what_it_cannot_serve_by_one_line(
    foldcar: Command, new_foldcar: Command, store: Path, write_listing: WriteListing, listing_data: Any, tmp_path: Path
) -> None:
    new = tmp_path / "new.db"
    new.write_bytes(store.read_bytes())
    with contextlib.closing(sqlite3.connect(new)) as connection:
        connection.execute("PRAGMA user_version = 99")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        listing = write_listing(listing_data)
        for words, message in [
            (["report", store, "--live", "--port", str(port)], f"--port {port}"),
            (["sweep", listing, "--store", tmp_path / "n.db", "--live", "--port", str(port)], f"--port {port}"),
            (["sweep", listing, "--store", tmp_path / "n.db", "--port", "0"], "--live"),
            (["report", tmp_path / "none.db", "--live"], "no such store"),
            (["report", new, "--live"], "version 99"),
            (["report", store, "--live", "-o", tmp_path / "r"], "--live"),
            (["report", store], "-o DIR"),
        ]:
            done = (new_foldcar if words[0] == "sweep" else foldcar)(*words)
            assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
            assert message in done.stderr
    assert not (tmp_path / "n.db").exists()
