"""Hints for lines of a Scenic program that are written in Scenic 2's syntax, as in the publication's programs.

Input: an error and the text of its line. Output: a hint to append to its message.
"""

import re

# Words that begin a specifier behind a class.
SPECIFIERS = "at|in|on|left|right|ahead|behind|facing|with|beyond|following|offset|visible"
WITHOUT_NEW = re.compile(rf"(?<!\bnew )\b([A-Z]\w*)\s+(?:{SPECIFIERS})\b")
WITHOUT_COMMA = re.compile(r"[^,\s]\s+(facing|with)\s")
FACES_A_NAME = re.compile(r"\bfacing\s+(?!toward\b|away\b|directly\b)([A-Za-z_]\w*)\s*$")


def syntax_hint(error: BaseException, text: str) -> str:
    """Return a hint on how to write the line ``text`` in Scenic 3, to be appended to the message of ``error``.

    The hint for ``ego = Robot at startPos facing endPos`` names three changes: ``new``, a comma and ``facing toward``.
    Returns "" if there is no hint.
    """
    if "not a heading or orientation" in str(error):
        return _toward(text)
    if "invalid syntax" not in str(error):
        return ""
    if re.search(r"\bas\s*$", text):
        return '; a statement ends with its line: write the name behind "as" on this line'
    changes = [f'"new" before "{match[1]}"' for match in WITHOUT_NEW.finditer(text)]
    changes += [f'a comma before "{match[1]}"' for match in WITHOUT_COMMA.finditer(text)]
    if not changes:
        return ""
    listed = " and ".join(changes)
    return f"; Scenic 3 wants {listed}{_toward(text)}"


def _toward(text: str) -> str:
    """Return the hint for a line that ends with `facing NAME`, as Scenic 2 faces a point; "" for other lines."""
    match = FACES_A_NAME.search(text)
    return f'; "facing toward {match[1]}" is the way to a point' if match else ""
