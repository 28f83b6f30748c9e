"""What a worker does with a chunk of runs, and what it needs to know for that.

A worker has the installed package and a carsim of its own. For a program that runs beside the simulation it is sent the
program's files in its folder; others must be in the same place there, and the same.
"""

import functools
import json
import socket
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.read_files import MISSING
from foldcar.scenes.fingerprint import scene_code, scenic_version
from foldcar.scenes.program_files import content
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import engine_of
from foldcar.simulation.runner import CarsimError, Runner, RunRequest
from foldcar.simulation.scenic_runner import ScenicRunner


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to make a sweep's runner. ``engine`` is a key of ENGINES, ``build`` that of the sweep's carsim.

    For a Scenic program beside the simulation: ``program`` is its path where the sweep was started, ``files`` its
    folder's files by name, ``environment`` the rest of a ScenicRunner's arguments as JSON, ``code`` the hash of foldcar's
    code that runs it and Scenic's version.
    """

    engine: str
    build: str
    program: str = ""
    files: tuple[tuple[str, bytes], ...] = ()
    environment: str = ""
    code: tuple[str, str] = ("", "")


def recipe_of(runner: Runner, carsim: Carsim) -> Recipe:
    """The recipe of ``runner``, which is ``carsim`` or a ScenicRunner with it."""
    engine = engine_of(carsim.engine)
    if not isinstance(runner, ScenicRunner):
        return Recipe(engine, carsim.build)
    known, folder = runner.environment["files"], runner.program.parent
    there = (name for name in sorted(known) if not Path(name).is_absolute() and known[name] != MISSING)
    files = tuple((name, content(folder, name, known[name])) for name in there)
    environment, code = json.dumps(runner.environment), (scene_code(), scenic_version())
    return Recipe(engine, carsim.build, str(runner.program), files, environment, code)


def fault_of_worker(recipe: Recipe) -> str:
    """Why this worker cannot run the recipe's chunks; "" if it can."""
    try:
        _runner(recipe)
    except (FoldcarError, OSError) as error:
        return str(error)
    return ""


def run_chunk(
    recipe: Recipe, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
) -> tuple[list[dict[str, Any]], float]:
    """As in Simulators (foldcar.study.chunks); messages name the program where the sweep was started."""
    begun_s = time.perf_counter()
    try:
        runner, folder = _runner(recipe)
        answers = runner.run(bodies, scenes, requests)
    except FoldcarError as error:
        raise CarsimError(f"worker on {socket.gethostname()}: {error}") from error
    if folder:
        there, here = folder.name, str(Path(recipe.program).parent)
        answers = [{"error": answer["error"].replace(there, here)} if "error" in answer else answer for answer in answers]
    return answers, time.perf_counter() - begun_s


@functools.lru_cache(maxsize=4)
def _runner(recipe: Recipe) -> tuple[Runner, "tempfile.TemporaryDirectory[str] | None"]:
    """The runner, and the folder with its program's files. CarsimError if it cannot be made on this machine."""
    carsim = Carsim(engine=recipe.engine)
    if carsim.build != recipe.build:
        raise CarsimError(f"its carsim is build {carsim.build}, this sweep's is {recipe.build}")
    if not recipe.program:
        return carsim, None
    if (scene_code(), scenic_version()) != recipe.code:
        raise CarsimError("its foldcar or Scenic is another than this sweep's: install the same")
    folder = tempfile.TemporaryDirectory(prefix="foldcar-")
    for name, text in recipe.files:
        file = Path(folder.name) / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(text)
    program = Path(folder.name) / Path(recipe.program).name
    return ScenicRunner(program, **json.loads(recipe.environment), command=carsim.command), folder
