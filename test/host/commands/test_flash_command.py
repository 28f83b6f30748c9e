"""`foldcar flash` on a machine without a board."""

from pathlib import Path
from typing import Any

import pytest
import serial.tools.list_ports
from typer.testing import CliRunner

from foldcar.cli import app

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
