"""Entry point of `foldcar` and `python -m foldcar`. From here on a signal ends the command with one line."""

import os
import signal
from types import FrameType


def _end(number: int, frame: FrameType | None) -> None:
    """Handle a signal: print a line and end the process at once, with the exit code of Ctrl-C."""
    os.write(2, b"foldcar: stopped\n")
    os._exit(130)


def main() -> None:
    """Run the command line and exit."""
    # Handles signals until foldcar.interrupts does. Signals that the caller ignores (nohup) stay ignored.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)
    from foldcar.cli import main as run

    run()


if __name__ == "__main__":
    main()
