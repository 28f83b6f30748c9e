"""Describes the faults of a car with their remedies, and acknowledges them.

Input: a car. Output: one line for each fault. A fault stops the car until it is acknowledged.
"""

from foldcar.errors import FoldcarError
from foldcar.link.car import Car
from foldcar.trials.person import Answers, print_line

# What to do about a fault, by its name in the dialect; the descriptions of those that are not here say it.
REMEDIES = {
    "BUS": "push the FeatherWing onto the Feather; an ESP32 Feather V2 has other I2C pins and does not work here",
    "BATTERY_UNREADABLE": "check the board's battery",
    "BATTERY_LOW": "charge the board's battery",
    "COMMAND_STALE": "this program or computer stood still, for example after Ctrl-Z; drive again",
    "STORED_PARAMETER": "set the car's parameters again",
    "WATCHDOG": "if this happens again, load the firmware again with `foldcar flash`",
    "BROWN_OUT": "charge the batteries and check their wires",
    "TILT": "put the car back on its wheels",
    "IMU": "check the wires between board and IMU",
}
# A board that starts may have several faults. Each appears when the one before it is acknowledged.
MAX_FAULTS = 8


class CarFaultError(FoldcarError):
    """The car has stopped because of a fault; the message says what to do."""


def fault_line(car: Car) -> str | None:
    """Return the car's fault as last reported, with its remedy; None if there is no fault.

    Example: "Tilted beyond TILT_MAX_RAD for TILT_MS: put the car back on its wheels"
    """
    text = car.fault_text()
    if text is None:
        return None
    entry = car.dialect.enums["FOLDCAR_FAULT"].get(car.connection.latest["FOLDCAR_TRIAL"].fault)
    remedy = "" if entry is None else REMEDIES.get(entry.name.removeprefix("FOLDCAR_FAULT_"), "")
    return f"{text}: {remedy}" if remedy else text


def acknowledge_faults(car: Car, answers: Answers | None = None) -> list[str]:
    """Acknowledge the car's faults, and return their lines.

    With ``answers``, print each and ask first. Raises FoldcarError if the answer is no, and CommandRefusedError if the
    car refuses, because it has no design.
    """
    lines: list[str] = []
    while (line := _current_fault(car)) is not None and len(lines) < MAX_FAULTS:
        lines.append(line)
        if answers is not None:
            print_line(f"fault     {line}")
            if answers.line("Acknowledge it? [Y/n] ").lower() not in ("", "y", "yes"):
                raise FoldcarError(f"the car has a fault that is not acknowledged: {line}")
        car.acknowledge_fault()
    return lines


def _current_fault(car: Car) -> str | None:
    """Request the car's state and return its :func:`fault_line`."""
    # Messages that have arrived already are older than the answer.
    car.connection.catch_up()
    car.request("FOLDCAR_TRIAL")
    return fault_line(car)
