"""Trials that are interrupted: an unplugged cable, a killed program, a board's restart, a full disk, Ctrl-C."""

import hashlib
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from foldcar.link.tlog import read_tlog
from live_car import LOG, car_at_port, greeted, inject, moving, trials_in
from typist import Typist


def test_a_pulled_cable_aborts_the_trial_and_keeps_what_was_received(tmp_path: Path, free_course: Path) -> None:
    with (
        car_at_port(goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--deviation", "car 0 0") as person,
    ):
        person.answers(("Enter starts", ""))
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="unplug", for_s=1.5)
        person.sees("Trial 1: aborted")
        (trial,) = trials_in(tmp_path / "s.db")
        assert (trial.outcome, trial.ending) == ("aborted", "link lost")
        person.sees("Plug the car in")
        # The port has a new name, and the fault of the lost link must be acknowledged.
        assert car.process.stdout is not None
        lines = (json.loads(line) for line in car.process.stdout)
        person.types(next(line["port"] for line in lines if "port" in line) + "\n")
        person.answers(("fault     The host was silent", "y"), ("Enter: next", ""), ("Enter starts", ""))
        person.answers(("Outcome", "i"))
        person.sees("Trial 2: timeout")
        person.answers(("Enter: next", "q"))
        assert person.ends() == 0

    first, second = trials_in(tmp_path / "s.db")
    assert (second.outcome, second.ending, second.elapsed_time_s) == ("timeout", "time limit", pytest.approx(3, abs=0.05))
    pulses = [m.servo1_raw for _, m in read_tlog(tmp_path / str(first.log)) if m.get_type() == "SERVO_OUTPUT_RAW"]
    assert pulses[-1] > 0


def test_a_killed_program_loses_nothing_it_received(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    with car_at_port(goal_x_m=None) as car:
        with Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person:
            person.watches_until(lambda: moving(tmp_path))
            person.process.kill()
            person.process.wait()
        (trial,) = trials_in(tmp_path / "s.db")
        log = tmp_path / str(trial.log)
        before = log.read_bytes()
        assert (trial.outcome, trial.ending, trial.log_sha256) == ("aborted", "running", None)
        assert [m for _, m in read_tlog(log) if m.get_type() == "SERVO_OUTPUT_RAW"][-1].servo1_raw > 0
        await_fault(car.port)

        again = foldcar(*LOG, "--port", car.port, "--countdown", "0", "--yes")

    assert again.returncode == 0, again.stderr
    assert "Trial 1 was interrupted" in again.stdout and "fault     The host was silent" in again.stdout
    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", "the program was ended")
    assert first.log_sha256 == hashlib.sha256(before).hexdigest() and log.read_bytes() == before
    assert second.outcome == "timeout"


def await_fault(port: str) -> None:
    """Wait until the car has latched a fault: half a second of its clock after the last sign of a host's life."""
    for _ in range(50):
        # To look is a sign of life too. The simulation waits a second for a silent host, and notices half a second later.
        time.sleep(2.0)
        with greeted(port) as watcher:
            if watcher.state() == watcher.dialect.FOLDCAR_STATE_FAULT:
                return
    pytest.fail("the car does not notice that its host is gone")


def stands_still(port: str) -> None:
    """Assert that the car is disarmed and has no pulses."""
    with greeted(port) as watcher:
        assert watcher.state() in (watcher.dialect.FOLDCAR_STATE_DISARMED, watcher.dialect.FOLDCAR_STATE_FINISHED)
        assert watcher.request("SERVO_OUTPUT_RAW").servo1_raw == 0


def test_a_car_that_still_drives_an_earlier_trial_is_stopped_first(
    tmp_path: Path, free_course: Path, foldcar: Any
) -> None:
    with car_at_port(goal_x_m=None) as car:
        with greeted(car.port) as before:
            before.arm()
            # Untethered, so that it drives on however long the next program takes to start.
            before.start_trial(0.1, 0.0, 30.0, 77, untethered=True)
        answer = foldcar(*LOG, "--port", car.port, "--countdown", "0", "--yes")

    assert answer.returncode == 0, answer.stderr
    assert "driving   an earlier trial; it is stopped now\n" in answer.stdout and "fault " not in answer.stdout
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("timeout", "time limit")


def test_a_board_that_restarts_aborts_the_trial(tmp_path: Path, free_course: Path) -> None:
    with (
        car_at_port(goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person,
    ):
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="brown_out")
        person.ends()

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "the car restarted")


def test_a_full_disk_stops_the_car(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(goal_x_m=None) as car:
        process = subprocess.run(
            [sys.executable, "-c", f"import resource; from foldcar.link import tlog\n{SHORT_LOG}", *LOG,
             "--port", car.port, "--countdown", "0", "--yes"],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        stands_still(car.port)

    assert process.returncode == 2
    assert process.stderr.startswith("foldcar: error: s-logs/trial-0001-") and "No space left on device" in process.stderr
    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "log could not be written")
    assert len(list(read_tlog(tmp_path / str(trial.log)))) > 100


# A hundred packets after the command to start (31010) the log's size is limited, as on a full disk.
SHORT_LOG = """
write, since = tlog.TlogWriter.write, []
def limited(self, packet, time_us=None):
    if since or (31010).to_bytes(2, 'little') in packet:
        since.append(packet)
    if len(since) > 100:
        resource.setrlimit(resource.RLIMIT_FSIZE, (self._size + 5, resource.RLIM_INFINITY))
    try:
        write(self, packet, time_us)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
tlog.TlogWriter.write = limited
from foldcar.cli import main
main()
"""


def test_ctrl_c_stops_the_car_and_aborts_the_trial(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(goal_x_m=None) as car:
        with Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--yes") as person:
            person.watches_until(lambda: moving(tmp_path))
            person.process.send_signal(signal.SIGINT)
            assert person.ends() == 130 and "Traceback" not in person.output
        stands_still(car.port)

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "Ctrl-C") and trial.log_sha256 is not None
