"""What tests do about coverage, with which `make check` runs them: it imports modules and writes files in processes."""

import os
import posix
import sys
import threading

# A thread that ends its process waits as long for another that does.
SAVED_S = 10.0


def unmeasured() -> dict[str, str]:
    """This process's environment without coverage's part of it."""
    return {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}


def save_coverage_once() -> None:
    """From now on a process and its copies save coverage's data once when they end.

    Else two threads that end a copy at once both do, and a copy also saves what it has of its original's.
    """
    if "coverage" not in sys.modules:
        return
    from coverage import Coverage

    ending = threading.Lock()

    def end(code: int) -> None:
        ending.acquire(timeout=SAVED_S)
        measured = Coverage.current()
        if measured is not None:
            measured.save()
        posix._exit(code)

    os._exit = end  # type: ignore[assignment]
    # Again in a copy, after coverage's own, which each measurement of a copy adds; with a lock that no thread holds.
    os.register_at_fork(after_in_child=save_coverage_once)
