"""A car on the link: who it is, what it is told, and how it answers.

Commands are sent again until they are answered, with a count by which the car knows a repetition; what it refuses
raises CommandRefusedError with the reason in words.
"""

import math
from dataclasses import dataclass
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.connection import CAR_COMPONENT, CAR_SYSTEM, Connection, connect

GREETING_S = 5.0
ANSWER_S = 0.6
TRIES = 5
NO_CAR = "the firmware may be another one: `foldcar flash` loads it"

# result_param2 of COMMAND_ACK, in docs/link.md.
REASONS = (
    "accepted",
    "it is not armed",
    "its wheels are driven already",
    "no trial is running",
    "a fault is not acknowledged",
    "there is no fault",
    "the battery's voltage cannot be read",
    "the battery is low",
    "there is no wheel on the left or on the right",
    "a value is not a number",
    "the speed is beyond ±5 m/s",
    "the turn rate is beyond ±100 rad/s",
    "the time limit is not above 0 or above TRIAL_MAX_S",
    "its car.json is refused",
    "there is no such output, value or time-out",
    "there is no such message, or the interval is too short",
    "it is not disarmed",
    "it has heard nothing of this host in the 2 s before",
)


class NoCarError(FoldcarError):
    """What is at the port does not speak like a car."""


class CommandRefusedError(FoldcarError):
    """The car does not do it; the message says why."""


@dataclass(frozen=True, slots=True)
class CarIdentity:
    """Who a car says it is. Name and hash are empty without a car.json; ``refused`` if there is one that is bad."""

    name: str
    hash: str
    build: str
    refused: bool


class Car:
    """A car that has answered. Made by :func:`greet`."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.dialect = connection.dialect

    @property
    def port(self) -> str:
        """The port as a person writes it."""
        return self.connection.stream.name

    def identity(self) -> CarIdentity:
        """Name and hash of the design, build of the firmware."""
        design = self.request("FOLDCAR_DESIGN")
        refused = design.source == self.dialect.FOLDCAR_DESIGN_SOURCE_REFUSED
        return CarIdentity(design.name, design.hash, design.build, refused)

    def battery_v(self) -> float | None:
        """Voltage of the battery, as last reported; None if the car cannot read it."""
        status = self.connection.latest.get("SYS_STATUS") or self.request("SYS_STATUS")
        return None if status.voltage_battery == 0xFFFF else status.voltage_battery / 1000

    def request(self, name: str) -> Any:
        """The message of that name, asked for; NoCarError if it does not come."""
        number = getattr(self.dialect, f"MAVLINK_MSG_ID_{name}")
        for _ in range(TRIES):
            # Never as a repetition, which a car that obeyed the first one would only acknowledge.
            self._send_command(self.dialect.MAV_CMD_REQUEST_MESSAGE, (number,), 0)
            message = self.connection.wait_for(lambda m: m.get_type() == name, ANSWER_S)
            if message is not None:
                return message
        raise NoCarError(f"{self.port}: the car does not answer when asked for {name}; {NO_CAR}")

    def arm(self) -> None:
        """Let a trial start; no pulses yet. CommandRefusedError."""
        self._command("arm", self.dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def disarm(self) -> None:
        """No pulses, and none before the next arming. CommandRefusedError, in a fault."""
        self._command("disarm", self.dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def start_trial(
        self, speed_m_s: float, yaw_rate_rad_s: float, time_limit_s: float, trial: int, untethered: bool = False
    ) -> None:
        """Start driving; the car itself ends it at the time limit. CommandRefusedError."""
        flags = self.dialect.FOLDCAR_TRIAL_FLAGS_UNTETHERED if untethered else 0
        command = self.dialect.MAV_CMD_FOLDCAR_START_TRIAL
        self._command("start", command, speed_m_s, yaw_rate_rad_s, time_limit_s, float(flags), float(trial))

    def stop_trial(self) -> None:
        """End whatever drives the wheels."""
        self._command("stop", self.dialect.MAV_CMD_FOLDCAR_STOP_TRIAL)

    def acknowledge_fault(self) -> None:
        """Clear a fault. CommandRefusedError if there is none, or it persists."""
        self._command("clear its fault", self.dialect.MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT)

    def test_output(self, output: int, pulse_us: float | None, timeout_s: float) -> None:
        """Drive one output (1 to 8) with a pulse of 1000 to 2000 µs for a while; None: no pulse."""
        value = math.nan if pulse_us is None else (pulse_us - 1500) / 500
        command = self.dialect.MAV_CMD_ACTUATOR_TEST
        self._command(f"test output {output}", command, value, timeout_s, 0.0, 0.0, float(32 + output))

    def state(self) -> int:
        """FOLDCAR_STATE, as last reported."""
        trial = self.connection.latest.get("FOLDCAR_TRIAL") or self.request("FOLDCAR_TRIAL")
        return int(trial.state)

    def fault_text(self) -> str | None:
        """The fault that is latched, in words of the dialect; None if there is none."""
        trial = self.connection.latest.get("FOLDCAR_TRIAL") or self.request("FOLDCAR_TRIAL")
        if trial.fault == self.dialect.FOLDCAR_FAULT_NONE:
            return None
        entry = self.dialect.enums["FOLDCAR_FAULT"].get(trial.fault)
        return str(entry.description).rstrip(".") if entry is not None else f"fault {trial.fault}"

    def _command(self, what: str, command: int, *values: float) -> None:
        for repetition in range(TRIES):
            self._send_command(command, values, repetition)
            ack = self.connection.wait_for(
                lambda m: m.get_type() == "COMMAND_ACK" and m.command == command, ANSWER_S
            )
            if ack is None:
                continue
            if ack.result == self.dialect.MAV_RESULT_ACCEPTED:
                return
            reason = ack.result_param2
            why = REASONS[reason] if 0 < reason < len(REASONS) else f"result {ack.result}, reason {reason}"
            raise CommandRefusedError(f"the car refuses to {what}: {why}")
        raise CommandRefusedError(f"the car does not answer when told to {what}")

    def _send_command(self, command: int, values: tuple[float, ...], repetition: int) -> None:
        padded = (*values, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
        self.connection.send(
            self.dialect.MAVLink_command_long_message(CAR_SYSTEM, CAR_COMPONENT, command, repetition, *padded)
        )


def greet(port: str, timeout_s: float = GREETING_S) -> Car:
    """The car at a port; NoCarError if nothing there sends a car's heartbeat, other FoldcarErrors of the port."""
    connection = connect(port)
    dialect = connection.dialect
    try:
        heartbeat = connection.wait_for(lambda m: m.get_type() == "HEARTBEAT", timeout_s)
        if heartbeat is None:
            said = "sends what is no MAVLink" if connection.damaged else "says nothing"
            raise NoCarError(f"{port}: is no car: it {said} for {timeout_s:g} s; {NO_CAR}")
        if heartbeat.type != dialect.MAV_TYPE_GROUND_ROVER or heartbeat.autopilot != dialect.MAV_AUTOPILOT_GENERIC:
            raise NoCarError(f"{port}: is another MAVLink device (type {heartbeat.type}), not a foldcar; {NO_CAR}")
    except BaseException:
        connection.close()
        raise
    return Car(connection)
