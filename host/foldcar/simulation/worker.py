"""Worker processes, which end with the process that started them, and copies of them made by fork.

A process with the argument MODULE runs MODULE's `main`. It ends when nobody reads its output any more: its parent has
ended, or was killed. That also works while it is importing Scenic. Changes that a Scenic program makes in a copy's
memory, to objects, nested lists, modules or iterators, vanish with the copy.
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
    # Duplicate the pipe's descriptor, because standard output will be redirected for the output of programs.
    output = os.dup(sys.stdout.fileno())
    threading.Thread(target=end_without_reader, args=(output,), daemon=True).start()
    import_module(sys.argv[1]).main()


def end_without_reader(pipe: int) -> None:
    """End this process when the other end of ``pipe``, to which it writes, is closed."""
    wait_for_no_reader(pipe)
    os._exit(1)


def wait_for_no_reader(pipe: int) -> None:
    """Wait until the other end of ``pipe``, to which this process writes, is closed."""
    watched = select.poll()
    # Without requested events, poll reports only that the other end is closed.
    watched.register(pipe, 0)
    watched.poll()


Answer = dict[str, Any]

# Descriptors of the pipes over which this process answers. Copies close them, because a reader sees the end of a pipe
# only when all its writers have closed it.
_answer_descriptors: list[int] = []


def set_answer_descriptors(*descriptors: int) -> None:
    """Set the file descriptors to which this process writes answers; its copies close them."""
    _answer_descriptors[:] = descriptors


class Forked:
    """A copy of this process, made by fork, that answers questions by the function ``answer`` of JSON objects.

    It is a context manager, which ends the copy. Memory is shared until it is changed.
    """

    def __init__(self, answer: Callable[[Answer], Answer]) -> None:
        """Copy this process by fork. The copy reads questions from a pipe, and writes their ``answer`` to another pipe.

        This function returns only in the original process. The copy answers questions until it ends.
        """
        read_questions, write_questions = os.pipe()
        read_answers, write_answers = os.pipe()
        # Both processes share memory until one of them writes to it. Garbage collection would write to all objects.
        gc.freeze()
        with warnings.catch_warnings():
            # Python warns that a copy has none of the other threads. It needs none: these threads only wait for a pipe
            # to be closed, or belong to linear algebra.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
        is_copy = self._process == 0
        if is_copy:
            # A pipe ends for its reader only when no process has its writing end open. So the copy closes what it does
            # not use: its parent's ends of the two pipes, and the pipes to which the parent writes answers.
            for descriptor in (write_questions, read_answers, *_answer_descriptors):
                os.close(descriptor)
            set_answer_descriptors(read_questions, write_answers)
            _serve(answer, read_questions, write_answers)
        os.close(read_questions)
        os.close(write_answers)
        self._questions = write_questions
        self._reader = os.fdopen(read_answers, encoding="utf-8")

    def __enter__(self) -> "Forked":
        return self

    def __exit__(self, *_: object) -> None:
        """End the copy."""
        os.close(self._questions)
        self._reader.close()
        os.waitpid(self._process, 0)

    def ask(self, question: Answer) -> Answer:
        """Send a question to the copied process and return its answer.

        If the copy dies without an answer, this process ends at once, too. So the process that has started this one
        learns that it is without an answer, and can repeat its question in a new process.
        """
        question_line = json.dumps(question) + "\n"
        # If the copy has died, the pipe is broken and the answer is missing below.
        with contextlib.suppress(BrokenPipeError):
            _write_all(self._questions, question_line.encode())
        answer_line = self._reader.readline()
        if not answer_line.endswith("\n"):
            os._exit(1)
        answer: Answer = json.loads(answer_line)
        return answer


def _write_all(descriptor: int, data: bytes) -> None:
    """Write all of ``data`` to a pipe; the system may write only a part of it at once."""
    while data:
        written_count = os.write(descriptor, data)
        data = data[written_count:]


def _serve(answer: Callable[[Answer], Answer], question_pipe: int, answer_pipe: int) -> NoReturn:
    """Answer the questions of the original process until it closes their pipe. Then end this process.

    This process is a copy of the original one. It must not return, because it would run the caller's code a second time.
    """
    code = 1
    threading.Thread(target=end_without_reader, args=(answer_pipe,), daemon=True).start()
    try:
        with (
            os.fdopen(question_pipe, encoding="utf-8") as questions,
            os.fdopen(answer_pipe, "w", encoding="utf-8") as answers,
        ):
            for line in questions:
                answers.write(json.dumps(answer(json.loads(line))) + "\n")
                answers.flush()
        code = 0
    except BrokenPipeError:
        # The original process no longer reads answers.
        pass
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)
