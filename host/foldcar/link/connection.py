"""A connection to a car: packets in and out, the host's heartbeat, the log of both directions.

One thread owns it. Whoever waits calls :meth:`Connection.receive`, which also keeps the heartbeat going; a car
takes silence of half a second for a lost link, by its own clock, which is faster than ours in a fast simulation.
"""

import select
import time
from collections.abc import Callable
from typing import Any

from foldcar.link.stream import Stream, open_stream
from foldcar.link.tlog import TlogWriter
from foldcar.mavlink_dialect import load_dialect

HOST_SYSTEM, HOST_COMPONENT = 255, 190
CAR_SYSTEM, CAR_COMPONENT = 1, 1
# Between heartbeats, by the car's clock: well within its time-out.
HEARTBEAT_S = 0.1
SHORTEST_HEARTBEAT_S = 0.002
CATCH_UP_S = 1.0


class Connection:
    """Made by :func:`connect`. ``latest`` holds the last message of each type that the car sent, by its name.

    ``log``, if set, gets every packet of both directions. ``received``, ``lost`` and ``damaged`` count
    the car's packets, those that are missing between them, and what was received and is no packet.
    """

    def __init__(self, stream: Stream) -> None:
        self.stream = stream
        self.dialect = load_dialect()
        self.latest: dict[str, Any] = {}
        self.log: TlogWriter | None = None
        self.received = 0
        self.lost = 0
        self.damaged = 0
        self.last_received_s = time.monotonic()
        self._mav = self.dialect.MAVLink(None, srcSystem=HOST_SYSTEM, srcComponent=HOST_COMPONENT)
        self._mav.robust_parsing = True
        self._heartbeat_at_s = 0.0
        self._clock_rate = CarClockRate()
        self._sequences: dict[int, int] = {}
        self._unread: list[Any] = []

    def send(self, message: Any) -> None:
        """Send a message of the dialect; LinkLostError, LogError."""
        packet = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        self.stream.write(packet)
        if self.log is not None:
            self.log.write(packet)

    def receive(self, timeout_s: float, also: Any = None) -> list[Any]:
        """The messages that came, after at most ``timeout_s``; none if that passed, or ``also`` has input.

        Messages of any sender are logged, those of the car returned and kept as ``latest``.
        """
        self._beat()
        if self._unread:
            unread, self._unread = self._unread, []
            return unread
        until = min(timeout_s, max(0.0, self._heartbeat_at_s - time.monotonic()))
        waiting = [self.stream] if also is None else [self.stream, also]
        if self.stream not in select.select(waiting, [], [], until)[0]:
            return []
        messages = []
        for message in self._mav.parse_buffer(self.stream.read()) or []:
            # What the dialect does not know has no checksum that could be checked: it is noise as well.
            if message.get_type() == "BAD_DATA" or message.get_type().startswith("UNKNOWN"):
                self.damaged += 1
                continue
            if self.log is not None:
                self.log.write(bytes(message.get_msgbuf()))
            if message.get_srcSystem() != CAR_SYSTEM:
                continue
            self._count(message)
            self.last_received_s = time.monotonic()
            self.latest[message.get_type()] = message
            if message.get_type() == "FOLDCAR_TRIAL":
                self._clock_rate.add(message.time_boot_ms / 1000, self.last_received_s)
            messages.append(message)
        return messages

    def catch_up(self) -> None:
        """Take in what has piled up while nobody was receiving, so that what comes next is new."""
        end_s = time.monotonic() + CATCH_UP_S
        while self.receive(0.0) and time.monotonic() < end_s:
            pass

    def wait_for(self, wanted: Callable[[Any], bool], timeout_s: float) -> Any | None:
        """The first message that is ``wanted``; None if ``timeout_s`` passes without. What came with it stays."""
        end_s = time.monotonic() + timeout_s
        while (left_s := end_s - time.monotonic()) > 0:
            messages = self.receive(left_s)
            for index, message in enumerate(messages):
                if wanted(message):
                    self._unread = messages[index + 1 :]
                    return message
        return None

    def silence_s(self) -> float:
        """How long nothing has come from the car."""
        return time.monotonic() - self.last_received_s

    def close(self) -> None:
        """Close the port."""
        self.stream.close()

    def _count(self, message: Any) -> None:
        """Each component of a car numbers its packets from 0 to 255, over and over."""
        component, sequence = message.get_srcComponent(), message.get_seq()
        self.lost += (sequence - self._sequences.get(component, sequence - 1) - 1) % 256
        self._sequences[component] = sequence
        self.received += 1

    def _beat(self) -> None:
        now_s = time.monotonic()
        if now_s < self._heartbeat_at_s:
            return
        self._heartbeat_at_s = now_s + max(SHORTEST_HEARTBEAT_S, HEARTBEAT_S / self._clock_rate.value)
        d = self.dialect
        self.send(d.MAVLink_heartbeat_message(d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_INVALID, 0, 0, d.MAV_STATE_ACTIVE, 3))


class CarClockRate:
    """How much faster the car's clock goes than ours: 1, or a simulation's speed-up. At least 1."""

    SPAN_S = 0.3

    def __init__(self) -> None:
        self.value = 1.0
        self._first: tuple[float, float] | None = None

    def add(self, car_s: float, host_s: float) -> None:
        """The car's time since boot, and ours when it came."""
        if self._first is None or car_s < self._first[0]:
            self._first = (car_s, host_s)
            return
        passed_s = host_s - self._first[1]
        if passed_s >= self.SPAN_S:
            self.value = max(1.0, (car_s - self._first[0]) / passed_s)
            self._first = (car_s, host_s)


def connect(port: str) -> Connection:
    """Open a port (a path, or tcp:HOST:PORT) and load the dialect; FoldcarError."""
    load_dialect()
    return Connection(open_stream(port))
