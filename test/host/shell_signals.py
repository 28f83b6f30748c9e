"""Signals as an interactive shell leaves them to the commands it starts.

What starts the tests may ignore some (`nohup make test &` ignores SIGHUP, and SIGINT too in a script), and programs
that it starts, however remotely, go on ignoring them.
"""

import signal


def like_a_shell() -> None:
    """For ``preexec_fn``: Ctrl-C, a request to end and a closed terminal have their ordinary effect."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
