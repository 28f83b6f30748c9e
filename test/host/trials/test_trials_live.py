"""Trials with the real firmware in a simulated car: `foldcar log` driven by a person and by a script."""

import hashlib
import os
import re
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.link.log_features import log_features
from foldcar.link.tlog import read_tlog
from foldcar.trials.drive_view import DriveView
from foldcar.trials.driving import drive
from live_car import LOG, car_at_port, greeted, inject, moving, trials_in
from typist import Typist


def test_a_person_drives_a_trial(tmp_path: Path, free_course: Path) -> None:
    with (
        car_at_port(goal_x_m=None) as car,
        Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "1") as person,
    ):
        assert "W_B_W 95x200 r60" in person.sees("Measured deviations")
        person.answers(("deviation: ", "A 5 -3 90"), ("deviation: ", "Z 1 2"), ("does not begin with one of car, A", ""))
        person.answers(("Enter starts", ""))
        person.sees("Countdown 1 s")
        person.sees("DRIVING")
        person.watches_until(lambda: moving(tmp_path))
        person.types("s")
        person.sees("stopped by key")
        person.answers(("Outcome:", "fine"), ("type one of p (passed)", "o"))
        person.sees("Trial 1: off_course")
        person.answers(("Enter: next", "n hit a chair"), ("Enter: next", ""))
        # The simulated car moves to the sample that it has not met; the person ends the session.
        person.sees("Trial 2: sample 1")
        person.answers(("deviation: ", ""), ("Enter starts", "q"))
        assert person.ends() == 0

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending, trial.note, trial.sample) == ("off_course", "stopped by key", "hit a chair", 0)
    assert trial.design["width_mm"] == 95 and trial.firmware_build and trial.design_hash
    assert trial.deviations["A"] == pytest.approx((0.005, -0.003, 1.5707963))
    assert trial.elapsed_time_s is not None and 0.1 < trial.elapsed_time_s < 3
    log = tmp_path / str(trial.log)
    assert hashlib.sha256(log.read_bytes()).hexdigest() == trial.log_sha256
    assert (tmp_path / "s-logs" / "place-1-0.png").read_bytes()[:4] == b"\x89PNG"


def test_a_script_drives_trials_that_other_tools_read(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    with car_at_port() as car:
        answer = foldcar(*LOG, "--port", car.port, "--yes", "--countdown", "0", "--trials", "2", "--operator", "Ada")

    assert answer.returncode == 0, answer.stderr
    first, second = trials_in(tmp_path / "s.db")
    assert [(t.outcome, t.ending, t.sample, t.operator) for t in (first, second)] == [
        ("passed", "goal", 0, "Ada"), ("passed", "goal", 1, "Ada"),
    ]  # fmt: skip
    replay = foldcar("trials", "replay", "s.db", "1", "--plot", "pair.png", "--simulated-trials")
    assert replay.returncode == 0 and "trial and simulation agree" in replay.stdout, replay.stderr
    simulated_s = float(replay.stdout.splitlines()[2].split()[2])
    # The firmware starts up to a tick later, with other initial angles of the wheels.
    assert first.elapsed_time_s == pytest.approx(simulated_s, abs=0.2)

    log = tmp_path / str(first.log)
    kinds = Counter(message.get_type() for _, message in read_tlog(log))
    assert kinds["PARAM_VALUE"] >= 50 and kinds["FOLDCAR_DESIGN"] >= 1
    assert {"COMMAND_LONG", "COMMAND_ACK", "SERVO_OUTPUT_RAW", "HEARTBEAT", "FOLDCAR_TRIAL"} <= set(kinds)
    times = [time_us for time_us, _ in read_tlog(log)]
    assert times == sorted(times) and abs(times[0] / 1e6 - time.time()) < 600
    dump = subprocess.run(
        [sys.executable, "-m", "pymavlink.tools.mavlogdump", str(log)]
        if not (beside := Path(sys.executable).with_name("mavlogdump.py")).is_file()
        else [sys.executable, str(beside), str(log)],
        capture_output=True, text=True, check=True,
        env={key: value for key, value in os.environ.items() if not key.startswith("MAVLINK")},
    ).stdout.splitlines()  # fmt: skip
    assert len(dump) == len(times) and not any("BAD_DATA" in line for line in dump)
    for kind in ("PARAM_VALUE", "COMMAND_LONG", "SERVO_OUTPUT_RAW"):
        assert sum(f" {kind} " in line for line in dump) == kinds[kind]


def test_another_design_is_refused_and_does_not_move(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    with car_at_port(width=150.0) as car:
        answer = foldcar(*LOG, "--port", car.port, "--yes")
        other = foldcar("params", "get", "TRACK_M", "--port", car.port)

    assert answer.returncode == 2 and answer.stderr.count("\n") == 1
    for message in ("the car is W_B_W 150x200 r60", "not one of the 2 of experiment 1", "foldcar flash"):
        assert message in answer.stderr
    assert not (tmp_path / "s.db").exists() and not (tmp_path / "s-logs").exists()
    assert float(other.stdout.split()[1]) == pytest.approx(body_json(compose("W_B_W", {"width": 150.0}))["track_m"])


@pytest.mark.parametrize("option", ["--untethered", "--button"])
def test_a_script_must_say_how_a_drive_without_a_cable_ended(option: str, refused: Any) -> None:
    message = refused(*LOG, option, "--yes")
    assert f"--yes: with {option}, neither car nor computer sees whether the car has passed; give --outcome" in message


def test_an_untethered_car_brings_its_log_home(tmp_path: Path, free_course: Path) -> None:
    with (
        car_at_port(goal_x_m=None, tcp=True) as car,
        Typist(
            tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--outcome", "timeout", "--yes", "--untethered"
        ) as person,
    ):
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="unplug", for_s=4)
        assert person.ends() == 0, person.output

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("timeout", "time limit, untethered")
    assert trial.elapsed_time_s == pytest.approx(3, abs=0.05)
    log = list(read_tlog(tmp_path / str(trial.log)))
    assert [time_us for time_us, _ in log] == sorted(time_us for time_us, _ in log)
    drive = [(t, m) for t, m in log if m.get_type() == "FOLDCAR_TRIAL" and m.trial_id == trial.id and m.end == 0]
    elapsed = [m.elapsed_ms / 1000 for _, m in drive]
    assert max(elapsed) > 2.5 and max(b - a for a, b in zip(sorted(elapsed), sorted(elapsed)[1:], strict=False)) < 0.25
    # The times of the car's log, converted to the host's clock, agree with those of the live messages.
    offsets = [t / 1e6 - m.elapsed_ms / 1000 for t, m in drive]
    assert max(offsets) - min(offsets) < 0.5


def test_a_crash_on_the_floor_is_stored_with_the_trial_whose_log_it_broke_off(tmp_path: Path, free_course: Path) -> None:
    with (
        car_at_port(goal_x_m=None, tcp=True) as car,
        Typist(
            tmp_path, *LOG, "--port", car.port, "--countdown", "0", "--outcome", "timeout", "--yes", "--untethered"
        ) as person,
    ):
        person.watches_until(lambda: moving(tmp_path))
        inject(car, inject="unplug", for_s=3)
        inject(car, inject="crash", address=0x400D1234)
        person.ends()

    (trial,) = trials_in(tmp_path / "s.db")
    # The packet that the crash cut in two may be lost.
    ending = r"its log breaks off, untethered(, \d+ bytes of its log lost)?: the firmware ended itself at 0x400d1234"
    assert trial.outcome == "aborted" and re.fullmatch(ending, trial.ending), trial.ending


def test_a_car_counts_says_when_to_pull_the_cable_and_is_stopped_if_it_is_not_pulled(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with car_at_port(goal_x_m=None) as simulated, greeted(simulated.port) as car:
        # As a board, which has a cable; a simulated car has none.
        monkeypatch.setattr("foldcar.trials.driving._has_cable", lambda _: True)
        view = DriveView(2, 5.0, None)
        settings = {"speed_m_s": 0.3, "yaw_rate_rad_s": 0.0, "time_limit_s": 5.0}

        with view.watching(car, lambda: None):
            end = drive(car, settings, 7, 2, view, untethered=True)
        view.wait_for_terminal()

    assert (end.ending, end.outcome) == ("the cable was still plugged in when the wheels started", "aborted")
    assert end.elapsed_time_s is not None and end.elapsed_time_s < 1.0
    assert "Pull the cable now: the wheels start in 2 s." in capfd.readouterr().out


def test_the_button_starts_a_trial_without_a_cable_from_start_to_report(
    tmp_path: Path, free_course: Path, foldcar: Any
) -> None:
    with car_at_port(goal_x_m=None, tcp=True) as car:
        for name, value in (("BUTTON_WIRED", "1"), ("SERVO_DIVIDER", "3")):
            assert foldcar("params", "set", name, value, "--port", car.port).returncode == 0
        words = (*LOG, "--port", car.port, "--countdown", "2", "--outcome", "timeout", "--yes", "--button")
        with Typist(tmp_path, *words) as person:
            person.sees("Pull the cable now, put the car in its place. Its button starts the 2 s.")
            inject(car, inject="unplug", for_s=8)
            inject(car, inject="button", for_s=0.2)
            assert person.ends() == 0, person.output
            assert re.search(r"servos    \d\.\d\d V, simulated with", person.output)

    (trial,) = trials_in(tmp_path / "s.db")
    assert (trial.outcome, trial.ending) == ("timeout", "time limit, untethered")
    assert trial.elapsed_time_s == pytest.approx(3, abs=0.05)
    features = log_features(tmp_path / str(trial.log))
    assert features.servo_battery_v == pytest.approx(body_json(compose("W_B_W", {"width": 95.0}))["supply_v"], abs=1e-3)
    assert foldcar("report", "s.db", "-o", "report", "--simulated-trials").returncode == 0
