"""An open way to a car: a serial port, a pseudo-terminal, or a TCP connection, as bytes.

Input: a path such as /dev/ttyUSB0 or "tcp:HOST:PORT". Output: a stream; FoldcarError with what to do if it cannot
be opened, LinkLostError once the other end is gone.
"""

import errno
import grp
import os
import select
import socket
from pathlib import Path
from typing import Protocol

from foldcar.errors import FoldcarError

BAUD = 115200
CONNECT_S = 5.0
# A car takes no more at once; a full buffer for this long means that nobody reads.
WRITE_S = 1.0
READ_BYTES = 65536
TCP = "tcp:"


class LinkLostError(FoldcarError):
    """The other end is gone: the cable is pulled, the board is off, the simulator has ended."""


class Stream(Protocol):
    """Bytes to and from a car. ``name`` is the port as a person writes it."""

    name: str

    def fileno(self) -> int:
        """What `select` waits for."""

    def read(self) -> bytes:
        """What is there, at least a byte once `select` says so; LinkLostError."""

    def write(self, data: bytes) -> None:
        """All of ``data``; LinkLostError."""

    def close(self) -> None:
        """Give the port back."""


def open_stream(name: str) -> Stream:
    """The stream for a port's name."""
    return _open_tcp(name) if name.startswith(TCP) else _open_serial(name)


class _FileStream:
    """A stream over a file descriptor that does not block."""

    def __init__(self, name: str, descriptor: int) -> None:
        self.name = name
        self._descriptor = descriptor

    def fileno(self) -> int:
        return self._descriptor

    def read(self) -> bytes:
        try:
            data = os.read(self._descriptor, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._lost(error) from error
        # Nothing to read where something was said to be: how a pulled USB port and a closed socket look.
        if not data:
            raise LinkLostError(f"{self.name}: the connection is lost")
        return data

    def write(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:
                if not select.select([], [self._descriptor], [], WRITE_S)[1]:
                    raise LinkLostError(f"{self.name}: the car takes no more bytes") from None
            except OSError as error:
                raise self._lost(error) from error

    def _lost(self, error: OSError) -> LinkLostError:
        return LinkLostError(f"{self.name}: the connection is lost ({error.strerror})")


class _SerialStream(_FileStream):
    def __init__(self, name: str) -> None:
        import serial

        # Exclusive: two programs that read one port each get half of the packets.
        self._port = serial.Serial(name, BAUD, timeout=0, exclusive=True)
        super().__init__(name, self._port.fileno())
        os.set_blocking(self._descriptor, False)

    def close(self) -> None:
        self._port.close()


class _TcpStream(_FileStream):
    def __init__(self, name: str, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), CONNECT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        super().__init__(name, self._socket.fileno())
        self._socket.setblocking(False)

    def close(self) -> None:
        self._socket.close()


def _open_serial(name: str) -> Stream:
    import serial

    if not Path(name).exists():
        raise FoldcarError(f"{name}: no such port")
    if not Path(name).is_char_device():
        raise FoldcarError(f"{name}: is no serial port")
    try:
        return _SerialStream(name)
    except (OSError, serial.SerialException) as error:
        number = getattr(error, "errno", None)
        if number == errno.EACCES:
            raise FoldcarError(permission_text(name)) from error
        if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
            raise FoldcarError(f"{name}: another program uses this port; close it first") from error
        raise FoldcarError(f"{name}: cannot be opened: {error}") from error


def permission_text(name: str) -> str:
    """What to do about a port that belongs to others."""
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
    host, colon, port = name.removeprefix(TCP).rpartition(":")
    if not colon or not port.isdecimal() or not 0 < int(port) < 65536:
        raise FoldcarError(f"{name}: is not tcp:HOST:PORT")
    try:
        return _TcpStream(name, host, int(port))
    except OSError as error:
        raise FoldcarError(f"{name}: cannot be reached: {error.strerror or error}") from error
