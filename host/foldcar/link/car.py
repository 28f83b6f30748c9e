"""A car on the link: its identity, its state and the commands to it.

Input: a connection. Output: messages and acknowledged commands. A command is retried until it is acknowledged, with a
count by which the car recognises retries. A refused command raises CommandRefusedError with the reason.
"""

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.connection import (
    CAR_COMPONENT,
    CAR_SYSTEM,
    HOST_COMPONENT,
    HOST_SYSTEM,
    Connection,
    connect,
)
from foldcar.link.stream import LinkLostError

# Longest waits: for a car's first heartbeat, and for an answer before the request is repeated, at most TRIES times.
GREETING_S = 5.0
# How long a port that closes at once is tried again (s).
BUSY_S = 2.0
ANSWER_S = 0.6
TRIES = 5
OTHER_FIRMWARE = "it may have other firmware: `foldcar flash` loads foldcar's"


class NoCarError(FoldcarError):
    """The device at the port does not answer as a car."""


class CommandRefusedError(FoldcarError):
    """The car refuses a command or does not acknowledge it; the message says why."""


@dataclass(frozen=True, slots=True)
class CarIdentity:
    """What a car reports of its design and firmware build.

    Without a car.json, name and hash are empty. ``refused`` is set if the firmware refuses its car.json. ``simulated`` is
    None if the firmware does not report it. A simulated car also reports the id of its ``scene``.
    """

    name: str
    hash: str
    build: str
    refused: bool
    simulated: bool | None
    scene: str | None


class ConnectedCar:
    """A connected car. Create it with :func:`greet`. All methods raise LinkLostError if the link is lost."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.dialect = connection.dialect

    @property
    def port(self) -> str:
        """The name of the port, as on the command line."""
        return self.connection.stream.name

    def identity(self) -> CarIdentity:
        """Request the car's design and build, and a simulated car's scene. Raises NoCarError if it does not answer."""
        dialect = self.dialect
        design = self.request("FOLDCAR_DESIGN")
        simulated: bool | None = None
        if design.hardware == dialect.FOLDCAR_HARDWARE_BOARD:
            simulated = False
        elif design.hardware == dialect.FOLDCAR_HARDWARE_SIMULATED:
            simulated = True
        return CarIdentity(
            name=design.name,
            hash=design.hash,
            build=design.build,
            refused=design.source == dialect.FOLDCAR_DESIGN_SOURCE_REFUSED,
            simulated=simulated,
            scene=self._scene() if simulated else None,
        )

    def _scene(self) -> str:
        """Return the id of a simulated car's scene, which the car sends once a second of its own time."""
        message = self.connection.latest.get("FOLDCAR_SCENE")
        if message is None:
            message = self.connection.wait_for(lambda m: m.get_type() == "FOLDCAR_SCENE", GREETING_S)
        if message is None:
            raise NoCarError(f"{self.port}: the simulated car has not reported its scene for {GREETING_S:g} s")
        return str(message.id)

    def battery_v(self) -> float | None:
        """Return the last reported battery voltage (V); None if the car cannot measure it."""
        status = self.connection.latest.get("SYS_STATUS") or self.request("SYS_STATUS")
        # MAVLink's value (mV) for an unknown voltage is 0xFFFF.
        if status.voltage_battery == 0xFFFF:
            return None
        return float(status.voltage_battery / 1000)

    def servo_battery_v(self) -> float | None:
        """Return the voltage (V) of the servos' battery; None if the car cannot measure it."""
        try:
            status = self.connection.latest.get("BATTERY_STATUS") or self.request("BATTERY_STATUS")
        except NoCarError:
            return None
        return float(status.voltages[0]) / 1000

    def enter_scene(self, scene_id: str) -> bool:
        """Move a disarmed simulated car to the scene with this id; return whether it has moved."""
        for _ in range(TRIES):
            self.connection.send(self.dialect.MAVLink_foldcar_scene_message(scene_id.encode()))
            if self.connection.wait_for(lambda m: m.get_type() == "FOLDCAR_SCENE" and m.id == scene_id, ANSWER_S):
                return True
        return False

    def request(self, name: str) -> Any:
        """Request the message of that name and return it. Raises NoCarError if it does not arrive."""
        number = getattr(self.dialect, f"MAVLINK_MSG_ID_{name}")
        for _ in range(TRIES):
            # Sent with count 0, because the car acknowledges retries without handling them again.
            self._send_command(self.dialect.MAV_CMD_REQUEST_MESSAGE, (number,), 0)
            message = self.connection.wait_for(lambda m: m.get_type() == name, ANSWER_S)
            if message is not None:
                return message
        raise NoCarError(f"{self.port}: the car does not answer the request for {name}; {OTHER_FIRMWARE}")

    def crash_report(self) -> Any | None:
        """Request the FOLDCAR_CRASH message of the crash that ended the car's last run; None if it has no report."""
        number, command = self.dialect.MAVLINK_MSG_ID_FOLDCAR_CRASH, self.dialect.MAV_CMD_REQUEST_MESSAGE

        def is_answer(message: Any) -> bool:
            """Return whether a message is the report, or acknowledges the request for it."""
            return message.get_type() == "FOLDCAR_CRASH" or self._acknowledges(message, command)

        for _ in range(TRIES):
            self._send_command(command, (number,), 0)
            answer = self.connection.wait_for(is_answer, ANSWER_S)
            if answer is None:
                continue
            if answer.get_type() == "FOLDCAR_CRASH":
                return answer
            # The car sends the report before it accepts the request. So the report was lost, or the car refuses the
            # request, because it has none.
            is_refused = answer.result != self.dialect.MAV_RESULT_ACCEPTED
            if is_refused:
                return None
        return None

    def arm(self) -> None:
        """Arm the car, so that trials may start; outputs still have no pulses. Raises CommandRefusedError."""
        self._command("arm", self.dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def disarm(self) -> None:
        """Disarm the car: no pulses until it is armed again. Raises CommandRefusedError during a fault."""
        self._command("disarm", self.dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def start_trial(
        self,
        speed_m_s: float,
        yaw_rate_rad_s: float,
        time_limit_s: float,
        trial: int,
        untethered: bool = False,
        delay_s: float = 0.0,
        button: bool = False,
    ) -> None:
        """Start trial number ``trial``: drive at constant speed and yaw rate until the time limit.

        The car first counts down ``delay_s``. If ``button`` is True, the countdown begins when the car's button is
        pressed. An ``untethered`` trial continues without a host, and the car stores its log. Raises CommandRefusedError.
        """
        dialect = self.dialect
        flags = 0
        if untethered:
            flags |= dialect.FOLDCAR_TRIAL_FLAGS_UNTETHERED
        if button:
            flags |= dialect.FOLDCAR_TRIAL_FLAGS_BUTTON
        # In the order of the command's parameters in foldcar.xml.
        values = speed_m_s, yaw_rate_rad_s, time_limit_s, float(flags), float(trial), delay_s
        self._command("start", dialect.MAV_CMD_FOLDCAR_START_TRIAL, *values)

    def is_under_way(self, trial: Any) -> bool:
        """Return whether the trial of a FOLDCAR_TRIAL message drives, counts down, or waits for the car's button."""
        dialect = self.dialect
        if trial.state == dialect.FOLDCAR_STATE_ARMED:
            return bool(trial.flags & dialect.FOLDCAR_TRIAL_FLAGS_BUTTON and trial.end == dialect.FOLDCAR_END_NONE)
        return trial.state in (dialect.FOLDCAR_STATE_RUNNING, dialect.FOLDCAR_STATE_COUNTING)

    def stop_trial(self) -> None:
        """Stop a trial or an output test. Raises CommandRefusedError if neither is running."""
        self._command("stop", self.dialect.MAV_CMD_FOLDCAR_STOP_TRIAL)

    def acknowledge_fault(self, without_design: bool = False) -> None:
        """Clear a latched fault. Raises CommandRefusedError if no fault is latched, or its cause persists.

        ``without_design`` also confirms that the stored parameters describe a car without a readable car.json.
        """
        self._command("clear its fault", self.dialect.MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, float(without_design))

    def test_output(self, output: int, pulse_us: float | None, timeout_s: float) -> None:
        """Send pulses of 1000 to 2000 µs to one output (1 to 8) for ``timeout_s``; None: no pulses."""
        # MAV_CMD_ACTUATOR_TEST has a value of -1 to 1 (NaN: no pulses), and numbers servos from 33.
        value = math.nan if pulse_us is None else (pulse_us - 1500) / 500
        command = self.dialect.MAV_CMD_ACTUATOR_TEST
        self._command(f"test output {output}", command, value, timeout_s, 0.0, 0.0, float(32 + output))

    def state(self) -> int:
        """Return the last reported FOLDCAR_STATE of the car."""
        trial = self.connection.latest.get("FOLDCAR_TRIAL") or self.request("FOLDCAR_TRIAL")
        return int(trial.state)

    def fault_text(self) -> str | None:
        """Return the dialect's description of the latched fault; None if there is no fault."""
        trial = self.connection.latest.get("FOLDCAR_TRIAL") or self.request("FOLDCAR_TRIAL")
        if trial.fault == self.dialect.FOLDCAR_FAULT_NONE:
            return None
        entry = self.dialect.enums["FOLDCAR_FAULT"].get(trial.fault)
        return str(entry.description).rstrip(".") if entry is not None else f"fault {trial.fault}"

    def _command(self, action: str, command: int, *values: float) -> None:
        """Send a command with up to seven ``values`` until the car acknowledges it.

        Raises CommandRefusedError, which names the ``action``, if the car refuses it or does not answer.
        """
        self.connection.warning_text = None
        for repetition in range(TRIES):
            self._send_command(command, values, repetition)
            ack = self.connection.wait_for(lambda m: self._acknowledges(m, command), ANSWER_S)
            if ack is None:
                continue
            if ack.result == self.dialect.MAV_RESULT_ACCEPTED:
                return
            raise CommandRefusedError(f"the car refuses to {action}: {self._reason(ack)}")
        raise CommandRefusedError(f"the car does not acknowledge the command to {action}")

    def _acknowledges(self, message: Any, command: int) -> bool:
        """Return whether a message acknowledges this host's command, and not the same command of another host."""
        if message.get_type() != "COMMAND_ACK" or message.command != command:
            return False
        return message.target_system in (0, HOST_SYSTEM) and message.target_component in (0, HOST_COMPONENT)

    def _reason(self, ack: Any) -> str:
        """Return why the car refused a command, in words."""
        dialect, reason = self.dialect, ack.result_param2
        detail = None
        if reason == dialect.FOLDCAR_REFUSAL_FAULT_LATCHED:
            detail = self.fault_text()
        elif reason in (dialect.FOLDCAR_REFUSAL_DESIGN, dialect.FOLDCAR_REFUSAL_HELD):
            # Before the acknowledgement, the car sends a status text: which host controls it, or what is wrong with
            # car.json.
            detail = (self.connection.warning_text or "").removeprefix("refused: ")
        text = self.refusal_text(reason) or f"result {ack.result}, reason {reason}"
        return f"{text} ({detail})" if detail else text

    def refusal_text(self, reason: int) -> str | None:
        """Return the dialect's description of a FOLDCAR_REFUSAL, with a small first letter; None if it is unknown."""
        entry = self.dialect.enums["FOLDCAR_REFUSAL"].get(reason)
        if entry is None or reason == self.dialect.FOLDCAR_REFUSAL_NONE:
            return None
        text = str(entry.description).rstrip(".")
        return text[0].lower() + text[1:]

    def _send_command(self, command: int, values: tuple[float, ...], repetition: int) -> None:
        """Send a COMMAND_LONG once; missing values are 0. ``repetition`` counts its retries."""
        # A COMMAND_LONG has seven values.
        missing_values = [0.0] * (7 - len(values))
        message = self.dialect.MAVLink_command_long_message(
            CAR_SYSTEM, CAR_COMPONENT, command, repetition, *values, *missing_values
        )
        self.connection.send(message)


def greet(port: str, timeout_s: float = GREETING_S) -> ConnectedCar:
    """Connect to the car at a port, and wait for its heartbeat.

    Raises NoCarError if no heartbeat of a car arrives within ``timeout_s``, FoldcarError if the port cannot be opened.
    """
    busy_until_s = time.monotonic() + BUSY_S
    while True:
        try:
            return _greet_once(port, timeout_s)
        except LinkLostError as error:
            # A program that has just ended may still hold the car.
            if time.monotonic() > busy_until_s:
                message = "it closed the connection at once; another program may be using the car"
                raise NoCarError(f"{port}: {message}") from error
            time.sleep(0.1)


def _greet_once(port: str, timeout_s: float) -> ConnectedCar:
    """Connect to the car at a port, and wait for its heartbeat.

    Raises NoCarError if no heartbeat of a car arrives within ``timeout_s``, and LinkLostError if the connection is closed
    before.
    """
    connection = connect(port)
    dialect = connection.dialect
    try:
        heartbeat = connection.wait_for(lambda m: m.get_type() == "HEARTBEAT", timeout_s)
        if heartbeat is None:
            received = "bytes that are not MAVLink" if connection.damaged else "nothing"
            raise NoCarError(f"{port}: not a car: it sent {received} for {timeout_s:g} s; {OTHER_FIRMWARE}")
        if heartbeat.type != dialect.MAV_TYPE_GROUND_ROVER or heartbeat.autopilot != dialect.MAV_AUTOPILOT_GENERIC:
            raise NoCarError(f"{port}: another MAVLink device (type {heartbeat.type}), not a foldcar; {OTHER_FIRMWARE}")
    except BaseException:
        connection.close()
        raise
    return ConnectedCar(connection)


@contextlib.contextmanager
def greeted(port: str) -> Iterator[ConnectedCar]:
    """Yield the car at a port; close the connection at the end of the block. Raises as :func:`greet`."""
    car = greet(port)
    try:
        yield car
    finally:
        car.connection.close()
