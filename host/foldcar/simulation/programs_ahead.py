"""A copy of this process that compiles and samples Scenic programs, while this process reads a study and folds its cars.

Input: what to open. Output: its facts, notes and scenes; or nothing, then the caller opens it itself and learns why.
Importing Scenic and compiling a program take half of the time before a sweep's first run. This file imports neither.
"""

import io
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from foldcar.errors import FoldcarError
from foldcar.processors import usable_processors
from foldcar.simulation.forked import Answer, Forked

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource


class ProgramsAhead:
    """The copy, which imports Scenic from now on. A context manager: nothing of it is left after the block."""

    def __init__(self) -> None:
        self._copy = Forked(_answer)
        self._answers: dict[int, Answer] = {}
        self._asked = 0
        self._copy.tell({"number": 0, "what": "import"})

    def __enter__(self) -> "ProgramsAhead":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._copy.close()

    def ask(self, what: str, opening: Mapping[str, Any], sample: int = 0) -> int:
        """Ask ``what``, a key of ANSWERS, of a program without waiting; gives the question's number.

        ``opening`` has the arguments of open_environment, the program as text.
        """
        self._asked += 1
        self._copy.tell({"number": self._asked, "what": what, "opening": json.dumps(opening), "sample": sample})
        return self._asked

    def answer(self, number: int) -> Any:
        """The answer to question ``number``, to be had once; None if the copy has failed. FoldcarError as there."""
        while number not in self._answers:
            heard = self._copy.hear()
            if heard is None:
                return None
            sys.stderr.write(heard["said"])
            self._answers[heard["number"]] = heard
        answer = self._answers.pop(number)
        if answer["refused"] is not None:
            raise FoldcarError(answer["refused"])
        return answer["answer"]


@contextmanager
def programs_ahead(store: Path, jobs: int | None) -> Iterator[ProgramsAhead | None]:
    """The copy for a sweep into ``store`` with that many simulators, if it is of use: None if one process is to do all.

    A store that is there may have every result already: then nothing is to be compiled.
    """
    if (jobs or usable_processors()) < 2 or store.exists() or not hasattr(os, "fork"):
        yield None
        return
    try:
        programs = ProgramsAhead()
    except OSError:
        # Without memory or the right to another process it takes longer, no more.
        yield None
        return
    with programs:
        yield programs


def _facts(source: "SceneSource", sample: int) -> Answer:
    return {"dynamic": source.dynamic, "defined": source.success.defined, "text": source.success.text}


# What can be asked of an opened program.
ANSWERS: Mapping[str, Callable[["SceneSource", int], Any]] = {
    "facts": _facts,
    "notes": lambda source, sample: source.mutation_notes(),
    "scene": lambda source, sample: source.sample(sample),
}


def _answer(question: Answer) -> Answer:
    """In the copy. What a program prints goes with the answer."""
    answer, refused, said = None, None, io.StringIO()
    try:
        with redirect_stderr(said):
            if question["what"] == "import":
                from foldcar.scenes.program import import_scenic

                import_scenic()
            else:
                answer = ANSWERS[question["what"]](_opened(question["opening"]), question["sample"])
    except FoldcarError as error:
        refused = str(error)
    except Exception:
        # The caller does the same again, and fails where it is seen.
        answer, said = None, io.StringIO()
    return {"number": question["number"], "answer": answer, "refused": refused, "said": said.getvalue()}


@cache
def _opened(opening: str) -> "SceneSource":
    from foldcar.scenes.source import open_environment

    told = json.loads(opening)
    return open_environment(Path(told["program"]), told["params"], told["seed"], told["condition"])
