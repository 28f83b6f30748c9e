"""A process with the argument MODULE: runs MODULE's `main`, and ends when nothing reads its output any more.

So a worker ends with the process that started it, however that ends, and while it imports Scenic too.
"""

import os
import select
import sys
import threading
from importlib import import_module


def main() -> None:
    """Watch the output's reader and run the module that the command line names."""
    # The worker keeps this pipe under a number of its own: standard output itself is given to what programs print.
    output = os.dup(sys.stdout.fileno())
    threading.Thread(target=end_without_reader, args=(output,), daemon=True).start()
    import_module(sys.argv[1]).main()


def end_without_reader(pipe: int) -> None:
    """End this process once the other end of ``pipe``, on which it writes, is closed."""
    wait_for_no_reader(pipe)
    os._exit(1)


def wait_for_no_reader(pipe: int) -> None:
    """Wait until the other end of ``pipe``, on which this process writes, is closed."""
    watched = select.poll()
    # Without requested events, what is reported is that the other end is closed.
    watched.register(pipe, 0)
    watched.poll()
