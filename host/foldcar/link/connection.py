"""A connection to a car: packets in and out, the host's heartbeat, the log of both directions.

Input: a port. Output: messages of the dialect. A connection belongs to one thread. A second thread sends the heartbeats:
after 0.45 s of its clock without a packet, a driving car stops. The second thread neither prints nor writes the log, so a
blocked terminal or a slow disk does not stop the car. It pauses when the first thread has not listened for LISTENING_S,
because then nobody could stop the car. A stopped process (Ctrl-Z) sends nothing. In an accelerated simulation the car's
clock runs faster than the host's.
"""

import contextlib
import select
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from foldcar.link.car_messages import checked_message
from foldcar.link.dialect import load_dialect
from foldcar.link.stream import LinkLostError, Stream, open_stream
from foldcar.link.tlog import TlogWriter

HOST_SYSTEM, HOST_COMPONENT = 255, 190
CAR_SYSTEM, CAR_COMPONENT = 1, 1
# The component that sends the simulated car's true state (FOLDCAR_TRUTH) in `carsim link`.
SIMULATOR_COMPONENT = 25
# Interval of heartbeats on the car's clock; the car's time-out is CMD_TIMEOUT_MS, 0.45 s.
HEARTBEAT_S = 0.1
MIN_HEARTBEAT_S = 0.002
# Heartbeats pause after this time without a call of `receive`, because the keys that stop the car are read beside it.
LISTENING_S = 2.0
# Longest part of the car's silence that one call of `receive` can observe: a host that stood still was not listening.
MAX_LISTENED_S = 0.2
# Time limit of `catch_up`.
CATCH_UP_S = 1.0
# Maximum length of a car's status text, in characters.
MAX_STATUS_LENGTH = 1000


class Connection:
    """A connection to a car. Create it with :func:`connect`.

    ``latest`` has the car's last message of each type, by the type's name. ``status_text`` is the car's last status
    text (STATUSTEXT), joined from its parts; it is None before the first one. ``warning_text`` is the last of these
    texts that was a warning or an error. If ``log`` is set, every packet of both directions is written to it.
    ``received`` counts the packets of the car, and ``lost`` the packets that are missing according to their numbers.
    ``damaged`` counts invalid packets and messages with impossible numbers. ``clock_rate`` is how fast the car's clock
    goes.
    """

    def __init__(self, stream: Stream) -> None:
        """Start sending heartbeats over ``stream``, in a thread of its own."""
        # These attributes are described above.
        self.stream = stream
        self.dialect = load_dialect()
        self.latest: dict[str, Any] = {}
        self.status_text: str | None = None
        self.warning_text: str | None = None
        self.log: TlogWriter | None = None
        self.received = 0
        self.lost = 0
        self.damaged = 0
        self.clock_rate = CarClockRate()
        # Reads and writes packets. With robust parsing, damaged bytes become a message instead of an exception.
        self._mav = self.dialect.MAVLink(None, srcSystem=HOST_SYSTEM, srcComponent=HOST_COMPONENT)
        self._mav.robust_parsing = True
        # When the first thread listened last (by time.monotonic()), and for how long the car was silent until then.
        self._listened_at_s = time.monotonic()
        self._silence_s = 0.0
        # The sequence number of the last packet of each component, to count lost packets.
        self._sequences: dict[int, int] = {}
        # If wait_for has found its message, these are the messages that arrived together with it and after it.
        self._unread: list[Any] = []
        # Guards the port's output and the sequence number of packets, because two threads send packets.
        self._sending = threading.Lock()
        # Time (µs since 1970) and packet of heartbeats that are sent, but not yet in the log.
        self._heartbeats: deque[tuple[int, bytes]] = deque()
        self._closed = threading.Event()
        self._heart = threading.Thread(target=self._send_heartbeats, daemon=True)
        self._heart.start()

    def send(self, message: Any) -> None:
        """Send and log a message of the dialect. Raises LinkLostError and LogError."""
        packet = self._send_packet(message)
        self._log_heartbeats()
        if self.log is not None:
            self.log.write(packet)

    def receive(self, timeout_s: float, other_input: Any = None) -> list[Any]:
        """Wait for input and return the car's messages in it; [] after ``timeout_s``, or if ``other_input`` is first.

        Messages of all senders are logged; those of the car are also kept in ``latest``. ``other_input`` is another file
        for `select`, such as the keyboard. Raises LinkLostError and LogError.
        """
        self._log_heartbeats()
        self._listen()
        if self._unread:
            unread, self._unread = self._unread, []
            return unread
        inputs = [self.stream] if other_input is None else [self.stream, other_input]
        # Returns often, so that waiting counts as listening.
        has_input = self.stream in select.select(inputs, [], [], min(timeout_s, MAX_LISTENED_S))[0]
        self._listen()
        if not has_input:
            return []
        messages = []
        for message in self._mav.parse_buffer(self.stream.read()) or []:
            # The checksum of an unknown message cannot be verified, so it counts as damaged.
            if message.get_type() == "BAD_DATA" or message.get_type().startswith("UNKNOWN"):
                self.damaged += 1
                continue
            if self.log is not None:
                self.log.write(bytes(message.get_msgbuf()))
            if message.get_srcSystem() != CAR_SYSTEM:
                continue
            if checked_message(message) is None:
                self.damaged += 1
                continue
            self._count_packet(message)
            self._silence_s = 0.0
            self.latest[message.get_type()] = message
            if message.get_type() == "STATUSTEXT":
                # A long text arrives in several chunks.
                earlier_chunks = (self.status_text or "") if message.chunk_seq else ""
                self.status_text = (earlier_chunks + message.text)[-MAX_STATUS_LENGTH:]
                if message.severity <= self.dialect.MAV_SEVERITY_WARNING:
                    self.warning_text = self.status_text
            if message.get_type() == "FOLDCAR_TRIAL":
                self.clock_rate.add(message.time_boot_ms / 1000, self._listened_at_s)
            messages.append(message)
        return messages

    def catch_up(self) -> None:
        """Receive all messages that have arrived already, so that the next message is current."""
        end_s = time.monotonic() + CATCH_UP_S
        while self.receive(0.0) and time.monotonic() < end_s:
            pass

    def wait_for(self, is_wanted: Callable[[Any], bool], timeout_s: float) -> Any | None:
        """Return the first message for which ``is_wanted`` is true, or None after ``timeout_s`` (s).

        Messages that arrived with it are returned by the next `receive`.
        """
        end_s = time.monotonic() + timeout_s
        while (remaining_s := end_s - time.monotonic()) > 0:
            messages = self.receive(remaining_s)
            for index, message in enumerate(messages):
                if is_wanted(message):
                    self._unread = messages[index + 1 :]
                    return message
        return None

    def silence_s(self) -> float:
        """Return the time (s) for which this host has listened since the last message of the car."""
        return self._silence_s

    def close(self) -> None:
        """End the heartbeats and close the port."""
        self._closed.set()
        self._heart.join()
        self.stream.close()

    def _listen(self) -> None:
        """Add the time since the last call to the car's silence."""
        now_s = time.monotonic()
        self._silence_s += min(now_s - self._listened_at_s, MAX_LISTENED_S)
        self._listened_at_s = now_s

    def _count_packet(self, message: Any) -> None:
        """Count a received packet, and the packets that were lost before it.

        Each component of a car numbers its packets modulo 256, so lost packets leave a gap in the numbers.
        """
        component, sequence = message.get_srcComponent(), message.get_seq()
        if component in self._sequences:
            expected_sequence = self._sequences[component] + 1
            self.lost += (sequence - expected_sequence) % 256
        self._sequences[component] = sequence
        self.received += 1

    def _send_packet(self, message: Any) -> bytes:
        """Send a message and return its packet. Raises LinkLostError."""
        with self._sending:
            packet = bytes(message.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256
            self.stream.write(packet)
        return packet

    def _send_heartbeats(self) -> None:
        """Send heartbeats until the connection is closed. If the car's clock is faster, they are sent more often.

        This runs in a thread of its own.
        """
        dialect = self.dialect
        # The zeros are modes, which a ground station does not have; 3 is MAVLink's version.
        heartbeat = dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
        )
        interval_s = 0.0
        while not self._closed.wait(interval_s):
            interval_s = max(MIN_HEARTBEAT_S, HEARTBEAT_S / self.clock_rate.value)
            # If this program has not listened for so long, it hangs and could not stop the car. Without heartbeats the
            # car stops by itself.
            if time.monotonic() - self._listened_at_s > LISTENING_S:
                continue
            # If the link is lost, the thread that receives messages notices it and reports it.
            with contextlib.suppress(LinkLostError):
                packet, log = self._send_packet(heartbeat), self.log
                if log is not None:
                    self._heartbeats.append((log.now_us(), packet))

    def _log_heartbeats(self) -> None:
        """Write the heartbeats that were sent meanwhile to the log, if there is one. Raises LogError."""
        while self._heartbeats:
            time_us, packet = self._heartbeats.popleft()
            if self.log is not None:
                self.log.write(packet, time_us)


class _ClockTimes(NamedTuple):
    """The times of both clocks at one moment."""

    car_s: float
    host_s: float


class CarClockRate:
    """Measures how fast the car's clock goes relative to the host's.

    ``value`` is 1 for a real car, and more in a simulation that is faster than real time. It is never below 1, because
    a slow simulation does not need fewer heartbeats.
    """

    # The host's time between two measurements.
    SPAN_S = 0.3

    def __init__(self) -> None:
        self.value = 1.0
        # The times at which the present measurement began; None before the first one.
        self._began: _ClockTimes | None = None

    def add(self, car_s: float, host_s: float) -> None:
        """Add a time since boot that the car reported, and the host's time of its arrival (both s).

        Each measurement takes at least SPAN_S. If the car's clock goes backwards, the car has restarted, and so does the
        measurement.
        """
        now = _ClockTimes(car_s, host_s)
        if self._began is None or now.car_s < self._began.car_s:
            self._began = now
            return
        host_span_s = now.host_s - self._began.host_s
        if host_span_s >= self.SPAN_S:
            car_span_s = now.car_s - self._began.car_s
            # A slow simulation does not need fewer heartbeats.
            self.value = max(1.0, car_span_s / host_span_s)
            self._began = now


def connect(port: str) -> Connection:
    """Open a port (a path, or tcp:HOST:PORT) and load the dialect. Raises FoldcarError if it cannot be opened."""
    load_dialect()
    return Connection(open_stream(port))
