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
    """Start this program again with PYTHONHASHSEED=0, unless Python already has this hash seed.

    The hash seed decides in which order Python goes through a set. A program that draws random samples depends on this
    order, so its results are repeatable only with a fixed seed.
    """
    if not sys.flags.hash_randomization:
        return
    # Some options of Python make it ignore the variable. Then a new start would not help.
    if sys.flags.ignore_environment or os.environ.get("PYTHONHASHSEED") == "0":
        message = b"python -E, -I and -R ignore PYTHONHASHSEED, without which samples differ: omit them"
        os.write(2, b"foldcar: error: %s\n" % message)
        sys.exit(2)
    environment = {**os.environ, "PYTHONHASHSEED": "0"}
    if hasattr(signal, "pthread_sigmask"):
        # Signals that arrive meanwhile wait until the new process handles them.
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment)
    # On Windows, replacing a process means that this one ends, and its parent would not wait for the new one. So this
    # process starts a second one and waits.
    import subprocess

    # Ctrl-C reaches both processes. The second one handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(subprocess.call([sys.executable, *sys.orig_argv[1:]], env=environment))


def main() -> None:
    """Run the command line and exit."""
    # These handlers serve until foldcar.interrupts installs its own. A signal that the caller ignores, as nohup does,
    # stays ignored.
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    fix_hash_seed()
    # The import takes long, so the hash seed and the signals come first.
    from foldcar.cli import main as run

    run()


if __name__ == "__main__":
    main()
