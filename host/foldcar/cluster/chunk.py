"""What a worker does with a chunk: the only function that a sweep asks workers to run, and what it needs to know.

A worker has the installed package and a carsim of its own. For a program that runs beside the simulation it is sent the
program's files in its folder; others must be in the same place there, and the same.
"""

import json
import socket
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from foldcar.errors import FoldcarError
from foldcar.scenes.fingerprint import scene_code, scenic_version
from foldcar.scenes.program_files import content
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import engine_of
from foldcar.simulation.runner import CarsimError, Runner, RunRequest
from foldcar.simulation.scenic_runner import ScenicRunner


@dataclass(frozen=True, slots=True)
class Program:
    """A Scenic program: its path where the sweep was started, its folder's files by name, its environment as JSON.

    ``code`` is the hash of foldcar's code that runs it, ``scenic`` Scenic's version.
    """

    path: str
    files: tuple[tuple[str, bytes], ...]
    environment: str
    code: str
    scenic: str


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to make the runner of a sweep: small, and sent with every chunk.

    ``engine`` is a key of ENGINES, ``build`` the one that made the sweep's plan.
    """

    engine: str
    build: str
    program: Program | None


def recipe_of(runner: Runner, carsim: Carsim) -> Recipe:
    """The recipe of ``runner``, which is ``carsim`` or a ScenicRunner with it."""
    program = None
    if isinstance(runner, ScenicRunner):
        known, folder = runner.environment["files"], runner.program.parent
        inside = [name for name in sorted(known) if not Path(name).is_absolute()]
        files = tuple((name, content(folder, name, known[name])) for name in inside)
        environment = json.dumps(runner.environment)
        program = Program(str(runner.program), files, environment, scene_code(), scenic_version())
    return Recipe(engine_of(carsim.engine), carsim.build, program)


class Made:
    """The runner of a recipe on this machine, for one thread. CarsimError if it cannot be made here."""

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        self._carsim = Carsim(engine=recipe.engine)
        self._file = _identity(self._carsim.binary)
        if self._carsim.build != recipe.build:
            raise CarsimError(f"its carsim is build {self._carsim.build}, this sweep's is {recipe.build}")
        self._runner: Carsim | ScenicRunner = self._carsim
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if (program := recipe.program) is not None:
            if (scene_code(), scenic_version()) != (program.code, program.scenic):
                raise CarsimError(
                    f"its foldcar or Scenic is another than this sweep's: code {scene_code()[:12]} and Scenic "
                    f"{scenic_version()}, not {program.code[:12]} and {program.scenic}"
                )
            self._folder = tempfile.TemporaryDirectory(prefix="foldcar-")
            for name, text in program.files:
                file = Path(self._folder.name) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(text)
            here = Path(self._folder.name) / Path(program.path).name
            self._runner = ScenicRunner(here, **json.loads(program.environment), command=self._carsim.command)

    def fits(self, recipe: Recipe) -> bool:
        """Whether it is that recipe's, with the simulator still the same file."""
        return recipe == self.recipe and _identity(self._carsim.binary) == self._file

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """As a Runner; messages name the program where the sweep was started."""
        return [
            {"error": self._there(answer["error"])} if "error" in answer else answer
            for answer in self._runner.run(bodies, scenes, requests)
        ]

    def stop(self) -> None:
        """As a Runner."""
        self._runner.stop()

    def close(self) -> None:
        """End its processes and remove its files."""
        if isinstance(self._runner, ScenicRunner):
            self._runner.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _there(self, message: str) -> str:
        if self._folder is None or self.recipe.program is None:
            return message
        return message.replace(self._folder.name, str(Path(self.recipe.program.path).parent))


def _identity(file: Path) -> tuple[int, int, int]:
    status = file.stat()
    return status.st_ino, status.st_size, status.st_mtime_ns


@dataclass(frozen=True, slots=True)
class Simulated:
    """Answers in the order of the requests, and how long they took (s)."""

    answers: list[dict[str, Any]]
    seconds: float


@dataclass(frozen=True, slots=True)
class Trouble:
    """Why a chunk has no answers from the worker on ``host``.

    Unfit: it cannot make the sweep's runs at all. Late: it ended the chunk at its limit. Refused: its simulator refused
    the chunk, or broke down over it, as would the sweep's own.
    """

    kind: Literal["unfit", "late", "refused"]
    host: str
    why: str


_kept = threading.local()


def run_chunk(
    recipe: Recipe,
    bodies: Mapping[str, str],
    scenes: Mapping[str, str],
    requests: Sequence[RunRequest],
    limit_s: float,
) -> Simulated | Trouble:
    """The chunk's runs. Each thread of a worker keeps the runner of the recipe that it had last."""
    late, host = threading.Event(), socket.gethostname()
    try:
        made = _made(recipe)
    except (FoldcarError, OSError) as error:
        return Trouble("unfit", host, str(error))

    def end() -> None:
        late.set()
        made.stop()

    timer = threading.Timer(limit_s, end)
    timer.daemon = True
    start_s = time.perf_counter()
    timer.start()
    try:
        answers = made.run(bodies, scenes, requests)
    except FoldcarError as error:
        _drop()
        if late.is_set():
            return Trouble("late", host, f"was not done after {limit_s:g} s")
        return Trouble("refused", host, str(error))
    finally:
        timer.cancel()
    return Simulated(answers, time.perf_counter() - start_s)


def _made(recipe: Recipe) -> Made:
    made: Made | None = getattr(_kept, "made", None)
    if made is None or not made.fits(recipe):
        _drop()
        made = _kept.made = Made(recipe)
    return made


def _drop() -> None:
    made: Made | None = getattr(_kept, "made", None)
    _kept.made = None
    if made is not None:
        made.close()
