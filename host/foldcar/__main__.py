"""`foldcar` and `python -m foldcar`: end on Ctrl-C, SIGTERM and SIGHUP from the first line on, then run the commands."""

# Python's own module of this name is built on this one; importing it takes as long as all before this line.
import _signal  # type: ignore[import-not-found]
import os
import sys

HASH_SEED = "PYTHONHASHSEED"


def _end(number: int, frame: object) -> None:
    os.write(2, b"foldcar: stopped\n")
    os._exit(130)


def _leave_out_working_directory() -> None:
    """`python -m` looks for modules there first, whatever their names; foldcar itself may be there."""
    added = not (sys.flags.isolated or getattr(sys.flags, "safe_path", False))
    if added and __file__ != f"{sys.path[0]}{os.sep}foldcar{os.sep}__main__.py":
        del sys.path[0]


def main() -> None:
    """Run the command line and exit."""
    numbers = [number for number in (getattr(_signal, name, None) for name in ("SIGHUP", "SIGINT", "SIGTERM")) if number]
    # Until foldcar.interrupts takes over. What the caller ignores (nohup) stays ignored.
    for number in numbers:
        if _signal.getsignal(number) != _signal.SIG_IGN:
            _signal.signal(number, _end)
    if hasattr(_signal, "pthread_sigmask"):
        # Python orders sets of texts anew in each process, unless it is told otherwise before it starts: a Scenic
        # program that takes the members of one in turn would give other samples each time. Starting takes 0.01 s.
        if os.environ.get(HASH_SEED) != "0":
            os.environ[HASH_SEED] = "0"
            _signal.pthread_sigmask(_signal.SIG_BLOCK, numbers)
            os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
        _signal.pthread_sigmask(_signal.SIG_UNBLOCK, numbers)
    from foldcar.cli import main as run

    run()


if __name__ == "__main__":
    _leave_out_working_directory()
    main()
