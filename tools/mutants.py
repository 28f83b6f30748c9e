"""Mutants of a C++ source file: copies that differ from it by one small fault.

A mutant replaces one operator, one constant, one sign or one function of a pair, negates one condition or removes one
statement. Operators are told from template brackets, pointers and references by the spaces around them, as the
project's C++ is formatted. The list for a text is always the same.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One fault: ``text`` is the whole mutated file; ``line`` counts from 1; the other two are that line, stripped."""

    line: int
    original: str
    mutated: str
    text: str


BINARY = {
    "+": "-", "-": "+", "*": "/", "/": "*", "%": "*",
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "&&": "||", "||": "&&",
    "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=",
}  # fmt: skip
WORDS = {
    "std::min": "std::max", "std::max": "std::min", "std::sin": "std::cos", "std::cos": "std::sin",
    "std::abs": "", "true": "false", "false": "true",
}  # fmt: skip

_BLANKED = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|^[ \t]*#[^\n]*', re.M | re.S)
_OPERATORS = "|".join(re.escape(operator) for operator in sorted(BINARY, key=len, reverse=True))
_OPERATOR = re.compile(rf"(?<= )(?:{_OPERATORS})(?=[ \n])")
_SIGN = re.compile(r"(?<=[(,=?:{ ])-(?=[\w(])")
_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*(?:e[-+]?\d+)?|0x[0-9a-f]+)[fuUL]*(?![\w.])", re.I)
_WORD = re.compile(r"(?<![\w:])(?:" + "|".join(re.escape(word) for word in WORDS) + r")(?![\w:])")
_CONDITION = re.compile(r"\b(?:if|while) \(")
_ASSIGNMENT = r"[\w.>:\[\]*&()-]+ (?:[-+*/]?=) .*;"
_CALL = r"(?:\+\+|--)?[\w.>:\[\]-]+\(.*\);"
_STATEMENT = re.compile(rf"^[ \t]+(?:{_ASSIGNMENT}|{_CALL}|(?:\+\+|--)[\w.]+;)$")
_NO_STATEMENT = re.compile(r"^[ \t]*(?:return|const\w*|static_assert|auto|using|throw|case|default|if|for|while)\b")


def mutants_of(text: str) -> list[Mutant]:
    """All mutants of a source text, by place; those with the same text appear once."""
    code = _BLANKED.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)
    found: dict[str, Mutant] = {}
    for start, end, new in sorted(_changes(code)):
        mutated = text[:start] + new + text[end:]
        if mutated == text:
            continue
        shown = _line(mutated, start) if new else "(removed)"
        found.setdefault(mutated, Mutant(text.count("\n", 0, start) + 1, _line(text, start), shown, mutated))
    return list(found.values())


def _changes(code: str) -> Iterator[tuple[int, int, str]]:
    """(start, end, replacement) of every change to the code, in which comments and strings are blank."""
    for match in _OPERATOR.finditer(code):
        yield match.start(), match.end(), BINARY[match.group()]
    for match in _SIGN.finditer(code):
        yield match.start(), match.end(), "+"
    for match in _NUMBER.finditer(code):
        yield match.start(), match.end(), _other_number(match.group())
    for match in _WORD.finditer(code):
        yield match.start(), match.end(), WORDS[match.group()] or "static_cast<double>"
    for match in _CONDITION.finditer(code):
        close = _closing(code, match.end() - 1)
        if close > 0:
            yield match.end(), close, f"!({code[match.end() : close]})"
    position = 0
    for line in code.splitlines(keepends=True):
        body = line.rstrip()
        if _STATEMENT.match(body) and not _NO_STATEMENT.match(body) and body.count("(") == body.count(")"):
            yield position + len(body) - len(body.lstrip()), position + len(body), ""
        position += len(line)


def _other_number(literal: str) -> str:
    """Another value of the same type: 1 for 0, the next whole number, or twice the real one."""
    digits = literal.rstrip("fuUL") if not literal.lower().startswith("0x") else literal.rstrip("uUL")
    suffix = literal[len(digits) :]
    if re.fullmatch(r"\d+", digits):
        return f"{int(digits) + 1}{suffix}"
    if digits.lower().startswith("0x"):
        return f"{int(digits, 16) + 1:#x}{suffix}"
    value = float(digits)
    return f"{2 * value if value else 1.0!r}{suffix}"


def _closing(code: str, opening: int) -> int:
    depth = 0
    for i in range(opening, len(code)):
        depth += {"(": 1, ")": -1}.get(code[i], 0)
        if depth == 0:
            return i
    return -1


def _line(text: str, position: int) -> str:
    return text[text.rfind("\n", 0, position) + 1 :].split("\n", 1)[0].strip()
