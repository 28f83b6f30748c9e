"""Finds the first bracket or quotation mark of a JSON text that is not closed.

Input: a text that a JSON parser refuses; comments are allowed. Output: a message with line, column and what to write.
"""

import re
from collections.abc import Iterator

CLOSING = {"{": "}", "[": "]"}
# In this order: comments, complete strings on one line, a quotation mark of an open string, brackets.
TOKEN = re.compile(r"""//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|["']|[][{}]""", re.DOTALL)


def unclosed(text: str) -> str | None:
    """Return a message about the first bracket or quotation mark that is not closed; None if all are closed.

    Example: ``line 3, column 5: "[" of line 1, column 7 is still open: write "]" before this "}"``.
    """
    # Each with its position in the text.
    open_brackets: list[tuple[str, int]] = []
    for token, position in _tokens(text):
        if token in CLOSING:
            open_brackets.append((token, position))
        elif token in ("'", '"'):
            return f"{_place(text, position)}: a string has no closing {token} on its line: write it on one line"
        elif not open_brackets:
            return f'{_place(text, position)}: "{token}" does not close a bracket; remove it'
        elif token != CLOSING[open_brackets[-1][0]]:
            bracket, start = open_brackets[-1]
            still_open = f'"{bracket}" of {_place(text, start)} is still open'
            return f'{_place(text, position)}: {still_open}: write "{CLOSING[bracket]}" before this "{token}"'
        else:
            open_brackets.pop()
    if open_brackets:
        bracket, start = open_brackets[-1]
        still_open = f'"{bracket}" of {_place(text, start)} is still open'
        return f'at the end of the file {still_open}: write "{CLOSING[bracket]}"'
    return None


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """Yield brackets, and quotation marks that are not closed on their line, with their positions."""
    return ((match[0], match.start()) for match in TOKEN.finditer(text) if len(match[0]) == 1)


def _place(text: str, position: int) -> str:
    """Return line and column, from 1, of a character's position in the text."""
    return f"line {text.count(chr(10), 0, position) + 1}, column {position - text.rfind(chr(10), 0, position)}"
