"""`foldcar flash` on a machine without a board."""

import os
import pty
from pathlib import Path
from typing import Any

import pytest
import serial.tools.list_ports
from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.commands.flash import copy_logs
from foldcar.link.car import greet
from foldcar.link.tlog import messages_of, records_of
from live_car import car_at_port

LISTING = Path(__file__).parents[3] / "scenarios" / "width_study.json"
WORDS = ("flash", str(LISTING), "--experiment", "1", "--set", "width=95")


def test_a_port_that_does_not_exist_is_refused(refused: Any) -> None:
    assert refused(*WORDS, "--port", "/dev/ttyUSB99") == "--port /dev/ttyUSB99: no such port; is the board plugged in?"


def test_without_a_board_nothing_is_built_but_its_file_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: [])
    monkeypatch.setattr("foldcar.commands.flash.subprocess.Popen", lambda *_, **__: pytest.fail("PlatformIO was called"))

    answer = CliRunner().invoke(app, WORDS)
    written = CliRunner().invoke(app, [*WORDS, "--file", str(tmp_path / "car.json")])

    assert "no car is plugged in: no USB serial port found" in str(answer.exception)
    assert written.exit_code == 0 and (tmp_path / "car.json").is_file()


def test_the_car_s_logs_are_copied_before_they_are_erased(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with car_at_port(goal_x_m=None) as simulated:
        car = greet(simulated.port)
        car.arm()
        car.start_trial(0.2, 0.0, 1.0, 5, untethered=True)
        stored = car.dialect.FOLDCAR_LOG_STORED
        assert car.connection.wait_for(lambda m: m.get_type() == "FOLDCAR_TRIAL" and m.log == stored, 60.0)
        car.connection.close()

        for _ in range(2):
            copy_logs(simulated.port, tmp_path / "logs")

    (file,) = (tmp_path / "logs").iterdir()
    trials = [m.trial_id for _, m in messages_of(records_of(file.read_bytes())[0]) if m.get_type() == "FOLDCAR_TRIAL"]
    assert trials and set(trials) == {5}
    assert f"copied the car's log 1 to {file}" in capsys.readouterr().out


def test_a_board_that_is_no_foldcar_has_no_logs_to_copy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ours, theirs = pty.openpty()
    try:
        copy_logs(os.ttyname(theirs), tmp_path / "logs")
    finally:
        os.close(ours)
        os.close(theirs)

    assert "no foldcar firmware answers" in capsys.readouterr().out and not (tmp_path / "logs").exists()
