"""What differs between operating systems: typed input, serial ports to wait for, groups of processes.

Linux and macOS wait for any file descriptor with `select`. On Windows `select` takes sockets only: threads read there.
Nothing else in foldcar asks which system it runs on.
"""

import contextlib
import importlib
import os
import queue
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

# The file descriptor of standard input.
INPUT = 0
# How many bytes of standard input are read at once, at most.
READ_BYTES = 4096
# Whether `select` waits for terminals and serial ports.
CAN_SELECT_FILES = sys.platform != "win32"
# Characters that Windows' console returns: for Ctrl-C, and as the first of two characters that stand for a special key,
# such as an arrow.
CTRL_C, FIRST_OF_TWO = "\x03", "\x00\xe0"
# How often Windows' console is asked for a key.
CONSOLE_PERIOD_S = 0.01


def end_group(process: "subprocess.Popen[Any]", number: int) -> None:
    """Send signal ``number`` to a process started with ``start_new_session``, and to the processes that it started."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, number)
    else:
        process.terminate()


def kill_group(process: "subprocess.Popen[Any]") -> None:
    """Kill a process started with ``start_new_session``, and the processes that it started."""
    end_group(process, getattr(signal, "SIGKILL", signal.SIGTERM))


class ThreadedPort:
    """Makes a port with a blocking ``read`` usable with `select`: a thread copies its bytes to a socket.

    ``read`` returns b"" after a while without bytes, and raises OSError when the port is gone. ``close`` closes the port.
    """

    def __init__(self, read: Callable[[], bytes], close: Callable[[], None]) -> None:
        self._read, self._close = read, close
        self._ours, self._theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._ended = False
        threading.Thread(target=self._copy, daemon=True).start()

    def _copy(self) -> None:
        """Copy bytes from the port to the socket until the port is closed."""
        with contextlib.suppress(OSError, ValueError), self._theirs:
            while not self._ended:
                if data := self._read():
                    self._theirs.sendall(data)

    def fileno(self) -> int:
        """Return the file descriptor for `select`."""
        return self._ours.fileno()

    def take(self, size: int) -> bytes:
        """Return at most ``size`` available bytes; b"" when the port is gone. Raises BlockingIOError if none arrived."""
        return self._ours.recv(size)

    def close(self) -> None:
        """Close the port."""
        self._ended = True
        self._close()
        self._ours.close()


class TypedInput:
    """Standard input, read by its descriptor, because Python's buffer would hide lines from `select`."""

    def __init__(self) -> None:
        self.is_terminal = os.isatty(INPUT)
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        # Windows' console says whether a key was pressed; for a pipe or file nothing does.
        self._console: Any = importlib.import_module("msvcrt") if self.is_terminal and not CAN_SELECT_FILES else None
        if not self.is_terminal and not CAN_SELECT_FILES:
            threading.Thread(target=self._copy, daemon=True).start()

    def _copy(self) -> None:
        """Put what is read from standard input into the queue, and b"" at its end."""
        while data := os.read(INPUT, READ_BYTES):
            self._lines.put(data)
        self._lines.put(b"")

    @property
    def waitable(self) -> int | None:
        """The descriptor for `select` if keys can be waited for, else None."""
        return INPUT if self.is_terminal and CAN_SELECT_FILES else None

    def read(self, wait_s: float) -> bytes | None:
        """Return what was typed, b"" at the end of input; None if nothing was typed within ``wait_s``."""
        if CAN_SELECT_FILES:
            readable, _, _ = select.select([INPUT], [], [], wait_s)
            return os.read(INPUT, READ_BYTES) if readable else None
        if self._console is not None:
            # When the first key of a line was pressed, reading waits until the line is complete.
            return os.read(INPUT, READ_BYTES) if self._pressed_within(wait_s) else None
        # On Windows, a thread reads a pipe or a file.
        try:
            return self._lines.get(timeout=wait_s)
        except queue.Empty:
            return None

    def _pressed_within(self, wait_s: float) -> bool:
        """Return whether a key is pressed within ``wait_s`` in the console of Windows.

        Windows cannot wait for a key with a timeout, so this asks again and again.
        """
        end_s = time.monotonic() + wait_s
        while not self._console.kbhit():
            if time.monotonic() >= end_s:
                return False
            time.sleep(CONSOLE_PERIOD_S)
        return True

    @contextlib.contextmanager
    def keys(self) -> Iterator[Callable[[], str | None]]:
        """Yield a function that returns the last key that was pressed, or None if there was none.

        The function does not wait, and a key needs no Enter. Keys that were pressed before the block do not count, and
        keys that are left over at its end are dropped.
        """
        if not self.is_terminal:
            yield lambda: None
        elif self._console is not None:
            self._drop_console_keys()
            yield self._last_console_key
            self._drop_console_keys()
        else:
            with self._single_keys():
                yield self._last_key

    @contextlib.contextmanager
    def _single_keys(self) -> Iterator[None]:
        """Within the block, let the terminal pass on each key at once, instead of a line after Enter."""
        termios, tty = importlib.import_module("termios"), importlib.import_module("tty")
        settings_before = termios.tcgetattr(INPUT)
        try:
            tty.setcbreak(INPUT)
            # This drops keys that were pressed before.
            termios.tcflush(INPUT, termios.TCIFLUSH)
            yield
        finally:
            # Keys that are left over must not reach the shell.
            termios.tcflush(INPUT, termios.TCIFLUSH)
            # TCSANOW does not wait until the output is written, because a person may have stopped it with Ctrl-S.
            termios.tcsetattr(INPUT, termios.TCSANOW, settings_before)

    def _drop_console_keys(self) -> None:
        """Read and forget all keys that were pressed in Windows' console. Raises KeyboardInterrupt for Ctrl-C."""
        self._last_console_key()

    def _last_key(self) -> str | None:
        """Return the last character typed, None if nothing was typed."""
        return (self.read(0) or b"").strip()[-1:].decode(errors="replace") or None

    def _last_console_key(self) -> str | None:
        """Return the last key that was pressed in Windows' console, except blanks and Return; None if there is none.

        Raises KeyboardInterrupt for Ctrl-C.
        """
        last_key = None
        while self._console.kbhit():
            key = self._console.getwch()
            if key == CTRL_C:
                raise KeyboardInterrupt
            if key in FIRST_OF_TWO:
                # The second character says which special key it is; no special key has a meaning.
                self._console.getwch()
            elif key.strip():
                last_key = key
        return last_key
