"""Mistakes and accidents with cars, trials and their files: each ends in one true line, and nothing is lost unsaid."""

import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.link.stream import open_stream
from foldcar.store.reader import Store
from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import write_trials
from foldcar.trials.placement import ask_deviations
from forked_foldcar import original
from live_car import LOG, car_at_port, trials_in
from test_trial_store import begin

Foldcar = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def port(carsim_binary: Path, free_course: Path) -> Iterator[str]:
    """The port of a simulated car on the free course."""
    with car_at_port(carsim_binary) as car:
        yield car.port


def refused(answer: "subprocess.CompletedProcess[str]") -> str:
    """The one line of a refusal."""
    lines = [line for line in answer.stderr.splitlines() if line]
    assert answer.returncode == 2 and len(lines) == 1 and lines[0].startswith("foldcar: error: "), answer.stderr
    return lines[0].removeprefix("foldcar: error: ")


def log_and(folder: Path, port: str, accident: Callable[[], object]) -> tuple[int, str, str]:
    """Run `foldcar log`; the accident happens in its countdown."""
    words = [*LOG, "--port", port, "--yes", "--countdown", "2"]
    process = original().start(words, folder, {**os.environ, "PYTHONUNBUFFERED": "1"})
    process.stdin.close()
    said = ""
    while not said.startswith("Countdown"):
        said = process.stdout.readline()
        assert said, process.stderr.read()
    # The log is made after the line is printed.
    time.sleep(1.0)
    accident()
    output, errors = process.communicate()
    return process.wait(), output, errors


@pytest.mark.parametrize("replaced", [False, True])
def test_a_store_that_vanishes_while_it_is_written_is_told(tmp_path: Path, port: str, replaced: bool) -> None:
    store = tmp_path / "s.db"

    def accident() -> None:
        store.rename(tmp_path / "moved.db")
        if replaced:
            store.write_bytes(b"another file")

    code, output, errors = log_and(tmp_path, port, accident)

    assert code == 2, output
    assert "s.db: was deleted, moved or replaced while it was written" in errors and "Traceback" not in errors
    assert "1 trials" not in output
    assert store.read_bytes() == b"another file" if replaced else not store.exists()
    assert list(tmp_path.glob("s-logs/*.tlog"))


def test_a_log_that_vanishes_is_told_and_the_trial_is_kept(tmp_path: Path, port: str) -> None:
    code, output, errors = log_and(tmp_path, port, lambda: [log.unlink() for log in tmp_path.glob("s-logs/*.tlog")])

    assert code == 2 and "Trial 1: passed (SIMULATED CAR); log: none" in output
    assert "is gone: it was deleted or moved; trial 1 is stored without its log" in errors
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.log_sha256) == ("passed", None)


def test_a_logs_folder_that_is_a_file_is_named_before_the_drive(tmp_path: Path, port: str, foldcar: Foldcar) -> None:
    (tmp_path / "s-logs").touch()

    assert refused(foldcar(*LOG, "--port", port, "--yes", "--countdown", "0")) == "s-logs: not a folder"
    assert trials_in(tmp_path / "s.db") == []


def test_a_parameter_file_is_not_called_equal_unless_it_was_compared(tmp_path: Path, port: str, foldcar: Foldcar) -> None:
    (tmp_path / "typo.parm").write_text("CH1_NEUTRAL_U 1510\n")
    (tmp_path / "part.parm").write_text("CH1_NEUTRAL_US 1500\n")

    typo = foldcar(*LOG, "--port", port, "--yes", "--parameters", "typo.parm")
    part = foldcar(*LOG, "--port", port, "--yes", "--countdown", "0", "--parameters", "part.parm")

    assert refused(typo).startswith("typo.parm: CH1_NEUTRAL_U: the car has no such parameter; did you mean")
    assert part.returncode == 0, part.stderr
    assert "part.parm lacks 5" in part.stdout and "these are not compared" in part.stdout


def test_parameters_that_no_car_keeps_are_named(tmp_path: Path, port: str, foldcar: Foldcar) -> None:
    (tmp_path / "part.parm").write_text("CH1_NEUTRAL_US 1510\n")

    huge = foldcar("params", "set", "--port", port, "TRIAL_MAX_S", "1e39")
    # A packet would hold the first 16 characters only.
    long = foldcar("params", "set", "--port", port, "CH1_DEADBAND_US_AND_MORE", "30")
    unknown = foldcar("params", "get", "--port", port, "trial_max_s")
    differing = foldcar("params", "diff", "--port", port, "part.parm")

    assert refused(huge) == "TRIAL_MAX_S: 1e+39 is no number that a car keeps (32-bit floating point)"
    assert refused(long) == ("CH1_DEADBAND_US_AND_MORE: no name of a parameter: those have 1 to 16 ASCII characters")
    assert refused(unknown) == 'trial_max_s: the car has no such parameter; did you mean "TRIAL_MAX_S"?'
    assert "\n1 of 1 parameters differ; 5" in differing.stdout


def test_a_second_program_at_a_tcp_port_is_told_why(tmp_path: Path, carsim_binary: Path, foldcar: Foldcar) -> None:
    with car_at_port(carsim_binary, tcp=True) as car:
        first = open_stream(car.port)
        answer = foldcar("params", "get", "--port", car.port)
        first.close()

    assert refused(answer) == f"{car.port}: it closed the connection at once; another program may be using the car"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tcp:a..b:5760", 'tcp:a..b:5760: "a..b" is no name of a host'),
        (f"tcp:{'a' * 300}:80", "is no name of a host"),
        ("/dev/null", "^/dev/null: not a serial port$"),
    ],
)
def test_a_port_that_is_none_is_named(name: str, message: str) -> None:
    with pytest.raises(FoldcarError, match=message):
        open_stream(name)


@pytest.mark.parametrize("number", ["1_0", "٥"])
def test_a_deviation_has_typed_numbers(number: str) -> None:
    with pytest.raises(FoldcarError, match="not NAME X_MM Y_MM"):
        ask_deviations(None, {}, [f"car {number} 5"])


def test_a_second_deviation_of_one_thing_is_refused() -> None:
    with pytest.raises(FoldcarError, match='--deviation "car 5 5": car is given twice'):
        ask_deviations(None, {}, ["car 1 1", "car 5 5"])


@pytest.fixture
def two_trials(tmp_path: Path) -> Path:
    """A store s.db with two completed trials of experiment 1, and a log of each."""
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "t.tlog").write_bytes(b"")
    with write_trials(tmp_path / "s.db") as writer:
        for _ in range(2):
            writer.complete(begin(writer), Ending("passed", "goal", 2.5, "", "ff"))
    return tmp_path / "s.db"


def test_a_log_that_is_another_is_not_exported(two_trials: Path, foldcar: Foldcar) -> None:
    answer = foldcar("trials", "export", "s.db", "1", "--mcap", "t.mcap")

    assert refused(answer) == "logs/t.tlog: is not the log that trial 1 of s.db wrote: its SHA-256 is another"
    assert not (two_trials.parent / "t.mcap").exists()


def test_trials_and_experiments_that_are_not_there_are_named(two_trials: Path, foldcar: Foldcar) -> None:
    number = str(10**20)
    listed = foldcar("trials", "list", "s.db", "--experiment", "9")
    withdrawn = foldcar("trials", "withdraw", "s.db", "1", number, "--reason", "x")
    corrected = foldcar("trials", "correct", "s.db", "1", "--elapsed-time", "1e300", "--reason", "x")

    assert refused(listed) == 's.db: has no trials of experiment "9"; experiments with trials: 1'
    assert refused(withdrawn) == f"s.db: has no trial {number}"
    assert refused(corrected) == "s.db: trial 1: elapsed_time_s: 1e+300 is above the maximum 86400"
    with Store.open(two_trials) as store:
        assert [(trial.withdrawn, trial.elapsed_time_s) for trial in store.trials()] == [(False, 2.5)] * 2


def test_the_report_tells_trials_of_another_environment(
    tmp_path: Path, free_course: Path, port: str, foldcar: Foldcar
) -> None:
    assert foldcar("sweep", "l.json", "--store", "s.db", "--jobs", "1").returncode == 0
    assert foldcar(*LOG, "--port", port, "--yes", "--countdown", "0").returncode == 0
    same: Any = json.loads(foldcar("report", "s.db", "-o", "r", "--no-replay", "--simulated-trials", "--json").stdout)
    text = (tmp_path / "free.scenic").read_text()
    (tmp_path / "other.scenic").write_text(text.replace("(1.0, 0)", "(0.7, 0)"))
    (tmp_path / "m.json").write_text(free_course.read_text().replace("free.scenic", "other.scenic"))

    assert foldcar("sweep", "m.json", "--store", "s.db", "--jobs", "1").returncode == 0
    other: Any = json.loads(foldcar("report", "s.db", "-o", "r", "--no-replay", "--simulated-trials", "--json").stdout)

    told = "1 trial in free.scenic, not in the environment of the runs, other.scenic: they count in no rate here."
    assert told in other["experiments"][0]["remarks"]
    assert told not in same["experiments"][0]["remarks"]
    assert told in (tmp_path / "r" / "index.html").read_text()


def test_a_link_lost_before_the_start_has_no_time_of_an_earlier_trial(
    tmp_path: Path, free_course: Path, carsim_binary: Path, foldcar: Foldcar
) -> None:
    with car_at_port(carsim_binary) as car:
        # The car's last trial is number 1, as the first of the next store is.
        assert foldcar(*LOG[:-1], "first.db", "--port", car.port, "--yes", "--countdown", "0").returncode == 0
        code, _, errors = log_and(tmp_path, car.port, car.process.kill)

    assert code == 2 and "connection is lost" in errors
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending, trial.elapsed_time_s) == ("aborted", "link lost", None), trial.ending
