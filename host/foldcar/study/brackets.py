"""The first bracket or quotation mark of a JSON text that is not closed.

Input: a text that a JSON parser refuses; comments are allowed. Output: a message with line, column and what to write.
"""

import re
from collections.abc import Iterator

CLOSING = {"{": "}", "[": "]"}
# Comments, whole strings on one line, an open string, brackets.
TOKEN = re.compile(r"""//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|["']|[][{}]""", re.DOTALL)


def unclosed(text: str) -> str | None:
    """What is not closed, or None: ``line 3, column 5: "[" of line 1, column 7 is still open: …``."""
    opened: list[tuple[str, int]] = []
    for token, at in _tokens(text):
        if token in CLOSING:
            opened.append((token, at))
        elif token in ("'", '"'):
            return f"{_place(text, at)}: a string has no closing {token} on its line: write it on one line"
        elif not opened:
            return f'{_place(text, at)}: "{token}" closes no bracket: remove it'
        elif token != CLOSING[opened[-1][0]]:
            bracket, begin = opened[-1]
            still = f'"{bracket}" of {_place(text, begin)} is still open'
            return f'{_place(text, at)}: {still}: write "{CLOSING[bracket]}" before this "{token}"'
        else:
            opened.pop()
    if opened:
        bracket, begin = opened[-1]
        still = f'"{bracket}" of {_place(text, begin)} is still open'
        return f'at the end of the file {still}: write "{CLOSING[bracket]}"'
    return None


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """Brackets, and quotation marks that are not closed on their line, with their places."""
    return ((match[0], match.start()) for match in TOKEN.finditer(text) if len(match[0]) == 1)


def _place(text: str, at: int) -> str:
    return f"line {text.count(chr(10), 0, at) + 1}, column {at - text.rfind(chr(10), 0, at)}"
