"""MAVProxy, a ground station that knows nothing of foldcar, on the port of `foldcar link`."""

import contextlib
import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

from foldcar.car.body import body_json, car_json
from foldcar.car.design import compose
from foldcar.link.simulated_car import simulated_car
from foldcar.simulation.carsim import Carsim
from study_car import empty_scene

# Locked with the other tools of the tests, in the same environment.
MAVPROXY = Path(sys.executable).with_name("mavproxy.py")


class Station:
    """A running MAVProxy, its input and its output."""

    def __init__(self, port: str, folder: Path) -> None:
        options = [f"--master={port}", f"--logfile={folder / 'mav.tlog'}", f"--state-basedir={folder}"]
        self.process = subprocess.Popen(
            [sys.executable, MAVPROXY, *options, "--default-modules=param,arm,link,mode,rc,message"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            # Which dialect it speaks is its own choice, not that of foldcar in this process. What it prints into a pipe
            # would else wait there for its next prompt.
            env={key: value for key, value in os.environ.items() if not key.startswith("MAVLINK")}
            | {"PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        # Only the listening thread writes the text, only this one the position up to which it has been read.
        self.text = ""
        self.position = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        while text := self.process.stdout.readline():
            self.text += text

    def types(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    @property
    def output(self) -> str:
        return self.text[self.position :]

    def sees(self, text: str, timeout_s: float = 300) -> None:
        """Wait until it has printed ``text``; earlier output is discarded."""
        end_s = time.monotonic() + timeout_s
        while text not in self.output:
            assert time.monotonic() < end_s, f"no {text!r} in: {self.output}"
            time.sleep(0.05)
        self.position = self.text.index(text, self.position) + len(text)

    def asks(self, line: str, text: str, every_s: float = 1.0) -> None:
        """Type the line until it has printed the text, which it gets ``every_s`` seconds to do."""
        for _ in range(300):
            with contextlib.suppress(AssertionError):
                self.sees(text, every_s)
                return
            self.types(line)
        self.sees(text)

    def lost_in_a_second(self) -> int:
        """The number of packets that it finds missing in a second."""
        self.types("link resetstats")
        time.sleep(1.0)
        self.types("link")
        self.sees("s delay, ")
        self.sees(" lost")
        return int(self.text[: self.position].rpartition(" lost")[0].rpartition(" ")[2])

    def end(self) -> None:
        self.process.kill()
        self.process.wait(timeout=100)


def test_mavproxys_stick_drives_forward_and_to_the_right(tmp_path: Path, carsim_binary: Path) -> None:
    design = compose("W_B_W", {"width": 95.0})
    table = Carsim(carsim_binary).parameter_table()
    body, worlds = body_json(design), [({**empty_scene(goal_x_m=None), "id": "flat"}, {})]
    with simulated_car([str(carsim_binary)], body, worlds, car_json(design), 1.0, None, subprocess.PIPE) as car:
        station = Station(car.port, tmp_path)

        def pulses_us(stick: str) -> list[int]:
            """The pulses of the left and of the right wheels under MANUAL_CONTROL, when they no longer change."""
            seen: list[list[int]] = []
            for _ in range(300):
                station.types(f"message MANUAL_CONTROL 1 {stick} 0")
                station.types("status SERVO_OUTPUT_RAW")
                station.sees("SERVO_OUTPUT_RAW {")
                station.sees("servo3_raw")
                row = station.text[: station.position].rpartition("SERVO_OUTPUT_RAW {")[2]
                seen.append([int(value) for value in re.findall(r"servo[12]_raw : (\d+)", row)])
                if len(seen) > 20 and all(pulses == seen[-1] and all(pulses) for pulses in seen[-5:]):
                    break
                time.sleep(0.05)
            return seen[-1]

        try:
            station.sees("online system 1")
            # A busy machine may let MAVProxy wait longer between two commands than the dead man's switch allows.
            station.asks("param fetch", f"Received {len(table)} parameters", every_s=20)
            station.types("param set CMD_TIMEOUT_MS 10000")
            station.asks("param show CMD_TIMEOUT_MS", "CMD_TIMEOUT_MS   10000.0")
            station.types("arm throttle")
            station.sees("ARMED")
            # x, y, z, r as QGroundControl sends them: y to the right; the throttle z rests at 500 with some settings.
            left_us, right_us = pulses_us("600 0 500 0")
            assert left_us - 1500 == 1500 - right_us > 50
            # The right wheels' servos are mounted mirrored: less than 1500 µs drives forward.
            left_us, right_us = pulses_us("600 300 500 0")
            assert left_us - 1500 > 1500 - right_us > 0
            left_us, right_us = pulses_us("0 1000 500 0")
            assert left_us > 1550 and right_us > 1550
            # MAVProxy still sends its heartbeats: they do not replace the stick.
            station.sees("fault: no command from the host")
        finally:
            station.end()


def test_mavproxy_lists_sets_and_saves_parameters_and_arms(tmp_path: Path, carsim_binary: Path) -> None:
    design = compose("W_B_W", {"width": 95.0})
    table = Carsim(carsim_binary).parameter_table()
    saved = tmp_path / "saved.parm"
    body, worlds = body_json(design), [({**empty_scene(goal_x_m=1.0), "id": "flat"}, {})]
    with simulated_car([str(carsim_binary)], body, worlds, car_json(design), 1.0, None, subprocess.PIPE) as car:
        station = Station(car.port, tmp_path)
        try:
            station.sees("online system 1")
            # It fetches them by itself after the first heartbeat, if that came when it was ready.
            station.asks("param fetch", f"Received {len(table)} parameters", every_s=20)
            station.types("param set CH1_NEUTRAL_US 1511")
            # MAVProxy sends the value asynchronously, and shows the car's answer.
            station.asks("param show CH1_NEUTRAL_US", "CH1_NEUTRAL_US   1511.0")
            station.types(f"param save {saved}")
            station.sees(f"Saved {len(table)} parameters to {saved}")
            station.types("arm throttle")
            station.sees("ARMED")
            # The car has no modes, and takes no radio control; it shows none of an ArduPilot rover's modes either.
            station.types("mode GUIDED")
            station.sees("refused: not a command of this car")
            station.sees("DO_SET_MODE: UNSUPPORTED")
            station.types("rc 3 1700")
            station.sees("refused: RC_CHANNELS_OVERRIDE: drive with MANUAL_CONTROL")
            station.types("rc all 0")
            station.types("disarm")
            station.sees("DISARMED")
            assert "Mode ACRO" not in station.text and "Mode MANUAL" not in station.text
            # A busy machine may lose packets in one second, but not in each.
            assert any(station.lost_in_a_second() == 0 for _ in range(30))
            assert "no link" not in station.output and "timeout" not in station.output
        finally:
            station.end()
    values = dict(line.split()[:2] for line in saved.read_text().splitlines())
    assert set(values) == set(table) and float(values["CH1_NEUTRAL_US"]) == 1511.0
