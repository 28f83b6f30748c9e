"""`foldcar` and `python -m foldcar`: end on Ctrl-C, SIGTERM and SIGHUP from the first line on, then run the commands."""

# Python's own module of this name is built on this one; importing it takes as long as all before this line.
import _signal  # type: ignore[import-not-found]
import os


def _end(number: int, frame: object) -> None:
    os.write(2, b"foldcar: stopped\n")
    os._exit(130)


def main() -> None:
    """Run the command line and exit."""
    # Until foldcar.interrupts takes over. What the caller ignores (nohup) stays ignored.
    for number in filter(None, (getattr(_signal, name, None) for name in ("SIGHUP", "SIGINT", "SIGTERM"))):
        if _signal.getsignal(number) != _signal.SIG_IGN:
            _signal.signal(number, _end)
    from foldcar.cli import main as run

    run()


if __name__ == "__main__":
    main()
