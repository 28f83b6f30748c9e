"""Mistakes and accidents with cars, trials and their files: each ends in one true line, and nothing is lost unsaid."""

import hashlib
import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from browser import study_of
from foldcar.errors import FoldcarError
from foldcar.link.stream import open_stream
from foldcar.store.tables import BY_NAME
from foldcar.store.writer import canonical_json
from foldcar.trials.plugged_car import require_same_car
from forked_foldcar import original
from full_store import change, contents
from live_car import LOG, car_at_port, greeted, trials_in

Foldcar, Refused = Callable[..., "subprocess.CompletedProcess[str]"], Callable[..., str]


@pytest.fixture
def port(free_course: Path) -> Iterator[str]:
    """The port of a simulated car on the free course."""
    with car_at_port() as car:
        yield car.port


def log_and(folder: Path, port: str, accident: Callable[[], object]) -> tuple[int, str, str]:
    """Run `foldcar log`; the accident happens in its countdown."""
    words = [*LOG, "--port", port, "--yes", "--countdown", "2"]
    process = original().start(words, folder, {**os.environ, "PYTHONUNBUFFERED": "1"})
    process.stdin.close()
    sentence = ""
    while not sentence.startswith("Countdown"):
        sentence = process.stdout.readline()
        assert sentence, process.stderr.read()
    # The log is made after the line is printed.
    time.sleep(1.0)
    accident()
    output, errors = process.communicate()
    return process.wait(), output, errors


def test_another_car_than_at_the_beginning_of_a_session_is_refused(port: str) -> None:
    with greeted(port) as car:
        identity = car.identity()
        require_same_car(car, replace(identity, scene="another one"))
        for other in ({"hash": "feed"}, {"build": "beef"}, {"simulated": False}):
            with pytest.raises(FoldcarError, match=r"the car has changed from .* to w?.*: start a new session for it"):
                require_same_car(car, replace(identity, **other))


def test_a_store_that_is_replaced_while_it_is_written_is_told(tmp_path: Path, port: str) -> None:
    store = tmp_path / "s.db"

    def accident() -> None:
        store.rename(tmp_path / "moved.db")
        store.write_bytes(b"another file")

    code, output, errors = log_and(tmp_path, port, accident)

    assert code == 2, output
    assert "s.db: was deleted, moved or replaced while it was written" in errors and "Traceback" not in errors
    assert "1 trials" not in output
    assert store.read_bytes() == b"another file"
    assert list(tmp_path.glob("s-logs/*.tlog"))


def test_a_log_that_vanishes_is_told_and_the_trial_is_kept(tmp_path: Path, port: str) -> None:
    code, output, errors = log_and(tmp_path, port, lambda: [log.unlink() for log in tmp_path.glob("s-logs/*.tlog")])

    assert code == 2 and "Trial 1: passed (SIMULATED CAR); log: none" in output
    assert "was deleted or moved; trial 1 is stored without its log" in errors
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.log_sha256) == ("passed", None)


def test_a_logs_folder_that_is_a_file_is_named_before_the_drive(tmp_path: Path, port: str, foldcar: Foldcar) -> None:
    (tmp_path / "s-logs").touch()

    answer = foldcar(*LOG, "--port", port, "--yes", "--countdown", "0")

    assert (answer.returncode, answer.stderr) == (2, "foldcar: error: s-logs: not a folder\n")
    assert trials_in(tmp_path / "s.db") == []


def test_a_second_program_at_a_tcp_port_is_told_why(refused: Refused) -> None:
    with car_at_port(tcp=True) as car:
        first = open_stream(car.port)
        message = refused("params", "get", "--port", car.port)
        first.close()

    assert message == f"{car.port}: it closed the connection at once; another program may be using the car"


def test_a_scene_that_differs_from_the_swept_one_is_not_driven(
    tmp_path: Path, free_course: Path, port: str, foldcar: Foldcar, refused: Refused
) -> None:
    """As from a program that depends on more than the files that its fingerprint is of."""
    assert foldcar("sweep", "l.json", "--store", "s.db", "--jobs", "1").returncode == 0
    (row,) = [row for row in contents(tmp_path / "s.db")["scene"] if row["id"] == 1]
    scene = canonical_json(json.loads(row["json"]) | {"friction": 0.31})
    digest = hashlib.sha256(scene.encode()).hexdigest()
    change(tmp_path / "s.db", BY_NAME["scene"], "id = 1", json=scene, hash=digest)

    message = refused(*LOG, "--port", port, "--yes", "--sample", "0")

    assert message.startswith("free.scenic: sample 0 is another scene now than when it was first drawn")
    assert trials_in(tmp_path / "s.db") == []


def test_the_report_tells_trials_of_another_environment(
    tmp_path: Path, free_course: Path, port: str, foldcar: Foldcar
) -> None:
    assert foldcar("sweep", "l.json", "--store", "s.db", "--jobs", "1").returncode == 0
    assert foldcar(*LOG, "--port", port, "--yes", "--countdown", "0").returncode == 0
    assert foldcar("report", "s.db", "-o", "same", "--simulated-trials").returncode == 0
    text = (tmp_path / "free.scenic").read_text()
    (tmp_path / "other.scenic").write_text(text.replace("(1.0, 0)", "(0.7, 0)"))
    free_course.write_text(free_course.read_text().replace("free.scenic", "other.scenic"))

    assert foldcar("sweep", "l.json", "--store", "s.db", "--jobs", "1").returncode == 0
    assert foldcar("report", "s.db", "-o", "other", "--simulated-trials").returncode == 0

    sentence = "1 trial left out: driven in free.scenic, not in other.scenic."
    same, other = ([e["remarks"] for e in study_of(tmp_path / name)["experiments"]] for name in ("same", "other"))
    assert sentence in other[0] and sentence not in same[0]


def test_a_link_lost_before_the_start_has_no_time_of_an_earlier_trial(
    tmp_path: Path, free_course: Path, foldcar: Foldcar
) -> None:
    with car_at_port() as car:
        # The car's last trial is number 1, as the first of the next store is.
        assert foldcar(*LOG[:-1], "first.db", "--port", car.port, "--yes", "--countdown", "0").returncode == 0
        code, _, errors = log_and(tmp_path, car.port, car.process.kill)

    assert code == 2 and "connection is lost" in errors
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending, trial.elapsed_time_s) == ("aborted", "link lost", None), trial.ending
