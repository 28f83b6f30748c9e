"""Compiles a Scenic program and finds whether it is dynamic and whether it may end a simulation.

Input: a program's path and parameters. Output: Scenic's scenario; FoldcarError of one line for a program that cannot
be sampled. `model model` is searched beside the program, then in foldcar's vocabulary/. Scenic takes most of a second to
import: it is imported in the functions that use it.
"""

import contextlib
import gc
import linecache
import math
import re
import sys
import traceback
import warnings
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from foldcar.errors import FoldcarError
from foldcar.scenes.contained import contained
from foldcar.scenes.program_files import ProgramFiles
from foldcar.typed import did_you_mean

if TYPE_CHECKING:
    from foldcar.scenes.mutation import Mutations

COMPILE_LIMIT_S = 30.0
MOST_OBJECTS = 10_000
# The vocabulary has its own folder: Scenic finds it on sys.path, which must not expose foldcar's modules.
VOCABULARY_DIR = Path(__file__).resolve().parent / "vocabulary"
VOCABULARY = VOCABULARY_DIR / "model.scenic"
MODEL = re.compile(r"^\s*model\s+model\b", re.MULTILINE)
PARAMETERS = re.compile(r"^\s*param\s+(.*)", re.MULTILINE)


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
    try:
        program.read_text(encoding="utf-8")
    except OSError as error:
        raise FoldcarError(f"{program}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise FoldcarError(f"{program}: is not UTF-8 text (byte {error.start})") from error
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
    from foldcar.scenes.refused_statements import refuse_same_names
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
    lines = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    file, line = getattr(error, "filename", None), getattr(error, "lineno", None)
    if not (isinstance(file, str) and file.endswith(".scenic")):
        file, line = next(((f, n) for f, n in reversed(lines) if f.endswith(".scenic")), (None, line))
    if line is not None:
        where = line_prefix(file, line, program)
    kind = "" if type(error).__module__.startswith("scenic.") else f"{type(error).__name__}: "
    said = " ".join(str(error).split())
    if not said:
        # As of `assert x < 1`.
        text = linecache.getline(str(file or program), line or 0).strip()
        said = f"`{text}`" if text else "no message"
    return where + kind + overlap_hint(said) + hint(error, program if file is None else Path(file), line)


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
            raise FoldcarError(f"{program}: param {name}: unknown; the program's parameters are: {known}")
        if _is_number(declared[name]) and not _is_number(value):
            raise FoldcarError(f"{program}: param {name}: {value!r} is not a number")
        if _is_number(value) and not math.isfinite(value):
            raise FoldcarError(f"{program}: param {name}: {value} is not finite")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def hint(error: BaseException, program: Path, line: int | None) -> str:
    """What was probably meant where the error is, as the end of a message: ``; did you mean "Kerb"?`` and the like."""
    try:
        text = program.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
    lines = text.splitlines()
    at = lines[line - 1] if line is not None and 0 < line <= len(lines) else ""
    if isinstance(error, NameError):
        return _name_hint(str(getattr(error, "name", None) or ""), text)
    if isinstance(error, KeyError) and "globalParameters" in at:
        return _parameter_hint(str(error.args[0]), text)
    if "with X not a vector" in str(error):
        return "; a place has an x and a y, as in `at (1.2, 0)`"
    if str(error) == "invalid syntax" and "new " in at:
        return "; specifiers (at …, facing …, with …) are separated by commas"
    return ""


def _name_hint(name: str, text: str) -> str:
    if not name[:1].isupper():
        return ""
    if not MODEL.search(text):
        return "; Robot, Goal and the obstacles come with the line `model model`, which the program lacks"
    classes = re.findall(r"^class (\w+)", VOCABULARY.read_text(encoding="utf-8"), re.MULTILINE)
    return f"; known: {', '.join(classes)}{did_you_mean(name, classes)}"


def _parameter_hint(name: str, text: str) -> str:
    defined = PARAMETERS.findall(text + VOCABULARY.read_text(encoding="utf-8"))
    known = [parameter for one in defined for parameter in re.findall(r"(\w+)\s*=", one)]
    if name in known:
        return f": a requirement cannot read globalParameters: write `x = globalParameters.{name}` above it and read x"
    return f": there is no `param {name} = …`; known: {', '.join(sorted(set(known)))}{did_you_mean(name, known)}"


def named_things(scenario: Any) -> dict[str, Any]:
    """The variables of a compiled program by name: its globals and, in a modular scenario, the names of its `setup`."""
    dynamic, modular = scenario.dynamicScenario, {}
    namespace = dynamic._dummyNamespace
    if namespace is None:
        namespace = (dynamic._setup or dynamic._compose).__globals__
        modular = {name: dynamic.__dict__[name] for name in dynamic._locals if name in dynamic.__dict__}
    return {name: value for name, value in namespace.items() if not name.startswith("_")} | modular
