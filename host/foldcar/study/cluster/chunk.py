"""Runs a chunk on a worker, by a recipe that says how to create its runner.

A worker has the installed package and its own carsim. For a dynamic program, the worker is sent the files in the
program's folder. Other files must exist on the worker with the same path and content.
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
from foldcar.read_files import MISSING, listed_files
from foldcar.scenes.fingerprint import scene_code, scenic_version
from foldcar.scenes.program_files import content
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import engine_of
from foldcar.simulation.runner import CarsimError, Runner, RunRequest
from foldcar.simulation.scenic_runner import ScenicRunner


@dataclass(frozen=True, slots=True)
class Recipe:
    """How a worker creates a sweep's runner: ``engine`` is a key of ENGINES, ``build`` the build id of its carsim.

    For a dynamic program: ``program`` is its path on the machine of the sweep, ``files`` are the files of its folder by
    name, ``environment`` are the other arguments of ScenicRunner as JSON. ``code`` is the hash of foldcar's code that
    runs it, and Scenic's version.
    """

    engine: str
    build: str
    program: str = ""
    files: tuple[tuple[str, bytes], ...] = ()
    environment: str = ""
    code: tuple[str, str] = ("", "")


def recipe_of(runner: Runner, carsim: Carsim) -> Recipe:
    """Return the recipe from which a worker on another machine makes an equal runner.

    ``runner`` is ``carsim``, or a ScenicRunner that uses it. A ScenicRunner's recipe contains the program and its files.
    """
    engine = engine_of(carsim.engine)
    if not isinstance(runner, ScenicRunner):
        return Recipe(engine, carsim.build)
    folder = runner.program.parent
    contents: dict[str, bytes] = {}
    listed_folders: list[Path] = []
    for name, digest in sorted(runner.environment["files"].items()):
        # An absolute name is that of a file outside the program's folder. A worker reads its own file of that name.
        if Path(name).is_absolute() or digest == MISSING:
            continue
        if (folder / name).is_dir():
            listed_folders.append(folder / name)
        else:
            contents[name] = content(folder, name, digest)
    # If the program lists a folder, the worker needs all files in it.
    for listed_folder in listed_folders:
        for file in listed_files(listed_folder):
            if file.is_file():
                contents.setdefault(file.relative_to(folder).as_posix(), file.read_bytes())
    files = tuple(sorted(contents.items()))
    code = (scene_code(), scenic_version())
    return Recipe(engine, carsim.build, str(runner.program), files, json.dumps(runner.environment), code)


def fault_of_worker(recipe: Recipe) -> str:
    """Return why this worker cannot run the recipe's chunks; "" if it can."""
    try:
        _runner(recipe)
    except (FoldcarError, OSError) as error:
        return str(error)
    return ""


def run_chunk(
    recipe: Recipe, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
) -> tuple[list[dict[str, Any]], float]:
    """Run a chunk on this worker; return the answers and the time of simulation (s), as Simulators.run does.

    Errors name the Scenic program's path on the sweep's machine. Raises CarsimError, which names this worker.
    """
    started_s = time.perf_counter()
    try:
        runner, folder = _runner(recipe)
        answers = runner.run(bodies, scenes, requests)
    except FoldcarError as error:
        raise CarsimError(f"worker on {socket.gethostname()}: {error}") from error
    if folder:
        worker_folder, origin_folder = folder.name, str(Path(recipe.program).parent)
        answers = [
            {"error": answer["error"].replace(worker_folder, origin_folder)} if "error" in answer else answer
            for answer in answers
        ]
    return answers, time.perf_counter() - started_s


@functools.lru_cache(maxsize=4)
def _runner(recipe: Recipe) -> tuple[Runner, "tempfile.TemporaryDirectory[str] | None"]:
    """Return the runner that a recipe describes, and the temporary folder with its program's files.

    There is a folder only for a dynamic program, else None. The folder is deleted when the caller drops it. Raises
    CarsimError if the versions on this worker differ from those of the sweep.
    """
    carsim = Carsim(engine=recipe.engine)
    if carsim.build != recipe.build:
        raise CarsimError(f"the worker's carsim is build {carsim.build}, this sweep's is {recipe.build}")
    if not recipe.program:
        return carsim, None
    if (scene_code(), scenic_version()) != recipe.code:
        raise CarsimError("the worker's versions of foldcar and Scenic differ from this sweep's: install the same")
    folder = tempfile.TemporaryDirectory(prefix="foldcar-")
    for name, file_bytes in recipe.files:
        file = Path(folder.name) / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(file_bytes)
    program = Path(folder.name) / Path(recipe.program).name
    return ScenicRunner(program, **json.loads(recipe.environment), command=carsim.command), folder
