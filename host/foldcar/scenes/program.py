"""Compiles a Scenic program and finds whether it is dynamic and whether it may end a simulation.

Input: a program's path and parameters. Output: Scenic's scenario; FoldcarError of one line for a program that cannot
be sampled. `model model` is searched beside the program, then in foldcar's vocabulary/. Scenic takes most of a second to
import: it is imported in the functions that use it.
"""

import contextlib
import gc
import linecache
import math
import sys
import traceback
import warnings
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from foldcar.errors import FoldcarError
from foldcar.scenes.contained import contained
from foldcar.scenes.hints import hint
from foldcar.scenes.program_files import ProgramFiles

if TYPE_CHECKING:
    from foldcar.scenes.mutation import Mutations

COMPILE_LIMIT_S = 30.0
MOST_OBJECTS = 10_000
# The vocabulary has its own folder: Scenic finds it on sys.path, which must not expose foldcar's modules.
VOCABULARY_DIR = Path(__file__).resolve().parent / "vocabulary"


class CompiledProgram(NamedTuple):
    """A scenario as Scenic compiles it, and what the program creates and mutates."""

    scenario: Any
    mutations: "Mutations"


def compile_program(program: Path, params: Mapping[str, Any], files: ProgramFiles | None = None) -> Any:
    """The compiled scenario of ``program``, its parameters overridden by ``params``; ``files`` learns what it reads.

    Raises FoldcarError.
    """
    files = ProgramFiles(program) if files is None else files
    if not program.is_file():
        raise FoldcarError(f"{program}: no such Scenic program")
    if program.suffix != ".scenic":
        raise FoldcarError(f"{program}: a Scenic program's name ends in .scenic")
    _check_text(program)
    if params:
        # Scenic accepts any name as an override; compiling without overrides shows the declared names.
        _check_params(program, params, compile_observed(program, files, {}).scenario.params)
    compiled = compile_observed(program, files, params)
    if compiled.mutations.points:
        compiled = compile_observed(program, files, params, compiled.mutations.points)
    scenario = compiled.scenario
    if len(scenario.objects) > MOST_OBJECTS:
        raise FoldcarError(f"{program}: {len(scenario.objects)} objects are above the limit {MOST_OBJECTS} of a scene")
    if scenario.egoObject is None:
        raise FoldcarError(f"{program}: no ego: the program must define `ego = new Robot …`")
    if scenario.externalParams:
        raise FoldcarError(f"{program}: an external sampler: its samples would depend on the ones before")
    return scenario


def _check_text(program: Path) -> None:
    try:
        program.read_text(encoding="utf-8")
    except OSError as error:
        raise FoldcarError(f"{program}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise FoldcarError(f"{program}: is not UTF-8 text (byte {error.start})") from error


def compile_observed(
    program: Path, files: ProgramFiles, params: Mapping[str, Any], followed: Collection[int] = ()
) -> CompiledProgram:
    """The scenario of ``program`` and what it mutates; ``followed`` as in Mutations. Raises FoldcarError."""
    import_scenic()
    with _no_collection(), files.inside(anew=True):
        return _compile_observed(program, params, followed)


def import_scenic() -> Any:
    """Scenic, imported without what it says then; the first time that takes half a second."""
    with _no_collection(), warnings.catch_warnings():
        # Scenic installs an excepthook, and warns if another library has installed one before.
        warnings.filterwarnings("ignore", message="unable to install sys.excepthook")
        import scenic
    return scenic


def _compile_observed(program: Path, params: Mapping[str, Any], followed: Collection[int]) -> CompiledProgram:
    scenic = import_scenic()
    from foldcar.scenes.mutation import Mutations
    from foldcar.scenes.run_statements import refuse_same_names
    from foldcar.scenes.scenic_hooks import hooks

    mutations = Mutations(followed)
    try:
        with _vocabulary_found(), hooks(mutations), contained(COMPILE_LIMIT_S, f"{program}: compiling", program):
            scenario = scenic.scenarioFromFile(str(program), params=dict(params))
            refuse_same_names(scenario)
            return CompiledProgram(scenario, mutations)
    except FoldcarError:
        raise
    except Exception as error:
        raise FoldcarError(f"{program}: {one_line(error, program)}") from error


def may_end_itself(scenario: Any) -> bool:
    """Whether the program can end a simulation, by conditions, monitors or behaviors, and so needs no Goal."""
    return _ends_itself(scenario) or bool(scenario.monitors or scenario.dynamicScenario._agents)


def _ends_itself(scenario: Any) -> bool:
    dynamic = scenario.dynamicScenario
    conditions = [*scenario.terminationConditions, *scenario.terminateSimulationConditions]
    return bool(conditions) or dynamic._timeLimit is not None or dynamic._compose is not None


def is_dynamic(scenario: Any) -> bool:
    """Whether the program has parts that Scenic evaluates during a simulation."""
    return (
        may_end_itself(scenario)
        or bool(scenario.recordedExprs or scenario.recordedInitialExprs or scenario.recordedFinalExprs)
        or any(requirement.proposition.has_temporal_operator for requirement in scenario.requirements)
    )


def one_line(error: BaseException, program: Path) -> str:
    """The error as one line, with the line of the program if the error has one."""
    where, same = "", True
    lines = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    file, line = getattr(error, "filename", None), getattr(error, "lineno", None)
    if not (isinstance(file, str) and file.endswith(".scenic")):
        file, line = next(((f, n) for f, n in reversed(lines) if f.endswith(".scenic")), (None, line))
    if line is not None:
        same = file is None or Path(file).resolve() == program.resolve()
        where = f"line {line}: " if same else f"{file}: line {line}: "
    kind = "" if type(error).__module__.startswith("scenic.") else f"{type(error).__name__}: "
    said = " ".join(str(error).split())
    if not said:
        # As of `assert x < 1`.
        text = linecache.getline(str(file or program), line or 0).strip()
        said = f"`{text}`" if text else "no message"
    return where + kind + overlap_hint(said) + hint(error, program if same else Path(str(file)), line)


def overlap_hint(message: str) -> str:
    """Scenic's message, with the way to permit it if it is about objects that overlap."""
    return f"{message}; `with allowCollisions True` permits it" if " intersects " in message else message


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    """Importing and compiling make much and discard little: without collecting it they take two thirds of the time."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


@contextlib.contextmanager
def _vocabulary_found() -> Iterator[None]:
    folder = str(VOCABULARY_DIR)
    sys.path.append(folder)
    try:
        yield
    finally:
        sys.path.remove(folder)


def _check_params(program: Path, params: Mapping[str, Any], declared: Mapping[str, Any]) -> None:
    for name, value in params.items():
        if name not in declared:
            known = ", ".join(sorted(declared)) or "none"
            raise FoldcarError(f"{program}: param {name}: unknown; the program's parameters are: {known}")
        if _is_number(declared[name]) and not _is_number(value):
            raise FoldcarError(f"{program}: param {name}: {value!r} is not a number")
        if _is_number(value) and not math.isfinite(value):
            raise FoldcarError(f"{program}: param {name}: {value} is not finite")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
