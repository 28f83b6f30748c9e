"""Runs pytest for each line of its input in a copy of this process, which has imported libraries that tests import.

A line is JSON: the ``words`` for pytest, the ``environment`` to add, ``limit_s`` (whole seconds). The answer is a line
with the exit code, below 0 that of a signal, as when the time is over.
"""

import json
import os
import signal
import sys

import matplotlib.pyplot  # noqa: F401
import numpy  # noqa: F401
import pandas  # noqa: F401
import pytest
import scenic  # noqa: F401
import scipy.stats  # noqa: F401
import sklearn.neural_network  # noqa: F401
import typer  # noqa: F401

for line in sys.stdin:
    request = json.loads(line)
    copy = os.fork()
    if copy == 0:
        os.dup2(os.open(os.devnull, os.O_RDWR), 0)
        os.dup2(0, 1)
        os.environ.update(request["environment"])
        signal.alarm(request["limit_s"])
        os._exit(pytest.main(request["words"]))
    print(os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]), flush=True)
