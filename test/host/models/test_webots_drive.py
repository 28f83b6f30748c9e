"""The Webots controller as Webots runs it, with motors that record: they turn as the firmware's pulses ask.

Webots itself is not there: its Robot and its motors are those below, which keep to the reference manual.
"""

import ast
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from foldcar.car.body import firmware_parameters
from foldcar.car.design import compose
from foldcar.models.exported_car import servo_limits
from foldcar.models.webots_world import CONTROLLER, controller_drive, controller_program
from foldcar.simulation.carsim import Carsim, ask_pulses
from study_car import car_body

STEP_MS, SETTLING_S = 4, 0.25


class Motor:
    """Webots' RotationalMotor: asked for a speed once its position has no end."""

    def __init__(self, no_load_rad_s: float, stall_n_m: float) -> None:
        self.limits = (no_load_rad_s, stall_n_m)
        self.position, self.velocity, self.torque = 0.0, no_load_rad_s, stall_n_m
        self.rows: list[tuple[float, float, float]] = []

    def setPosition(self, position: float) -> None:  # noqa: N802
        self.position = position

    def setVelocity(self, velocity: float) -> None:  # noqa: N802
        assert abs(velocity) <= self.limits[0] * (1 + 1e-9)
        self.velocity = velocity

    def setAvailableTorque(self, torque: float) -> None:  # noqa: N802
        assert 0 <= torque <= self.limits[1]
        self.torque = torque

    def getMaxVelocity(self) -> float:  # noqa: N802
        return self.limits[0]

    def getMaxTorque(self) -> float:  # noqa: N802
        return self.limits[1]


class Robot:
    """Webots' Robot for ``seconds`` of simulation."""

    motors: dict[str, Motor]
    seconds: float

    def __init__(self) -> None:
        self.steps = 0

    def getBasicTimeStep(self) -> float:  # noqa: N802
        return float(STEP_MS)

    def getTime(self) -> float:  # noqa: N802
        return self.steps * STEP_MS / 1000

    def getDevice(self, name: str) -> Motor:  # noqa: N802
        return self.motors[name]

    def step(self, step_ms: int) -> int:
        for motor in self.motors.values():
            assert math.isinf(motor.position) or self.steps == 0
            motor.rows.append((self.getTime(), motor.velocity, motor.torque))
        self.steps += step_ms // STEP_MS
        return -1 if self.getTime() > self.seconds else 0


@pytest.mark.parametrize(("speed_m_s", "yaw_rate_rad_s"), [(0.4, 0.0), (0.3, -1.0)])
def test_the_controller_drives_as_the_firmware_does(
    speed_m_s: float, yaw_rate_rad_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, carsim_binary: Path
) -> None:
    body = car_body()
    settings: dict[str, Any] = {"speed_m_s": speed_m_s, "yaw_rate_rad_s": yaw_rate_rad_s, "time_limit_s": 2.0}
    settings["parameters"] = firmware_parameters(compose("W_B_W", {}), body)
    (pulses,) = ask_pulses(Carsim(carsim_binary), [settings])
    (tmp_path / f"{CONTROLLER}.py").write_text(controller_program())
    (tmp_path / "car.json").write_text(controller_drive(body, pulses, SETTLING_S))

    stall, no_load = servo_limits(body, body["wheels"][0])
    webots = ModuleType("controller")
    motors = {f"wheel{wheel['channel']} servo": Motor(no_load, stall) for wheel in body["wheels"]}
    webots.Robot = type("Robot", (Robot,), {"motors": motors, "seconds": 3.0})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "controller", webots)
    monkeypatch.setattr(sys, "argv", [CONTROLLER, "car"])
    space: dict[str, Any] = {"__name__": "__main__", "__file__": str(tmp_path / f"{CONTROLLER}.py")}
    exec(compile(controller_program(), space["__file__"], "exec"), space)

    for wheel in body["wheels"]:
        rows = motors[f"wheel{wheel['channel']} servo"].rows
        side = 1 if wheel["side"] == "left" else -1
        # What the car is told: both sides' speeds over the ground, by the wheels' radius.
        wanted_rad_s = (speed_m_s - side * yaw_rate_rad_s * body["track_m"] / 2) / wheel["radius_m"]
        by_time = {round(t, 3): (velocity, torque) for t, velocity, torque in rows}
        assert by_time[0.2] == (0.0, 0.0)
        assert by_time[1.752] == (pytest.approx(wanted_rad_s, rel=0.02), stall)
        # The firmware ends the trial: no pulses.
        assert by_time[2.5] == (0.0, 0.0)
        rise = [v for t, v, _ in rows if SETTLING_S < t < SETTLING_S + 0.1]
        assert abs(rise[0]) < 0.3 * abs(wanted_rad_s)


def test_the_controller_is_python_of_the_oldest_webots() -> None:
    assert ast.parse(controller_program(), feature_version=(3, 8)).body
