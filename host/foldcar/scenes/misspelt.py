"""Refuses misspelt properties, parameters and other names, which would be found in the first run or never.

Scenic takes any property or parameter, so that one letter too many changes nothing. Known properties are those that the
object's class or an ancestor declares, known parameters those of the vocabulary. Another name is accepted for the
program's own use: if the program, or what it imports, reads it. After `with`, one that resembles a property is accepted
only if a behavior or a class reads it of itself (`self.pace`). Python finds a name that is defined nowhere only when it
is evaluated, as a condition's.
"""

import builtins
import difflib
import dis
import re
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from scenic.core.errors import InvalidScenarioError, SpecifierError
from scenic.core.object_types import Constructible, Object

from foldcar.scenes.program import VOCABULARY, VOCABULARY_DIR
from foldcar.scenes.refused_statements import at

# Names at least this similar (difflib's ratio) are taken for a mistake: `heigth`, `lenght`, `stepheight`, `heights`.
SIMILARITY = 0.75
# Scenic uses it where an object has it; no class declares it.
NAME = "name"
# Set by the vocabulary for messages.
INTERNAL = "creationLine"
INSTALLED = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "purelib", "platlib"))
IMPORT = re.compile(r"^\s*(?:from|import|model)\s+([\w.]+)", re.MULTILINE)


def check_properties(cls: Any, specifiers: Sequence[Any], caller: FrameType) -> None:
    """Raise Scenic's SpecifierError, with file and line, if a specifier names a property that ``cls`` lacks.

    ``caller`` is the frame that creates the object.
    """
    for name in (name for one in specifiers for name in one.priorities):
        if name not in cls._defaults and name != NAME:
            _check_own_use(cls, name, caller)


def _check_own_use(cls: Any, name: str, caller: FrameType) -> None:
    read = texts(caller)
    near = _near(name, cls._defaults)
    if is_read(name, read, of=r"\bself") or (not near and is_read(name, read)):
        return
    advice = near
    if not near:
        own = sorted({"length", "width", "height", *(set(cls._defaults) - set(Object._defaults))})
        shown = ", ".join(one for one in own if one in cls._defaults and one != INTERNAL)
        advice = f", and the program does not read it; its own are {shown}"
    file = caller.f_code.co_filename
    line = _line_of(rf"\bwith\s+{re.escape(name)}\b", file, caller.f_lineno)
    raise at(SpecifierError(f"{cls.__name__} has no property {name}{advice}"), file, line)


def check_parameters(names: Iterable[str], caller: FrameType) -> None:
    """Raise Scenic's InvalidScenarioError if a `param` that nothing reads resembles one of the vocabulary's."""
    known = _vocabularys_parameters()
    for name in names:
        near = "" if name in known else _near(name, known)
        if near and not is_read(name, texts(caller)):
            message = f"param {name}: neither the program nor the vocabulary reads it{near}"
            raise at(InvalidScenarioError(message), caller.f_code.co_filename, caller.f_lineno)


def check_module(code: CodeType, namespace: dict[str, Any], frame: FrameType) -> None:
    """Raise Scenic's InvalidScenarioError for a misspelt property that a module's class declares or that it assigns.

    ``code`` has been executed in ``namespace``, beneath ``frame``.
    """
    file = code.co_filename
    kinds: list[Any] = [one for one in namespace.values() if isinstance(one, type) and issubclass(one, Constructible)]
    suspects = []
    for kind in kinds:
        inherited = {name for base in kind.__bases__ for name in getattr(base, "_defaults", ())}
        if kind.__module__ == namespace.get("__name__"):
            for name in set(kind.__dict__.get("_scenic_properties", ())) - inherited:
                line = _line_of(rf"^\s*{name}\s*(\[.*\])?\s*:", file, 1)
                suspects.append((name, inherited, line, f"class {kind.__name__}: nothing reads its property {name}"))
    known = {*Object._defaults, *(name for kind in kinds for name in kind._defaults)}
    for block in blocks(code):
        for name in names_of(block, "STORE_ATTR"):
            # Names in a scenario's `setup` are attributes too, of the scenario.
            line = _line_of(rf"\.\s*{name}\s*=(?!=)", file, 0)
            if line and name not in known and not hasattr(Object, name):
                suspects.append((name, known, line, f"nothing reads {name}, which is assigned"))
    for name, properties, line, message in suspects:
        near = _near(name, properties)
        if near and not is_read(name, texts(frame, file)):
            raise at(InvalidScenarioError(f"{message}{near}"), file, line)


def _near(name: str, known: Iterable[str]) -> str:
    """A known name that ``name`` resembles, as the end of a sentence; nothing without one."""
    near = difflib.get_close_matches(name, [one for one in known if one != INTERNAL], n=1, cutoff=SIMILARITY)
    return f"; did you mean {near[0]}?" if near else ""


@cache
def _vocabularys_parameters() -> frozenset[str]:
    return frozenset(re.findall(r"^param (\w+)", VOCABULARY.read_text(encoding="utf-8"), re.MULTILINE))


def _line_of(pattern: str, file: str, first: int) -> int:
    """The line of the first match from line ``first`` on, where the statement begins; ``first`` without any."""
    for number, line in enumerate(text_of(file).splitlines(), 1):
        if number >= first and re.search(pattern, line):
            return number
    return first


def texts(frame: FrameType | None, *files: str) -> list[str]:
    """The texts of the programs that ``frame`` stands in, whose import or function is under way, and of their imports.

    ``files`` are further programs.
    """
    waiting = list(files)
    while frame is not None:
        if frame.f_code.co_filename.endswith(".scenic"):
            waiting.append(frame.f_code.co_filename)
        frame = frame.f_back
    found: dict[str, str] = {}
    while waiting:
        file = waiting.pop()
        if file not in found:
            found[file] = text_of(file)
            waiting += _imported(found[file])
    return list(found.values())


def text_of(file: str) -> str:
    """The file's text; nothing if it cannot be read."""
    try:
        return Path(file).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def is_read(name: str, texts: list[str], of: str = "") -> bool:
    """Whether a text has ``.name``, not to be assigned, or the name in quotes; with ``of`` what stands before the dot."""
    quoted = "" if of else rf"|(['\"]){name}\1"
    return any(re.search(rf"{of}\.\s*{name}\b(?!\s*=(?!=)){quoted}", text) for text in texts)


def _imported(text: str) -> Iterator[str]:
    """The files of the modules that a program's text imports, as far as they have been imported."""
    for name in IMPORT.findall(text):
        file = getattr(sys.modules.get(name), "__file__", None)
        # Its classes read their own properties only.
        if not isinstance(file, str) or Path(file).parent == VOCABULARY_DIR:
            continue
        if file.endswith(".scenic") or not file.startswith(INSTALLED):
            yield file


def refuse_undefined_names(code: CodeType, namespace: Mapping[str, Any]) -> None:
    """Raise NameError, with file and line, for the first name in a nested block of ``code`` that is nowhere assigned."""
    assigned = {name for block in blocks(code) for name in names_of(block, "STORE_") if name}
    for block in blocks(code):
        if block is code:
            continue
        for name, line in names_of(block, "LOAD_GLOBAL").items():
            if name not in namespace and name not in assigned and not hasattr(builtins, name):
                raise at(NameError(f"name '{name}' is not defined", name=name), code.co_filename, line)


def blocks(code: CodeType) -> Iterator[CodeType]:
    """The code and that of what is nested in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from blocks(constant)


def names_of(block: CodeType, operation: str) -> dict[str, int | None]:
    """The names that instructions of a kind use, with the line of the first use."""
    lines: dict[int, int | None] = dict(dis.findlinestarts(block))
    line: int | None = block.co_firstlineno
    found: dict[str, int | None] = {}
    for instruction in dis.get_instructions(block):
        line = lines.get(instruction.offset, line)
        if instruction.opname.startswith(operation) and isinstance(instruction.argval, str):
            found.setdefault(instruction.argval, line)
    return found
