"""The command `foldcar doctor`: what it finds, what it advises, and its exit code."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from foldcar.commands.doctor import _reversed_servos
from foldcar.link.parameters import set_parameter
from foldcar.link.stream import UsbPort
from foldcar.simulation.carsim import Carsim
from live_car import car_at_port, greeted
from test_command_line import COMMAND, WEAK

Command = Callable[..., "subprocess.CompletedProcess[str]"]


def test_the_machine_of_the_tests_is_sound(foldcar: Command, carsim_binary: Path, tmp_path: Path) -> None:
    done = foldcar("doctor")

    assert (done.returncode, done.stderr) == (0, "")
    line_of = {line[9:20].strip(): line for line in done.stdout.splitlines()}
    for name in ("foldcar", "packages", "Scenic", "carsim", "results", "temporary", "PlatformIO", "MuJoCo", "MAVProxy"):
        assert line_of[name].startswith("ok "), line_of[name]
    assert f"build {Carsim(carsim_binary).build}, " in line_of["carsim"] and f" {tmp_path}: " in line_of["results"]
    assert all(" -> " in line for line in line_of.values() if not line.startswith("ok "))


def test_what_is_missing_is_told_with_what_to_do(tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    environment = {**os.environ, "FOLDCAR_CARSIM": "/none/carsim"}
    command = [*WEAK, *COMMAND, "doctor", "--json"]
    done = subprocess.run(command, cwd=closed, env=environment, capture_output=True, text=True)

    assert (done.returncode, done.stderr) == (1, "")
    finding_of = {finding["name"]: finding for finding in json.loads(done.stdout)["findings"]}
    assert finding_of["carsim"] == {
        "name": "carsim",
        "state": "missing",
        "text": "FOLDCAR_CARSIM: /none/carsim is not a program",
        "advice": "let FOLDCAR_CARSIM name a carsim, or leave it out",
    }
    assert finding_of["results"]["text"] == f"{closed}: cannot be written: Permission denied"
    assert [finding["name"] for finding in finding_of.values() if finding["state"] == "missing"] == ["carsim", "results"]


def test_a_cars_reversed_servos_are_named(carsim_binary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulated car has no USB port, so the test names its port as that of a Feather."""
    with car_at_port() as car:
        ports = [UsbPort(car.port, "HUZZAH32", True), UsbPort("/dev/none", "another device", False)]
        monkeypatch.setattr("foldcar.link.stream.usb_ports", lambda: ports)
        assert list(_reversed_servos()) == []
        with greeted(car.port) as connected:
            set_parameter(connected, "CH2_REVERSED", 1)

        (finding,) = _reversed_servos()

    assert finding.text == "W_B_W 95x200 r60: CH2_REVERSED 1: turns the other way than its design says"
    assert "foldcar calibrate-servos" in finding.advice
