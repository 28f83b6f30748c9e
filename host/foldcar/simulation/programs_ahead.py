"""A copy of this process that compiles and samples Scenic programs, while this process reads a study and folds its cars.

Input: what to open. Output: its facts, notes and scenes; or nothing, then the caller opens it itself and learns why.
Importing Scenic and compiling a program take half of the time before a sweep's first run. This file imports neither.
"""

import io
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, suppress
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from foldcar.errors import FoldcarError
from foldcar.processors import usable_processors
from foldcar.simulation.forked import Answer, Forked

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource

Opening = Mapping[str, Any]


class ProgramsAhead:
    """The copy, which imports Scenic from now on. A context manager: nothing of it is left after the block.

    ``opening`` holds the arguments of open_environment, the program as text.
    """

    def __init__(self) -> None:
        self._copy = Forked(_answer)
        self._unheard = 1
        self._copy.tell({"prepare": []})

    def __enter__(self) -> "ProgramsAhead":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._copy.close()

    def prepare(self, openings: Sequence[Opening]) -> None:
        """Compile these programs from now on. Once only: the copy may wait for its answers to be heard."""
        self._unheard += 1
        self._copy.tell({"prepare": [json.dumps(opening) for opening in openings]})

    def ask(self, what: str, opening: Opening, sample: int = 0) -> Any:
        """Ask ``what``, a key of ANSWERS, of a program; None if the copy has failed. FoldcarError as it is there."""
        while self._unheard:
            self._unheard -= 1
            self._hear()
        self._copy.tell({"what": what, "opening": json.dumps(opening), "sample": sample})
        heard = self._hear()
        if heard is None:
            return None
        if heard["refused"] is not None:
            raise FoldcarError(heard["refused"])
        return heard["answer"]

    def _hear(self) -> Answer | None:
        heard = self._copy.hear()
        if heard is not None:
            sys.stderr.write(heard["said"])
        return heard


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
    files = dict(source.fixed_files())
    return {"dynamic": source.dynamic, "defined": source.success.defined, "text": source.success.text, "files": files}


def _scene(source: "SceneSource", sample: int) -> Any:
    source.fixed_files()
    return source.sample(sample)


# What can be asked of an opened program.
ANSWERS: Mapping[str, Callable[["SceneSource", int], Any]] = {
    "facts": _facts,
    "notes": lambda source, sample: source.mutation_notes(),
    "scene": _scene,
}


def _answer(question: Answer) -> Answer:
    """In the copy. What a program prints goes with the answer."""
    if "prepare" in question:
        return _prepare(question["prepare"])
    answer, refused, said = None, None, io.StringIO()
    try:
        with redirect_stderr(said):
            answer = ANSWERS[question["what"]](_opened(question["opening"]), question["sample"])
    except FoldcarError as error:
        refused = str(error)
    except Exception:
        # The caller does the same again, and fails where it is seen.
        said = io.StringIO()
    return {"answer": answer, "refused": refused, "said": said.getvalue()}


def _prepare(openings: Sequence[str]) -> Answer:
    """Import Scenic and compile; a program that fails is compiled again, and prints again, when it is asked for."""
    from foldcar.scenes.program import import_scenic

    told = []
    with suppress(Exception):
        import_scenic()
        for opening in openings:
            said = io.StringIO()
            with redirect_stderr(said):
                _opened(opening)
            told.append(said.getvalue())
    return {"said": "".join(told)}


@cache
def _opened(opening: str) -> "SceneSource":
    from foldcar.scenes.source import open_environment

    told = json.loads(opening)
    return open_environment(Path(told["program"]), told["params"], told["seed"], told["condition"])
