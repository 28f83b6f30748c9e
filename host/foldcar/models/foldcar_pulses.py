"""A controller that Webots runs: drives a car's motors as the firmware's pulses drive its servos.

Its argument names a JSON file beside it, which foldcar.models.webots_world wrote: how long the car stands first, its
motors, and rows of a time (s) and the fractions of full speed from then on, null for no pulse (the motor is free).
"""

import json
import sys
from pathlib import Path

from controller import Robot

LATE_S = 1e-6


def main() -> None:
    """Run until Webots ends the simulation."""
    drive = json.loads((Path(__file__).parent / f"{sys.argv[1]}.json").read_text(encoding="utf-8"))
    robot = Robot()
    step_ms = int(robot.getBasicTimeStep())
    motors = [robot.getDevice(name) for name in drive["motors"]]
    for motor in motors:
        # An infinite position makes Webots control the motor's speed.
        motor.setPosition(float("inf"))
        motor.setVelocity(0.0)
        motor.setAvailableTorque(0.0)
    # A change is a time (s) and each motor's fraction of full speed from then on; None is a motor without torque.
    changes = iter(drive["changes"])
    change = next(changes, None)
    while robot.step(step_ms) != -1:
        drive_time_s = robot.getTime() - drive["settling_s"]
        while change is not None and drive_time_s >= change[0] - LATE_S:
            for motor, fraction in zip(motors, change[1:]):  # noqa: B905 - Python 3.8 has no strict
                motor.setVelocity((fraction or 0.0) * motor.getMaxVelocity())
                motor.setAvailableTorque(0.0 if fraction is None else motor.getMaxTorque())
            change = next(changes, None)


if __name__ == "__main__":
    main()
