"""Finds the first bracket or quotation mark of a JSON text that is not closed.

Input: a text that a JSON parser refuses; comments are allowed. Output: a message with line, column and what to write.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

CLOSING = {"{": "}", "[": "]"}
# In this order: comments, complete strings on one line, a quotation mark of an open string, brackets.
TOKEN = re.compile(r"""//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|["']|[][{}]""", re.DOTALL)


def unclosed(text: str) -> str | None:
    """Return a message about the first bracket or quotation mark that is not closed; None if all are closed.

    Example: ``line 3, column 5: "[" of line 1, column 7 is still open: write "]" before this "}"``.
    """
    open_brackets: list[Token] = []
    # The tokens are the brackets outside of strings, and the quotation marks of strings that are not closed.
    for token in _tokens(text):
        place = _place(text, token.position)
        if token.character in CLOSING:
            open_brackets.append(token)
        elif token.character in ("'", '"'):
            return f"{place}: a string has no closing {token.character} on its line: write it on one line"
        elif not open_brackets:
            return f'{place}: "{token.character}" does not close a bracket; remove it'
        elif token.character == CLOSING[open_brackets[-1].character]:
            open_brackets.pop()
        else:
            bracket = open_brackets[-1]
            closing = CLOSING[bracket.character]
            return f'{place}: {_still_open(text, bracket)}: write "{closing}" before this "{token.character}"'
    if open_brackets:
        bracket = open_brackets[-1]
        return f'at the end of the file {_still_open(text, bracket)}: write "{CLOSING[bracket.character]}"'
    return None


class Token(NamedTuple):
    """A bracket or a quotation mark, and its position in the text."""

    character: str
    position: int


def _tokens(text: str) -> Iterator[Token]:
    """Yield brackets, and quotation marks that are not closed on their line."""
    for match in TOKEN.finditer(text):
        # Comments and complete strings are longer.
        if len(match[0]) == 1:
            yield Token(match[0], match.start())


def _still_open(text: str, bracket: Token) -> str:
    """Return the words that a bracket is not closed, with its place."""
    return f'"{bracket.character}" of {_place(text, bracket.position)} is still open'


def _place(text: str, position: int) -> str:
    """Return line and column, from 1, of a character's position in the text."""
    line = text.count("\n", 0, position) + 1
    column = position - text.rfind("\n", 0, position)
    return f"line {line}, column {column}"
