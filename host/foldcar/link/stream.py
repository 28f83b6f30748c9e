"""Finds the port of a car by the USB bridges of Feather boards, or by name, and opens a stream of bytes to it.

Input: the machine's serial ports, or a serial port, a pseudo-terminal (a path such as /dev/ttyUSB0), "tcp:HOST:PORT".
Output: a stream; FoldcarError with a remedy if there is no single port or it cannot be opened, LinkLostError once the
other end has closed.
"""

import errno
import os
import select
import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.system import CAN_SELECT_FILES, ThreadedPort

BAUD = 115200
CONNECT_S = 5.0
# If the port's buffer stays full for this long, the car has stopped reading.
WRITE_S = 1.0
READ_BYTES = 65536
# How long a thread waits for a byte of a port that `select` cannot wait for.
READ_S = 0.05
TCP = "tcp:"
# USB (vendor, product) numbers of the bridges on ESP32 Feather boards of all revisions.
BRIDGES = {
    (0x10C4, 0xEA60): "CP2104 (Feather HUZZAH32)",
    (0x1A86, 0x55D4): "CH9102F (Feather HUZZAH32 V2)",
    (0x1A86, 0x55D3): "CH343",
    (0x1A86, 0x7523): "CH340",
    (0x0403, 0x6001): "FT232R",
    (0x0403, 0x6015): "FT231X",
}
# How the paths of serial ports begin, on Linux and on macOS; Windows has COM1 and so on.
SERIAL_PATHS = ("/dev/tty", "/dev/cu.")


class LinkLostError(FoldcarError):
    """The other end has closed: the cable is unplugged, the board is off, or the simulator has ended."""


class Stream:
    """A stream of bytes to and from a car, by a port that does not block.

    ``name`` is the port's name as on the command line. ``read`` and ``write`` have the arguments of os.read and os.write
    without the descriptor; those functions do not work for sockets on Windows.
    """

    def __init__(self, name: str, port: Any, read: Callable[[int], bytes], write: Callable[[bytes], int]) -> None:
        self.name = name
        self._port, self._read_bytes, self._write_bytes = port, read, write

    def fileno(self) -> int:
        """The file descriptor for `select`."""
        return int(self._port.fileno())

    def read(self) -> bytes:
        """Return the available bytes, at least one after `select` reports input. Raises LinkLostError."""
        try:
            data = self._read_bytes(READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._lost_error(error) from error
        # An unplugged USB port and a closed socket report input and then deliver no bytes.
        if not data:
            raise LinkLostError(f"{self.name}: the connection is lost")
        return data

    def write(self, data: bytes) -> None:
        """Write all of ``data``. Raises LinkLostError."""
        remaining = data
        while remaining:
            try:
                written_count = self._write_bytes(remaining)
            except BlockingIOError:
                # The port's buffer is full, so wait until the port accepts more.
                _, writable, _ = select.select([], [self], [], WRITE_S)
                if not writable:
                    raise LinkLostError(f"{self.name}: the car has accepted no bytes for {WRITE_S:g} s") from None
            except OSError as error:
                raise self._lost_error(error) from error
            else:
                remaining = remaining[written_count:]

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _lost_error(self, error: OSError) -> LinkLostError:
        """Return the error that the connection is lost, with the system's reason."""
        return LinkLostError(f"{self.name}: the connection is lost ({error.strerror})")


def open_stream(name: str) -> Stream:
    """Open a port by its name: a serial port's path, or tcp:HOST:PORT. Raises FoldcarError."""
    return _open_tcp(name) if name.startswith(TCP) else _open_serial(name)


def _open_serial(name: str) -> Stream:
    """Open a serial port or pseudo-terminal. Raises FoldcarError, which says why it cannot be opened."""
    import serial

    if CAN_SELECT_FILES:
        if not Path(name).exists():
            raise FoldcarError(f"{name}: no such port")
        if not Path(name).is_char_device():
            raise FoldcarError(f"{name}: not a serial port")
    try:
        # Access is exclusive, because two programs that read the same port would each get a part of the packets. On
        # Windows it is always exclusive.
        port = serial.Serial(name, BAUD, timeout=0 if CAN_SELECT_FILES else READ_S, exclusive=True)
    except (OSError, serial.SerialException) as error:
        raise FoldcarError(_cannot_open_text(name, error)) from error
    if CAN_SELECT_FILES:
        descriptor = port.fileno()
        os.set_blocking(descriptor, False)
        return Stream(name, port, read=partial(os.read, descriptor), write=partial(os.write, descriptor))

    def read_some() -> bytes:
        """Wait up to READ_S for the first byte, and return all bytes that have arrived."""
        return bytes(port.read(port.in_waiting or 1))

    def write_some(data: bytes) -> int:
        """Write bytes and return how many were written."""
        return int(port.write(data) or 0)

    threaded_port = ThreadedPort(read_some, port.close)
    return Stream(name, threaded_port, read=threaded_port.take, write=write_some)


def _cannot_open_text(name: str, error: Exception) -> str:
    """Return a message about a serial port that cannot be opened because of ``error``, with a remedy."""
    number = getattr(error, "errno", None)
    if number == errno.EACCES:
        return permission_text(name)
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return f"{name}: another program uses this port; close it first"
    # pyserial raises termios.error for other devices; compared by name, because Windows has no module termios.
    if type(error.__context__).__module__ == "termios":
        return f"{name}: not a serial port"
    reason = os.strerror(number) if number else str(error)
    return f"{name}: cannot be opened: {reason}"


def permission_text(name: str) -> str:
    """Return the message for a port that the user may not open, with the remedy."""
    # Imported here, because Windows does not have this module.
    import grp

    number = Path(name).stat().st_gid
    try:
        group = grp.getgrgid(number).gr_name
    except KeyError:
        group = str(number)
    return (
        f"{name}: no permission: the port belongs to group {group}; "
        f"`sudo usermod -aG {group} $USER`, then log out and in again"
    )


def _open_tcp(name: str) -> Stream:
    """Connect to ``tcp:HOST:PORT``. Raises FoldcarError if it cannot be reached."""
    host, colon, port = name.removeprefix(TCP).rpartition(":")
    if not colon or not (port.isascii() and port.isdecimal()) or not 0 < int(port) < 65536:
        raise FoldcarError(f"{name}: not tcp:HOST:PORT")
    try:
        connection = socket.create_connection((host, int(port)), CONNECT_S)
    except OSError as error:
        raise FoldcarError(f"{name}: cannot be reached: {error.strerror or error}") from error
    except UnicodeError:
        raise FoldcarError(f'{name}: "{host}" is not a host name') from None
    # Send small packets at once.
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)
    return Stream(name, connection, connection.recv, connection.send)


@dataclass(frozen=True, slots=True)
class UsbPort:
    """A serial port: its path, its bridge or description, and whether the bridge is a Feather's."""

    path: str
    description: str
    is_feather: bool


def usb_ports() -> list[UsbPort]:
    """Return the USB serial ports of this machine, those with a Feather's bridge first."""
    from serial.tools.list_ports import comports

    ports = []
    for port in comports():
        if port.vid is None:
            continue
        bridge = BRIDGES.get((port.vid, port.pid))
        ports.append(UsbPort(port.device, bridge or port.description or "USB serial", bridge is not None))
    return sorted(ports, key=lambda port: (not port.is_feather, port.path))


def choose_port(named: str | None) -> str:
    """Return ``named`` or, if it is None, the only port with a Feather's USB bridge.

    Raises FoldcarError, with advice, if there is no such port, or several.
    """
    if named is not None:
        return named
    ports = usb_ports()
    feathers = [port for port in ports if port.is_feather]
    if len(feathers) == 1:
        return feathers[0].path
    if feathers:
        ports_text = ", ".join(f"{port.path} ({port.description})" for port in feathers)
        raise FoldcarError(f"several cars may be plugged in: {ports_text}; choose one with --port")
    if ports:
        ports_text = ", ".join(f"{port.path} ({port.description})" for port in ports)
        raise FoldcarError(
            f"no port with a Feather's USB bridge; if one of these is the car, name it: --port {ports_text}"
        )
    raise FoldcarError(
        "no car is plugged in: no USB serial port found; check that the cable carries data, or name one with --port"
    )
