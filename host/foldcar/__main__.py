"""`foldcar` and `python -m foldcar`: end on Ctrl-C, SIGTERM and SIGHUP from the first line on, then run the commands."""

# Python's own module of this name is built on this one; importing it takes as long as all before this line.
import _signal  # type: ignore[import-not-found]
import os
import sys

HASH_SEED = "PYTHONHASHSEED"
# Below this limit of memory, imports and threads fail in many ways, of which MemoryError is one.
ENOUGH_BYTES = 2 << 30


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
    _open_missing()
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
    limit = _memory_limit()
    try:
        from foldcar.cli import main as run

        run()
    except Exception as error:
        if not isinstance(error, MemoryError) and (limit is None or limit >= ENOUGH_BYTES):
            raise
        limited = f" of {limit >> 20} MB (ulimit -v)" if limit is not None else ""
        what = " ".join(f"{type(error).__name__}: {error}".split())[:200].rstrip(": ")
        os.write(2, f"foldcar: error: the memory{limited} seems too little: {what}\n".encode(errors="backslashreplace"))
        sys.exit(2)


def _open_missing() -> None:
    """Open the null device where the caller has closed a standard file: another file would get its number."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest free number is this one; programs that foldcar starts inherit it.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


def _memory_limit() -> int | None:
    """The bytes that this process may have; None without a limit."""
    try:
        import resource
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return limit if limit != resource.RLIM_INFINITY else None


if __name__ == "__main__":
    _leave_out_working_directory()
    main()
