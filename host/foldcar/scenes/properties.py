"""Refuses misspelt properties and parameters: Scenic takes any name, so that one letter too many changes nothing.

Known properties are those that the object's class or an ancestor declares, known parameters those of the vocabulary.
Another name is accepted for the program's own use: if the program, or what it imports, reads it. After `with`, one that
resembles a property is accepted only if a behavior or a class reads it of itself (`self.pace`).
"""

import difflib
import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from scenic.core.errors import InvalidScenarioError, SpecifierError
from scenic.core.object_types import Constructible, Object

from foldcar.scenes.readings import is_read, text_of, texts
from foldcar.scenes.undefined_names import blocks, names_of

# Names at least this similar (difflib's ratio) are taken for a mistake: `heigth`, `lenght`, `stepheight`, `heights`.
SIMILARITY = 0.75
# Scenic uses it where an object has it; no class declares it.
NAME = "name"
# Set by the vocabulary for messages.
INTERNAL = "creationLine"


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
    raise _at(SpecifierError(f"{cls.__name__} has no property {name}{advice}"), file, line)


def check_parameters(names: Iterable[str], vocabulary: Path, caller: FrameType) -> None:
    """Raise Scenic's InvalidScenarioError if a `param` that nothing reads resembles one of the ``vocabulary``'s."""
    known = _parameters_of(vocabulary)
    for name in names:
        near = "" if name in known else _near(name, known)
        if near and not is_read(name, texts(caller)):
            message = f"param {name}: neither the program nor the vocabulary reads it{near}"
            raise _at(InvalidScenarioError(message), caller.f_code.co_filename, caller.f_lineno)


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
            raise _at(InvalidScenarioError(f"{message}{near}"), file, line)


def _near(name: str, known: Iterable[str]) -> str:
    """A known name that ``name`` resembles, as the end of a sentence; nothing without one."""
    near = difflib.get_close_matches(name, [one for one in known if one != INTERNAL], n=1, cutoff=SIMILARITY)
    return f"; did you mean {near[0]}?" if near else ""


@cache
def _parameters_of(vocabulary: Path) -> frozenset[str]:
    return frozenset(re.findall(r"^param (\w+)", vocabulary.read_text(encoding="utf-8"), re.MULTILINE))


def _line_of(pattern: str, file: str, first: int) -> int:
    """The line of the first match from line ``first`` on, where the statement begins; ``first`` without any."""
    for number, line in enumerate(text_of(file).splitlines(), 1):
        if number >= first and re.search(pattern, line):
            return number
    return first


def _at(error: Any, file: str, line: int) -> Exception:
    error.filename, error.lineno = file, line
    return error  # type: ignore[no-any-return]
