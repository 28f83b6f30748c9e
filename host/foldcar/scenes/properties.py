"""Refuses misspelt properties: Scenic takes any name after `with`, so that one letter too many changes nothing.

A property is one that the object's class or an ancestor declares. Another name is accepted for the program's own use:
if the program reads it (`post.visits`) and no declared name resembles it.
"""

import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Any

from scenic.core.errors import SpecifierError
from scenic.core.object_types import Object

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
    file = caller.f_code.co_filename
    text = _text(file)
    near = difflib.get_close_matches(name, cls._defaults, n=1, cutoff=SIMILARITY)
    if near:
        advice = f"; did you mean {near[0]}?"
    elif not re.search(rf"\.\s*{re.escape(name)}\b|(['\"]){re.escape(name)}\1", text):
        own = sorted({"length", "width", "height", *(set(cls._defaults) - set(Object._defaults))})
        shown = ", ".join(one for one in own if one in cls._defaults and one != INTERNAL)
        advice = f", and the program does not read it; its own are {shown}"
    else:
        return
    error: Any = SpecifierError(f"{cls.__name__} has no property {name}{advice}")
    error.filename, error.lineno = file, _line_of(name, text, caller.f_lineno)
    raise error


def _text(file: str) -> str:
    try:
        return Path(file).read_text(encoding="utf-8")
    except OSError:
        return ""


def _line_of(name: str, text: str, first: int) -> int:
    """The line of the first `with name` from line ``first`` on, where the statement begins."""
    for number, line in enumerate(text.splitlines()[first - 1 :], first):
        if re.search(rf"\bwith\s+{re.escape(name)}\b", line):
            return number
    return first
