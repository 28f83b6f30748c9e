"""Describes the faults of a car with their remedies, and acknowledges them; describes where its firmware crashed.

Input: a car. Output: one line for each fault. A fault stops the car until it is acknowledged.
"""

from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import ConnectedCar
from foldcar.trials.person import PersonAnswers, print_line

CRASH_REMEDY = "docs/firmware.md says how to find the line; if this happens again, load the firmware with `foldcar flash`"
# What to do about a fault, by its name in the dialect; the descriptions of those that are not here say it.
REMEDIES = {
    "BUS": "push the FeatherWing onto the Feather; an ESP32 Feather V2 has other I2C pins and does not work here",
    "BATTERY_UNREADABLE": "check the board's battery",
    "BATTERY_LOW": "charge the board's battery",
    "SERVO_BATTERY_LOW": "switch the servos' battery on, or charge its cells; if neither helps, check its divider",
    "COMMAND_STALE": "this program or computer stood still, for example after Ctrl-Z; drive again",
    "STORED_PARAMETER": "set the car's parameters again",
    "WATCHDOG": CRASH_REMEDY,
    "INTERRUPT_WATCHDOG": CRASH_REMEDY,
    "CRASH": CRASH_REMEDY,
    "BROWN_OUT": "charge the batteries and check their wires",
    "TILT": "put the car back on its wheels",
    "IMU": "check the wires between board and IMU",
}
# Exceptions of the ESP32's processor by their number EXCCAUSE: Xtensa Instruction Set Architecture, table 4-64.
EXCEPTIONS = {
    0: "illegal instruction",
    2: "instruction fetch error",
    3: "load or store error",
    6: "division by zero",
    9: "unaligned load or store",
    20: "jump to a forbidden address",
    28: "load from a forbidden address",
    29: "store to a forbidden address",
}
# The exceptions whose report has the address that was loaded or stored.
ABOUT_AN_ADDRESS = (3, 9, 28, 29)
# FOLDCAR_CRASH.cause if the processor has raised no exception. Then the reset reason says what ended the firmware.
NO_EXCEPTION = 255
ENDED_BY = {4: "the firmware ended itself", 5: "stopped by the interrupt watchdog"}
# A board that starts may have several faults. Each appears when the one before it is acknowledged.
MAX_FAULTS = 8


class CarFaultError(FoldcarError):
    """The car has stopped because of a fault; the message says what to do."""


def fault_line(car: ConnectedCar) -> str | None:
    """Return the car's fault as last reported, with its remedy; None if there is no fault.

    Example: "Tilted beyond TILT_MAX_RAD for TILT_MS: put the car back on its wheels"
    """
    text = car.fault_text()
    if text is None:
        return None
    parts = [text]
    remedy = REMEDIES.get(_fault_name(car))
    if remedy == CRASH_REMEDY:
        crash = crash_line(car)
        if crash is not None:
            parts.append(crash)
    if remedy is not None:
        parts.append(remedy)
    return ": ".join(parts)


def _fault_name(car: ConnectedCar) -> str:
    """Return the name of the car's fault as in REMEDIES, "" if only a newer foldcar knows it."""
    number = car.connection.latest["FOLDCAR_TRIAL"].fault
    entry = car.dialect.enums["FOLDCAR_FAULT"].get(number)
    return "" if entry is None else str(entry.name.removeprefix("FOLDCAR_FAULT_"))


def crash_line(car: ConnectedCar) -> str | None:
    """Return where the car's firmware was when a crash or a watchdog ended its last run; None if it does not know.

    Example: "load from a forbidden address (0x00000004) at 0x400d1234 0x400d2342"; the second address is the caller's.
    """
    report = car.crash_report()
    return None if report is None else crash_text(report)


def crash_text(report: Any) -> str:
    """Describe a FOLDCAR_CRASH message as :func:`crash_line`."""
    if report.cause == NO_EXCEPTION:
        cause = ENDED_BY.get(report.reset_reason, "stopped by the task watchdog")
    else:
        cause = EXCEPTIONS.get(report.cause, f"exception {report.cause}")
        if report.cause in ABOUT_AN_ADDRESS:
            cause += f" (0x{report.data_address:08x})"
    places = " ".join(f"0x{address:08x}" for address in report.address if address)
    return f"{cause} at {places}" if places else cause


def acknowledge_faults(car: ConnectedCar, answers: PersonAnswers | None = None) -> list[str]:
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


def _current_fault(car: ConnectedCar) -> str | None:
    """Request the car's state and return its :func:`fault_line`."""
    # Messages that have arrived already are older than the answer.
    car.connection.catch_up()
    car.request("FOLDCAR_TRIAL")
    return fault_line(car)
