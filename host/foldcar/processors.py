"""How many processors this process may use."""

import os


def usable_processors() -> int:
    """On Linux those that the process was given; elsewhere all of the machine's."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
