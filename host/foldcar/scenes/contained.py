"""Runs code of a Scenic program so that this process survives it, in time and where it was.

A program is code with the user's rights, and by mistake it may end the process or leave its folder: then what was asked
for would silently not be done, or be written somewhere else.
"""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.scenes.time_limit import time_limit

OWN = __name__.partition(".")[0]


@contextlib.contextmanager
def contained(limit_s: float, what: str, program: Path) -> Iterator[None]:
    """Raise a FoldcarError that begins with ``what`` if code of ``program`` in the block takes too long or ends Python.

    After the block the working folder is what it was before.
    """
    from foldcar.scenes.program import one_line

    ending, owner = os._exit, (os.getpid(), threading.get_ident())

    def refuse(code: int) -> None:
        # A signal's handler and the copies that a program makes of the process may end.
        own = sys._getframe(1).f_globals.get("__name__", "").partition(".")[0] == OWN
        if own or owner != (os.getpid(), threading.get_ident()):
            ending(code)
        raise SystemExit(f"os._exit({code})")

    folder = _working_folder()
    os._exit = refuse  # type: ignore[assignment]
    try:
        with time_limit(limit_s, what):
            yield
    except (SystemExit, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            raise  # can be a Ctrl-C; foldcar's commands do not raise theirs while a program runs
        raise FoldcarError(f"{what}: {one_line(error, program)}") from error
    finally:
        os._exit = ending
        if folder is not None and _working_folder() != folder:
            os.chdir(folder)


def _working_folder() -> Path | None:
    """None if it has been removed."""
    try:
        return Path.cwd()
    except FileNotFoundError:
        return None
