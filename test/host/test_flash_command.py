"""`foldcar flash` on a machine without a board."""

import resource
from pathlib import Path
from typing import Any

import pytest
import serial.tools.list_ports
from typer.testing import CliRunner

from foldcar.cli import app

LISTING = Path(__file__).parents[2] / "scenarios" / "width_study.json"
WORDS = ("flash", str(LISTING), "--experiment", "1", "--set", "width=95")


def test_a_port_that_does_not_exist_is_refused_within_a_second(foldcar: Any, refused: Any) -> None:
    foldcar("--version")  # reads the files once
    # Of the processor: a busy machine takes longer by the clock.
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = refused(*WORDS, "--port", "/dev/ttyUSB99")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    passed_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    assert told == "--port /dev/ttyUSB99: no such port; is the board plugged in?"
    assert passed_s < 1.0


@pytest.mark.parametrize("words", [(), ("--design-only",)])
def test_without_a_board_nothing_is_built(monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]) -> None:
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: [])
    monkeypatch.setattr("foldcar.commands.flash.subprocess.run", lambda *_, **__: pytest.fail("PlatformIO was called"))

    answer = CliRunner().invoke(app, [*WORDS, *words])

    assert "no car is plugged in: no USB serial port found" in str(answer.exception)


def test_a_file_needs_no_board(tmp_path: Path, foldcar: Any) -> None:
    answer = foldcar(*WORDS, "--file", str(tmp_path / "car.json"))
    assert answer.returncode == 0 and (tmp_path / "car.json").is_file(), answer.stderr
