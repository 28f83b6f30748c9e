"""Compiles a Scenic program and determines whether it is dynamic and whether it may end a simulation.

Input: a program's path and parameters. Output: Scenic's scenario; FoldcarError of one line for a program that cannot
be sampled. `model model` is searched beside the program, then in foldcar's vocabulary/. Scenic takes most of a second to
import, so the functions that use it import it.
"""

import ast
import contextlib
import gc
import linecache
import re
import sys
import traceback
import warnings
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes import scenic_private
from foldcar.scenes.contained import contained
from foldcar.scenes.program_files import ProgramFiles
from foldcar.scenes.syntax_hints import syntax_hint
from foldcar.typed import did_you_mean, did_you_mean_file, read_text

COMPILE_LIMIT_S = 120.0
MAX_OBJECTS = 10_000
# The vocabulary has its own folder: Scenic finds it on sys.path, which must not expose foldcar's modules.
VOCABULARY_DIR = Path(__file__).resolve().parent / "vocabulary"
VOCABULARY = VOCABULARY_DIR / "model.scenic"


def compile_program(program: Path, params: Mapping[str, Any], files: ProgramFiles | None = None) -> Any:
    """Compile a Scenic program and return Scenic's scenario.

    ``params`` override the program's own parameters. ``files`` records the files that the program reads. Raises
    FoldcarError if the program cannot be compiled, or cannot be used by foldcar.
    """
    files = ProgramFiles(program) if files is None else files
    if not program.is_file():
        raise FoldcarError(f"{program}: no such Scenic program{did_you_mean_file(program)}")
    if program.suffix != ".scenic":
        raise FoldcarError(f"{program}: a Scenic program's name ends in .scenic")
    # This raises FoldcarError if the file is not a readable text.
    read_text(program)
    if params:
        # Scenic accepts any name as an override; compiling without overrides shows the declared names.
        declaring_scenario, _ = _compiled(program, files, {})
        _check_params(program, params, declaring_scenario.params)
    scenario, mutated = _compiled(program, files, params)
    if mutated:
        # The program mutates some Points, and this is known only at its end. Such Points have to be
        # created in another way (see Mutations), so compile the program a second time.
        scenario, _ = _compiled(program, files, params, mutated)
    if len(scenario.objects) > MAX_OBJECTS:
        raise FoldcarError(f"{program}: {len(scenario.objects)} objects are above the limit {MAX_OBJECTS} of a scene")
    if scenario.egoObject is None:
        raise FoldcarError(f"{program}: no ego: the program must define `ego = new Robot …`")
    if scenario.externalParams:
        raise FoldcarError(f"{program}: an external sampler: its samples would depend on the ones before")
    return scenario


def _compiled(
    program: Path, files: ProgramFiles, params: Mapping[str, Any], mutated_points: Collection[int] = ()
) -> tuple[Any, set[int]]:
    """Compile the program once. Return Scenic's scenario, and the numbers of the Points to which `mutate` adds noise.

    The program's things are numbered in the order in which they are created. ``mutated_points`` are the numbers that an
    earlier compilation has returned. Objects that are placed relative to one of these Points then move with its noise.
    Raises FoldcarError.
    """
    with _no_garbage_collection(), warnings.catch_warnings():
        # Scenic installs an excepthook, and warns if another library has done so before.
        warnings.filterwarnings("ignore", message="unable to install sys.excepthook")
        import scenic
    from foldcar.scenes.ground_regions import use_ground_regions
    from foldcar.scenes.mutation import Mutations
    from foldcar.scenes.refused_statements import refuse_misleading_records, refuse_misspelt_attributes
    from foldcar.scenes.scenic_hooks import hooks

    use_ground_regions()
    mutations = Mutations(points_with_copy=mutated_points)
    time_limit = contained(COMPILE_LIMIT_S, f"{program}: compiling", program)
    try:
        with _no_garbage_collection(), files.inside(anew=True), _vocabulary_on_path(), hooks(mutations), time_limit:
            scenario = scenic.scenarioFromFile(str(program), params=dict(params))
            refuse_misleading_records(scenario)
            if is_dynamic(scenario):
                refuse_misspelt_attributes(scenario, program)
            return scenario, mutations.mutated_points
    except FoldcarError:
        raise
    except Exception as error:
        raise ProgramError(str(program), error, program) from error


def may_end_itself(scenario: Any) -> bool:
    """Return whether the program can end a simulation itself, so that it needs no Goal.

    A time limit, conditions, monitors, behaviors and a `compose` block can do so.
    """
    dynamic = scenario.dynamicScenario
    has_conditions = bool(scenario.terminationConditions or scenario.terminateSimulationConditions)
    has_code_in_run = bool(scenario.monitors or scenic_private.agents(dynamic) or scenic_private.has_compose(dynamic))
    return has_conditions or has_code_in_run or scenic_private.is_limited(dynamic)


def is_dynamic(scenario: Any) -> bool:
    """Return whether the program has parts that are evaluated during a simulation."""
    has_records = bool(scenario.recordedExprs or scenario.recordedInitialExprs or scenario.recordedFinalExprs)
    if may_end_itself(scenario) or has_records:
        return True
    return any(requirement.proposition.has_temporal_operator for requirement in scenario.requirements)


class ProgramError(FoldcarError):
    """An error of a Scenic program: a message of one line and, for the terminal, the program's line with a caret.

    ``what`` begins the message.
    """

    def __init__(self, place: str, error: BaseException, program: Path) -> None:
        """Create the error from one that Scenic or Python has raised. The message begins with ``place``."""
        super().__init__(f"{place}: {one_line(error, program)}")
        # The line of the program, and below it a caret where the mistake is, as far as both are known.
        self._excerpt: list[str] = []
        file, line, column = _place(error)
        if file is None or line is None:
            return
        text = linecache.getline(file, line).rstrip()
        if not text:
            return
        self._excerpt.append(f"  {text}")
        if column is None:
            column = _column_of_undefined_name(error, text)
        if column is not None:
            # Tabs stay tabs, so that the caret stands below its column.
            indentation = "".join("\t" if character == "\t" else " " for character in text[:column])
            self._excerpt.append(f"  {indentation}^")

    def lines(self) -> list[str]:
        """Return the message, and the line at fault."""
        return [*super().lines(), *self._excerpt]


def _place(error: BaseException) -> tuple[str | None, int | None, int | None]:
    """Return the Scenic file, line and column (from 0) at fault; None for each that is unknown."""
    # Syntax errors of Python and Scenic have these attributes.
    file, line, offset = (getattr(error, name, None) for name in ("filename", "lineno", "offset"))
    if isinstance(file, str) and file.endswith(".scenic"):
        return file, line, offset - 1 if offset else None
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if frame.filename.endswith(".scenic"):
            # From Python 3.11 on, a frame has the column of the statement. An unknown name may stand
            # anywhere in the statement, so then no column is given.
            column = None if _undefined_name(error) else getattr(frame, "colno", None)
            return frame.filename, frame.lineno, column
    return None, line, None


def one_line(error: BaseException, program: Path) -> str:
    """Return an error as one line of text, with the program's line number if it is known, and with a hint."""
    file, line, _ = _place(error)
    line_text = "" if line is None else line_prefix(file, line, program)
    error_class = "" if type(error).__module__.startswith("scenic.") else f"{type(error).__name__}: "
    message = overlap_hint(" ".join(str(error).split()) or "no message")
    text = linecache.getline(file, line).rstrip() if file is not None and line is not None else ""
    hint = syntax_hint(error, text)
    if hint:
        # foldcar's hint replaces that of Scenic, which is often wrong.
        message = message.removesuffix(" Perhaps you forgot 'new'?").removesuffix(".")
    return line_text + error_class + message + hint + _name_hint(error)


def _undefined_name(error: BaseException) -> str | None:
    """Return the name of a NameError; None for other errors. Its message has the name in quotation marks."""
    if not isinstance(error, NameError):
        return None
    quoted_name = re.search(r"'(\w+)'", str(error))
    return quoted_name[1] if quoted_name else None


def _column_of_undefined_name(error: BaseException, text: str) -> int | None:
    """Return where an undefined name stands in the line ``text``, or None if the error is about something else."""
    undefined_name = _undefined_name(error)
    if undefined_name is None:
        return None
    word = re.search(rf"\b{re.escape(undefined_name)}\b", text)
    return word.start() if word else None


def _name_hint(error: BaseException) -> str:
    """Return a hint for an error about a name or a world model that is not defined, or "" for other errors."""
    # A program begins with `model model`, which defines foldcar's objects.
    if str(error).startswith("could not import world model"):
        return "; foldcar's is `model model`"
    name = _undefined_name(error)
    if name is None:
        return ""
    foldcar_classes = re.findall(r"^class (\w+)", VOCABULARY.read_text(encoding="utf-8"), re.MULTILINE)
    defined_names = _defined_names(error)
    has_foldcar_classes = any(foldcar_class in defined_names for foldcar_class in foldcar_classes)
    if name in foldcar_classes and not has_foldcar_classes:
        return "; the line `model model` at the top of the program defines foldcar's objects"
    if name[0].isupper():
        # Probably the name of a class.
        return f"; foldcar's objects: {', '.join(sorted(foldcar_classes))}{did_you_mean(name, foldcar_classes)}"
    return did_you_mean(name, [defined for defined in defined_names if not defined.startswith("_")])


def _defined_names(error: BaseException) -> Collection[str]:
    """Return the names that are defined where an error occurred: in the program, or in a program that it imports."""
    names: Collection[str] = ()
    for frame, _line in traceback.walk_tb(error.__traceback__):
        if frame.f_code.co_filename.endswith(".scenic"):
            # The last such frame is that in which the error occurred.
            names = frame.f_globals.keys()
    return names


def line_prefix(file: str | None, line: int, program: Path) -> str:
    """Return the line as a prefix of messages on ``program``; ``file`` may be an imported program."""
    is_program = file is None or Path(file).resolve() == program.resolve()
    return f"line {line}: " if is_program else f"{file}: line {line}: "


def overlap_hint(message: str) -> str:
    """Return Scenic's message; for overlapping objects, with a hint on how to permit them."""
    return f"{message}; `with allowCollisions True` permits it" if " intersects " in message else message


@contextlib.contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Disable garbage collection within the block, which makes importing and compiling a third faster."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


@contextlib.contextmanager
def _vocabulary_on_path() -> Iterator[None]:
    """Within the block, Scenic finds foldcar's vocabulary as `model model`."""
    folder = str(VOCABULARY_DIR)
    # Last, so that it hides no module of the program.
    sys.path.append(folder)
    try:
        yield
    finally:
        sys.path.remove(folder)


def _check_params(program: Path, params: Mapping[str, Any], declared: Mapping[str, Any]) -> None:
    """Raise FoldcarError for a parameter that the program does not declare, or a value that is not a finite number.

    Parameters whose declared value is not a number take any value that is not infinite.
    """
    for name, value in params.items():
        if name not in declared:
            names = ", ".join(sorted(declared)) or "none"
            suggestion = did_you_mean(name, declared)
            raise FoldcarError(f"{program}: param {name}: unknown; the program's parameters are: {names}{suggestion}")
        if _is_number(declared[name]) and not _is_number(value):
            raise FoldcarError(f"{program}: param {name}: {value!r} is not a number")
        if _is_number(value) and not abs(value) <= sys.float_info.max:
            raise FoldcarError(f"{program}: param {name}: {value!s:.40} is not finite")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def named_things(scenario: Any) -> dict[str, Any]:
    """Return a compiled program's variables by name: its globals and, in a modular scenario, the names of `setup`."""
    return scenic_private.names(scenario.dynamicScenario)


def named_instances(scenario: Any) -> dict[str, list[Any]]:
    """Return the Scenic objects and points of a compiled program, by the name of the variable that has them.

    A variable has a list of one object, or of several if its value is a list or tuple of objects. Other variables are
    left out. The car is also returned as ``ego``.
    """
    instance_ids = {id(value) for value in scenic_private.instances(scenario)}
    instances = {} if scenario.egoObject is None else {"ego": [scenario.egoObject]}
    for name, variable in named_things(scenario).items():
        items = variable if isinstance(variable, list | tuple) else [variable]
        # If an item is a sample of an object of the program, take this object.
        values = [scenic_private.unsampled(item) for item in items]
        if values and all(id(value) in instance_ids for value in values):
            instances[name] = values
    return instances


@cache
def parsed_program(source: str) -> ast.AST:
    """Return the syntax tree of a Scenic program."""
    from scenic.syntax.parser import parse_string

    tree: ast.AST = parse_string(source, "exec")
    return tree
