"""A client of `carsim link` over pymavlink, for tests of the link itself."""

import contextlib
import json
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from foldcar.car.body import firmware_parameters
from foldcar.car.design import compose
from foldcar.link.dialect import load_dialect
from study_car import car_body, empty_scene

mavlink = load_dialect()

from pymavlink import mavutil  # noqa: E402

GOAL_X_M = 0.6


class Car:
    """A running `carsim link`, the files it was given, and a client on its port."""

    def __init__(self, carsim: Path, files: Path, *options: str) -> None:
        self.words = [str(carsim), "link", "--body", str(files / "body.json"), "--scene", str(files / "scene.json")]
        if (files / "params.json").exists():
            self.words += ["--params", str(files / "params.json")]
        self.process = subprocess.Popen(
            [*self.words, *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.port = str(self.line()["port"])
        self.client: Any = None

    def line(self) -> dict[str, Any]:
        """The next line of the program's output."""
        assert self.process.stdout is not None
        answer: dict[str, Any] = json.loads(self.process.stdout.readline())
        return answer

    def inject(self, **what: Any) -> dict[str, Any]:
        """Inject a fault or an event; returns the program's answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(what) + "\n")
        self.process.stdin.flush()
        return self.line()

    def connect(self) -> Any:
        """A new client, after the car's first heartbeat."""
        if self.client is not None:
            self.client.close()
        self.client = mavutil.mavlink_connection(self.port, source_system=255, dialect="foldcar")
        assert self.client.wait_heartbeat(timeout=100) is not None
        return self.client

    def show_life(self) -> None:
        self.client.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def command(self, command: int, *parameters: float) -> int:
        """Send a command; its result."""
        self.show_life()
        filled = [*parameters, *[0.0] * (7 - len(parameters))]
        self.client.mav.command_long_send(1, 1, command, 0, *filled)
        return int(self.wait_for("COMMAND_ACK", lambda ack: ack.command == command, timeout_s=100).result)

    def wait_for(self, kind: str, condition: Callable[[Any], bool], alive: bool = True, timeout_s: float = 100) -> Any:
        """The first message of that kind that fulfils the condition; ``alive``: the host sends heartbeats meanwhile."""
        end_s, shown_s = time.monotonic() + timeout_s, 0.0
        while time.monotonic() < end_s:
            if alive and time.monotonic() - shown_s > 0.1:
                self.show_life()
                shown_s = time.monotonic()
            message = self.client.recv_match(type=kind, blocking=True, timeout=0.05)
            if message is not None and condition(message):
                return message
        raise AssertionError(f"no such {kind} within {timeout_s} s")

    def drive(self, *start: float) -> None:
        """Arm and start a trial."""
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        assert self.command(mavlink.MAV_CMD_FOLDCAR_START_TRIAL, *start) == mavlink.MAV_RESULT_ACCEPTED

    def end(self) -> int:
        """Terminate it; its exit code."""
        if self.client is not None:
            self.client.close()
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(timeout=100)
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            assert stream is not None
            with contextlib.suppress(BrokenPipeError):
                stream.close()
        return code


def write_car_files(folder: Path) -> None:
    """Write the study car's files, and a scene with a bump on the way to its goal.

    The car waits 10 s for its host: a busy machine may suspend this process for longer than the default.
    """
    place = {"x_m": 0.35, "y_m": 0.0, "heading_rad": 0.0}
    bump = {"kind": "box", **place, "length_m": 0.05, "width_m": 1.0, "height_m": 0.01}
    scene = empty_scene(terrain=[bump], goal_x_m=GOAL_X_M)
    (folder / "body.json").write_text(json.dumps({"body": {"id": "car", **car_body()}}))
    (folder / "scene.json").write_text(json.dumps({"scene": {"id": "bump", **scene}}))
    (folder / "params.json").write_text(json.dumps(firmware_parameters(compose("W_B_W", {})) | {"CMD_TIMEOUT_MS": 10000}))
