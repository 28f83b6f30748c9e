"""Compiles a Scenic program and finds whether it is dynamic and whether it may end a simulation.

Input: a program's path and parameters. Output: Scenic's scenario; FoldcarError of one line for a program that cannot
be sampled. `model model` is searched beside the program, then in foldcar's vocabulary/. Scenic takes most of a second to
import: it is imported in the functions that use it.
"""

import contextlib
import gc
import math
import sys
import traceback
import warnings
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.contained import contained
from foldcar.scenes.program_files import ProgramFiles
from foldcar.typed import did_you_mean, did_you_mean_file, read_text

COMPILE_LIMIT_S = 120.0
MOST_OBJECTS = 10_000
# The vocabulary has its own folder: Scenic finds it on sys.path, which must not expose foldcar's modules.
VOCABULARY_DIR = Path(__file__).resolve().parent / "vocabulary"
VOCABULARY = VOCABULARY_DIR / "model.scenic"


def compile_program(program: Path, params: Mapping[str, Any], files: ProgramFiles | None = None) -> Any:
    """The compiled scenario of ``program``, its parameters overridden by ``params``; ``files`` learns what it reads.

    Raises FoldcarError.
    """
    files = ProgramFiles(program) if files is None else files
    if not program.is_file():
        raise FoldcarError(f"{program}: no such Scenic program{did_you_mean_file(program)}")
    if program.suffix != ".scenic":
        raise FoldcarError(f"{program}: a Scenic program's name ends in .scenic")
    read_text(program)
    if params:
        # Scenic accepts any name as an override; compiling without overrides shows the declared names.
        _check_params(program, params, _compiled(program, files, {})[0].params)
    scenario, mutated = _compiled(program, files, params)
    if mutated:
        scenario, _ = _compiled(program, files, params, mutated)
    if len(scenario.objects) > MOST_OBJECTS:
        raise FoldcarError(f"{program}: {len(scenario.objects)} objects are above the limit {MOST_OBJECTS} of a scene")
    if scenario.egoObject is None:
        raise FoldcarError(f"{program}: no ego: the program must define `ego = new Robot …`")
    if scenario.externalParams:
        raise FoldcarError(f"{program}: an external sampler: its samples would depend on the ones before")
    return scenario


def _compiled(
    program: Path, files: ProgramFiles, params: Mapping[str, Any], followed: Collection[int] = ()
) -> tuple[Any, set[int]]:
    """The scenario of ``program``, and which Points it mutates; ``followed`` as in Mutations. Raises FoldcarError."""
    with _no_collection(), warnings.catch_warnings():
        # Scenic installs an excepthook, and warns if another library has installed one before.
        warnings.filterwarnings("ignore", message="unable to install sys.excepthook")
        import scenic
    from foldcar.scenes.mutation import Mutations
    from foldcar.scenes.refused_statements import refuse_same_names
    from foldcar.scenes.scenic_hooks import hooks

    mutations = Mutations(followed)
    limited = contained(COMPILE_LIMIT_S, f"{program}: compiling", program)
    try:
        with _no_collection(), files.inside(anew=True), _vocabulary_found(), hooks(mutations), limited:
            scenario = scenic.scenarioFromFile(str(program), params=dict(params))
            refuse_same_names(scenario)
            return scenario, mutations.points
    except FoldcarError:
        raise
    except Exception as error:
        raise FoldcarError(f"{program}: {one_line(error, program)}") from error


def may_end_itself(scenario: Any) -> bool:
    """Whether the program can end a simulation, by conditions, monitors or behaviors, and so needs no Goal."""
    dynamic = scenario.dynamicScenario
    conditions = [*scenario.terminationConditions, *scenario.terminateSimulationConditions]
    limited = dynamic._timeLimit is not None or dynamic._compose is not None
    return limited or bool(conditions or scenario.monitors or dynamic._agents)


def is_dynamic(scenario: Any) -> bool:
    """Whether the program has parts that Scenic evaluates during a simulation."""
    return (
        may_end_itself(scenario)
        or bool(scenario.recordedExprs or scenario.recordedInitialExprs or scenario.recordedFinalExprs)
        or any(requirement.proposition.has_temporal_operator for requirement in scenario.requirements)
    )


def one_line(error: BaseException, program: Path) -> str:
    """The error as one line, with the line of the program if the error has one."""
    where = ""
    lines = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    file, line = getattr(error, "filename", None), getattr(error, "lineno", None)
    if not (isinstance(file, str) and file.endswith(".scenic")):
        file, line = next(((f, n) for f, n in reversed(lines) if f.endswith(".scenic")), (None, line))
    if line is not None:
        where = line_prefix(file, line, program)
    kind = "" if type(error).__module__.startswith("scenic.") else f"{type(error).__name__}: "
    return where + kind + overlap_hint(" ".join(str(error).split()) or "no message")


def line_prefix(file: str | None, line: int, program: Path) -> str:
    """The line, as a prefix of messages on ``program``; ``file`` may be one that it imports."""
    same = file is None or Path(file).resolve() == program.resolve()
    return f"line {line}: " if same else f"{file}: line {line}: "


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
            close = did_you_mean(name, declared)
            raise FoldcarError(f"{program}: param {name}: unknown; the program's parameters are: {known}{close}")
        if _is_number(declared[name]) and not _is_number(value):
            raise FoldcarError(f"{program}: param {name}: {value!r} is not a number")
        if _is_number(value) and not math.isfinite(value):
            raise FoldcarError(f"{program}: param {name}: {value} is not finite")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def named_things(scenario: Any) -> dict[str, Any]:
    """The variables of a compiled program by name: its globals and, in a modular scenario, the names of its `setup`."""
    dynamic, modular = scenario.dynamicScenario, {}
    namespace = dynamic._dummyNamespace
    if namespace is None:
        namespace = (dynamic._setup or dynamic._compose).__globals__
        modular = {name: dynamic.__dict__[name] for name in dynamic._locals if name in dynamic.__dict__}
    return {name: value for name, value in namespace.items() if not name.startswith("_")} | modular
