"""Copies of this process, made by fork, that answer questions: what an answer changes in memory is gone with its copy.

A Scenic program may change what it likes while it runs: objects, lists within lists, imported modules, iterators. Only
a copy of the whole process is certain to leave the original as it was.
"""

import contextlib
import gc
import json
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Callable
from types import TracebackType
from typing import Any, NoReturn

from foldcar.simulation.worker import end_without_reader

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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def ask(self, question: Answer) -> Answer:
        """The copy's answer.

        A copy that dies without one takes this process with it, in the same way, so that whoever started this one
        learns how.
        """
        self.tell(question)
        answer = self.hear()
        if answer is None:
            _die_of(os.waitpid(self._process, 0)[1])
        return answer

    def tell(self, question: Answer) -> None:
        """Ask without waiting: :meth:`hear` gives the answers in the order of the questions."""
        data = (json.dumps(question) + "\n").encode()
        with contextlib.suppress(BrokenPipeError):
            while data:
                data = data[os.write(self._questions, data) :]

    def hear(self) -> Answer | None:
        """The next answer; None if the copy has died."""
        line = self._reader.readline()
        if not line.endswith("\n"):
            return None
        answer: Answer = json.loads(line)
        return answer

    def close(self) -> None:
        """End the copy."""
        os.close(self._questions)
        self._reader.close()
        os.waitpid(self._process, 0)


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


def _die_of(status: int) -> NoReturn:
    """End this process as a process with that wait status ended."""
    # Not on Windows, which has no fork either.
    import resource

    if os.WIFSIGNALED(status):
        # The first of the processes has written a core file, if any is wanted.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with contextlib.suppress(OSError):
            # SIGKILL needs no handler and takes none.
            signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.waitstatus_to_exitcode(status))
