"""Worker processes, which end with the process that started them, and copies of them, made by fork.

A process with the argument MODULE runs MODULE's `main`, and ends when nothing reads its output any more: however the one
that started it ends, and while it imports Scenic too. What an answer of a copy changes in memory is gone with the copy: a
Scenic program may change what it likes while it runs, as objects, lists within lists, imported modules, iterators.
"""

import contextlib
import gc
import json
import os
import select
import sys
import threading
import traceback
import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any, NoReturn


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


Answer = dict[str, Any]

# Ends of the pipes on which this process answers. A copy closes them: otherwise whoever asked this process would wait
# for the copy's end too.
_answering: list[int] = []


def answers_on(*descriptors: int) -> None:
    """Declare the file descriptors on which this process answers; its copies close them."""
    _answering[:] = descriptors


class Forked:
    """A copy of this process that answers with ``answer``, which takes and returns JSON objects. A context manager.

    Memory is shared until it is written.
    """

    def __init__(self, answer: Callable[[Answer], Answer]) -> None:
        asked, self._questions = os.pipe()
        self._answers, answered = os.pipe()
        # Garbage collection in the copy would write to, and so copy, every page with an object on it.
        gc.freeze()
        with warnings.catch_warnings():
            # A copy has none of the other threads: one that waits for a closed pipe, libraries' for linear algebra.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
        if self._process == 0:
            for descriptor in (self._questions, self._answers, *_answering):
                os.close(descriptor)
            answers_on(asked, answered)
            _serve(answer, asked, answered)
        os.close(asked)
        os.close(answered)
        self._reader = os.fdopen(self._answers, encoding="utf-8")

    def __enter__(self) -> "Forked":
        return self

    def __exit__(self, *_: object) -> None:
        """End the copy."""
        os.close(self._questions)
        self._reader.close()
        os.waitpid(self._process, 0)

    def ask(self, question: Answer) -> Answer:
        """The copy's answer. A copy that dies without one takes this process with it."""
        data = (json.dumps(question) + "\n").encode()
        with contextlib.suppress(BrokenPipeError):
            while data:
                data = data[os.write(self._questions, data) :]
        line = self._reader.readline()
        if not line.endswith("\n"):
            os._exit(1)
        answer: Answer = json.loads(line)
        return answer


def _serve(answer: Callable[[Answer], Answer], asked: int, answered: int) -> NoReturn:
    """Answer until nobody asks any more. Never returns to the code that forked, which belongs to the original."""
    code = 1
    threading.Thread(target=end_without_reader, args=(answered,), daemon=True).start()
    try:
        with os.fdopen(asked, encoding="utf-8") as questions, os.fdopen(answered, "w", encoding="utf-8") as answers:
            for line in questions:
                answers.write(json.dumps(answer(json.loads(line))) + "\n")
                answers.flush()
        code = 0
    except BrokenPipeError:
        # Nobody wants the answer any more.
        pass
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)
