"""Entry point of `foldcar` and `python -m foldcar`. From here on a signal ends the command with one line.

Python orders sets of strings by a random seed that it reads only at its start, so a Scenic program that iterates over a
set would draw other scenes in each process. The command therefore starts Python again with the seed 0, which takes some
hundredths of a second because little is imported before.
"""

import os
import signal
import sys
from types import FrameType

# Windows has no SIGHUP.
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


def _end(number: int, frame: FrameType | None) -> None:
    """Handle a signal: print a line and end the process at once, with the exit code of Ctrl-C."""
    os.write(2, b"foldcar: stopped\n")
    os._exit(130)


def fix_hash_seed() -> None:
    """Start this program again with PYTHONHASHSEED 0, unless it runs with that."""
    if not sys.flags.hash_randomization:
        return
    # With -R, Python has a random seed although this variable is 0.
    if sys.flags.ignore_environment or os.environ.get("PYTHONHASHSEED") == "0":
        message = b"python -E, -I and -R ignore PYTHONHASHSEED, without which samples differ: omit them"
        os.write(2, b"foldcar: error: %s\n" % message)
        sys.exit(2)
    environment = {**os.environ, "PYTHONHASHSEED": "0"}
    if hasattr(signal, "pthread_sigmask"):
        # They wait until the new Python handles them.
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment)
    # Windows cannot replace a process: its parent would see this one end.
    import subprocess

    # Ctrl-C reaches both processes; this one waits for the other.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(subprocess.call([sys.executable, *sys.orig_argv[1:]], env=environment))


def main() -> None:
    """Run the command line and exit."""
    # Handles signals until foldcar.interrupts does. Signals that the caller ignores (nohup) stay ignored.
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    fix_hash_seed()
    from foldcar.cli import main as run

    run()


if __name__ == "__main__":
    main()
