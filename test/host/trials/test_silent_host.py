"""A host that stands still while a car drives: a blocked terminal, Ctrl-Z, a busy main thread; and faults of the car."""

import contextlib
import itertools
import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.link.connection import HOST_SYSTEM, LISTENING_S
from foldcar.link.dialect import load_dialect
from foldcar.link.simulated_car import SimulatedCar
from foldcar.link.tlog import TlogWriter, read_tlog
from foldcar.trials.faults import REMEDIES
from live_car import LOG, car_at_port, car_clock_s, greeted, inject, injected_s, moving, trials_in, write_free_course
from typist import Typist

CTRL_S, CTRL_Q = "\x13", "\x11"
STALE = "The host was silent for CMD_TIMEOUT_MS"


@contextlib.contextmanager
def session(folder: Path, car: SimulatedCar, countdown_s: int = 0) -> Iterator[Typist]:
    """A person whose first trial has been started."""
    words = (*LOG, "--port", car.port, "--countdown", str(countdown_s))
    with Typist(folder, *words) as person:
        person.answers(("deviation: ", ""), ("Enter starts", ""))
        yield person


def drives_next(person: Typist, outcome: str = "") -> None:
    """Drive the next trial to its end, and end the session."""
    person.answers(("Enter: next", ""), ("deviation: ", ""), ("Enter starts", ""), ("Outcome:", outcome))
    person.answers(("Enter: next", "q"))
    assert person.ends() == 0, person.output


def wait_on_car(car: SimulatedCar, seconds: float) -> None:
    """Wait until the car's clock has advanced."""
    end_s = car_clock_s(car) + seconds
    while car_clock_s(car) < end_s:
        time.sleep(0.1)


def ends_of(folder: Path) -> list[int]:
    """The ends (FOLDCAR_END) that the log of the only trial has reported."""
    (log,) = folder.glob("s-logs/*.tlog")
    return [m.end for _, m in read_tlog(log) if m.get_type() == "FOLDCAR_TRIAL" and m.trial_id == 1]


def test_a_blocked_terminal_stops_neither_car_nor_session(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, session(tmp_path, car) as person:
        person.sees("DRIVING")
        person.types(CTRL_S)
        # The car drives on to its goal, and its end is stored before anything else is shown.
        person.watches_until(lambda: trials_in(tmp_path / "s.db")[0].ending != "running")
        assert "Outcome:" not in person.output
        person.types(CTRL_Q)
        person.answers(("Outcome:", ""), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("passed", "goal")


def test_the_stop_key_works_while_the_terminal_is_blocked(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(goal_x_m=None) as car, session(tmp_path, car) as person:
        person.sees("DRIVING")
        person.watches_until(lambda: moving(tmp_path))
        person.types(CTRL_S + "s")
        person.watches_until(lambda: load_dialect().FOLDCAR_END_STOPPED in ends_of(tmp_path))
        assert "stopped by key" not in person.output
        person.types(CTRL_Q)
        person.answers(("Outcome:", "o"), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("off_course", "stopped by key")


def test_a_stopped_program_ends_the_trial_and_not_the_session(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(waits=False) as car, session(tmp_path, car) as person:
        person.watches_until(lambda: moving(tmp_path))
        person.process.send_signal(signal.SIGSTOP)
        wait_on_car(car, 2.5)
        person.process.send_signal(signal.SIGCONT)
        person.sees(f"the car stopped: {STALE}: this program or computer stood still")
        drives_next(person)

    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", STALE) and first.log_sha256
    assert (second.outcome, second.ending) == ("passed", "goal")


def slow_to_notice(car: SimulatedCar, foldcar: Any) -> None:
    """Let the car drive for 2 s without a host: longer than it needs to its goal, shorter than its time limit."""
    assert foldcar("params", "set", "CMD_TIMEOUT_MS", "2000", "--port", car.port).returncode == 0


def test_the_outcome_stands_if_the_host_stood_still_at_the_goal(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    with car_at_port(waits=False) as car:
        slow_to_notice(car, foldcar)
        with session(tmp_path, car) as person:
            person.watches_until(lambda: moving(tmp_path))
            person.process.send_signal(signal.SIGSTOP)
            wait_on_car(car, 3.5)
            person.process.send_signal(signal.SIGCONT)
            person.sees(f"After the end the car had a fault, which is acknowledged: {STALE}")
            person.answers(("Outcome:", ""))
            drives_next(person)

    assert [(t.outcome, t.ending) for t in trials_in(tmp_path / "s.db")] == [("passed", "goal")] * 2


def test_a_key_that_was_pressed_while_the_host_stood_still_counts(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(goal_x_m=None, waits=False) as car, session(tmp_path, car) as person:
        person.watches_until(lambda: moving(tmp_path))
        person.process.send_signal(signal.SIGSTOP)
        person.types("p")
        wait_on_car(car, 2.5)
        person.process.send_signal(signal.SIGCONT)
        person.answers(("Outcome:", ""), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("passed", "passed, said by key")


def test_nobody_is_told_to_stand_clear_of_a_car_that_has_ended(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, session(tmp_path, car) as person:
        person.answers(("Outcome:", ""), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    assert "DRIVING" in person.output and "stand clear" not in person.output.rpartition("DRIVING")[2]


def test_ctrl_c_after_a_stop_keeps_the_time_that_the_car_drove(tmp_path: Path) -> None:
    # A busy machine may notice late that the car moves, and the car must not have reached its time limit then.
    write_free_course(tmp_path, timeout_s=20)
    with car_at_port(goal_x_m=None, waits=False) as car, session(tmp_path, car) as person:
        person.watches_until(lambda: moving(tmp_path))
        person.process.send_signal(signal.SIGSTOP)
        stopped_s = car_clock_s(car)
        wait_on_car(car, 2.5)
        person.process.send_signal(signal.SIGINT)
        person.process.send_signal(signal.SIGCONT)
        assert person.ends() == 130, person.output

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("aborted", "Ctrl-C")
    (log,) = tmp_path.glob("s-logs/*.tlog")
    running = [m for _, m in read_tlog(log) if m.get_type() == "FOLDCAR_TRIAL" and m.trial_id == 1 and m.elapsed_ms]
    started_s = (running[0].time_boot_ms - running[0].elapsed_ms) / 1000
    # The car drove on until its dead man's switch tripped after 0.5 s without a host. Ctrl-C came 2.5 s after the stop.
    drove_s = stopped_s - started_s
    assert trial.elapsed_time_s is not None and 0.2 < trial.elapsed_time_s < drove_s + 1.2


def test_a_program_that_is_stopped_in_its_countdown_does_not_start_the_car(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(waits=False) as car, session(tmp_path, car, countdown_s=4) as person:
        person.sees("ARMED")
        person.process.send_signal(signal.SIGSTOP)
        time.sleep(4.5)
        person.process.send_signal(signal.SIGCONT)
        person.sees("this program stood still before the start")
        person.answers(("Outcome:", ""), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.elapsed_time_s) == ("aborted", None)
    log = list(read_tlog(tmp_path / str(trial.log)))
    assert not any(m.servo1_raw for _, m in log if m.get_type() == "SERVO_OUTPUT_RAW")


def test_a_fault_is_told_with_its_remedy_and_the_next_trial_is_driven(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, session(tmp_path, car) as person:
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="battery", volts=2.0, for_s=1.3)
        person.sees("the car stopped: Below BATT_MIN_V for BATT_LOW_MS: charge the board's battery")
        time.sleep(1.5)
        drives_next(person)

    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", "Below BATT_MIN_V for BATT_LOW_MS")
    assert (second.outcome, second.ending) == ("passed", "goal")


def test_a_script_learns_of_a_fault_by_the_exit_code(tmp_path: Path, free_course: Path) -> None:
    words = (*LOG, "--yes", "--trials", "1", "--countdown", "0")
    with car_at_port() as car, Typist(tmp_path, *words, "--port", car.port) as person:
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="battery", volts=2.0, for_s=1.3)
        person.sees("1 trial in this session, 1 aborted")
        assert person.ends() == 1

    assert trials_in(tmp_path / "s.db")[0].outcome == "aborted"


def test_an_outcome_for_all_trials_is_not_that_of_a_drive_that_was_not_completed(
    tmp_path: Path, free_course: Path
) -> None:
    words = (*LOG, "--yes", "--trials", "2", "--countdown", "2", "--outcome", "passed")
    with car_at_port(waits=False) as car, Typist(tmp_path, *words, "--port", car.port) as person:
        person.sees("ARMED")
        # The program stands still in the countdown of the first trial, which does not begin.
        person.process.send_signal(signal.SIGSTOP)
        time.sleep(2.5)
        person.process.send_signal(signal.SIGCONT)
        person.sees("Trial 2: sample")
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="brown_out")
        person.sees("the car restarted: A dip of the supply has reset the board: charge the batteries")
        person.sees("2 trials in this session, 2 aborted")
        assert person.ends() == 1, person.output

    assert [(t.outcome, t.ending) for t in trials_in(tmp_path / "s.db")] == [
        ("aborted", "this program stood still before the start"), ("aborted", "the car restarted"),
    ]  # fmt: skip


def test_a_crash_is_told_and_stored_with_its_place(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, session(tmp_path, car) as person:
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="crash", address=0x400D1234)
        person.sees("A crash of the firmware has reset the board: the firmware ended itself at 0x400d1234: docs/firmware")
        drives_next(person)

    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", "the car restarted: the firmware ended itself at 0x400d1234")
    assert (second.outcome, second.ending) == ("passed", "goal")
    (report, *_) = [m for _, m in read_tlog(tmp_path / str(first.log)) if m.get_type() == "FOLDCAR_CRASH"]
    assert (report.address[:2], report.reset_reason) == ([0x400D1234, 0], 4)


def test_a_fault_in_the_countdown_is_told_with_its_remedy(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, session(tmp_path, car, countdown_s=2) as person:
        person.sees("ARMED")
        inject(car, inject="brown_out")
        person.sees("the car did not start: A dip of the supply has reset the board: charge the batteries")
        drives_next(person)

    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", "A dip of the supply has reset the board")
    assert (second.outcome, second.ending) == ("passed", "goal")


def test_a_refused_start_does_not_end_the_session(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0") as person:
        person.answers(("deviation: ", ""))
        injected_s(car, inject="battery", volts=2.0)
        wait_on_car(car, 1.0)
        person.answers(("Enter starts", ""))
        person.sees("the car refuses to arm: the battery is low")
        injected_s(car, inject="battery", volts=5.0)
        wait_on_car(car, 1.0)
        drives_next(person)

    first, second = trials_in(tmp_path / "s.db")
    assert (first.outcome, first.ending) == ("aborted", "refused by the car")
    assert (second.outcome, second.ending) == ("passed", "goal")


def test_a_car_that_restarts_between_two_trials_drives_the_next_one(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, session(tmp_path, car) as person:
        person.answers(("Outcome:", ""))
        person.sees("Enter: next")
        inject(car, inject="brown_out")
        time.sleep(1.0)
        person.types("\n")
        person.answers(("fault     A dip of the supply has reset the board: charge the batteries", "y"))
        person.answers(("deviation: ", ""), ("Enter starts", ""), ("Outcome:", ""), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    assert [(t.outcome, t.ending) for t in trials_in(tmp_path / "s.db")] == [("passed", "goal")] * 2


def test_heartbeats_go_on_while_the_host_does_not_listen_for_a_moment(tmp_path: Path) -> None:
    """A car in real time: its dead man's switch does not trip within a second, but soon after LISTENING_S."""
    log = tmp_path / "a.tlog"
    with car_at_port(goal_x_m=None, waits=False) as simulated, greeted(simulated.port) as car:
        with contextlib.closing(TlogWriter(log)) as writer:
            car.connection.log = writer
            car.arm()
            car.start_trial(0.05, 0.0, 60.0, 1)
            time.sleep(1.0)
            car.connection.catch_up()
            assert car.connection.silence_s() < 0.5
            running = car.request("FOLDCAR_TRIAL").state
            car.connection.log = None
        time.sleep(LISTENING_S + 1.5)
        car.connection.catch_up()
        stopped = car.request("FOLDCAR_TRIAL").state

    assert (running, stopped) == (car.dialect.FOLDCAR_STATE_RUNNING, car.dialect.FOLDCAR_STATE_FAULT)
    messages = list(read_tlog(log))
    beats = [t for t, m in messages if m.get_type() == "HEARTBEAT" and m.get_srcSystem() == HOST_SYSTEM]
    assert len(beats) >= 5 and max(b - a for a, b in itertools.pairwise(beats)) < 450_000
    assert [t for t, _ in messages] == sorted(t for t, _ in messages)


def test_a_cable_that_is_pulled_between_two_trials_is_plugged_in_again(tmp_path: Path, free_course: Path) -> None:
    with car_at_port() as car, Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "0") as person:
        person.sees("deviation: ")
        inject(car, inject="unplug", for_s=1.0)
        assert car.process.stdout is not None
        lines = (json.loads(line) for line in car.process.stdout)
        port = next(line["port"] for line in lines if "port" in line)
        person.types("\n")
        person.answers(("Enter starts", ""), ("Plug the car in", port))
        person.answers(("deviation: ", ""), ("Enter starts", ""), ("Outcome:", ""), ("Enter: next", "q"))
        assert person.ends() == 0, person.output

    assert [(t.id, t.outcome, t.ending) for t in trials_in(tmp_path / "s.db")] == [(1, "passed", "goal")]


def test_every_fault_has_a_remedy() -> None:
    """In REMEDIES, or in its description after a colon."""
    names = {entry.name: entry.description for entry in load_dialect().enums["FOLDCAR_FAULT"].values()}
    faults = {name.removeprefix("FOLDCAR_FAULT_") for name in names if not name.endswith(("_NONE", "_ENUM_END"))}
    described = {name for name in faults if ":" in names[f"FOLDCAR_FAULT_{name}"]}

    assert len(faults) == 15 and described.isdisjoint(REMEDIES) and described | set(REMEDIES) == faults
