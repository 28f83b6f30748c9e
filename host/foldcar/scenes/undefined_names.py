"""Finds names that a program uses and nowhere defines, where Python would find them only when they are evaluated.

Input: the code of a module and its globals after it was executed. A condition, a monitor or a function with a misspelt
name would otherwise fail in the first run, or in the first one that gets there.
"""

import builtins
import dis
from collections.abc import Iterator, Mapping
from types import CodeType
from typing import Any


def refuse_undefined_names(code: CodeType, namespace: Mapping[str, Any]) -> None:
    """Raise NameError, with file and line, for the first name in a nested block of ``code`` that is nowhere assigned."""
    assigned = {name for block in blocks(code) for name in names_of(block, "STORE_") if name}
    for block in blocks(code):
        if block is code:
            continue
        for name, line in names_of(block, "LOAD_GLOBAL").items():
            if name not in namespace and name not in assigned and not hasattr(builtins, name):
                error: Any = NameError(f"name '{name}' is not defined", name=name)
                error.filename, error.lineno = code.co_filename, line
                raise error


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
