"""What was probably meant by a Scenic program that does not compile, from the error and the line that it names.

Input: the error, the program's path and the number of the line. Output: the end of a message, empty if nothing is known.
"""

import re
from pathlib import Path

from foldcar.did_you_mean import did_you_mean

VOCABULARY = Path(__file__).resolve().parent / "vocabulary" / "model.scenic"
MODEL = re.compile(r"^\s*model\s+model\b", re.MULTILINE)
PARAMETERS = re.compile(r"^\s*param\s+(.*)", re.MULTILINE)


def hint(error: BaseException, program: Path, line: int | None) -> str:
    """``; did you mean "Kerb"?`` and the like."""
    try:
        text = program.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
    lines = text.splitlines()
    at = lines[line - 1] if line is not None and 0 < line <= len(lines) else ""
    if isinstance(error, NameError):
        return _name_hint(str(getattr(error, "name", None) or ""), text)
    if isinstance(error, KeyError) and "globalParameters" in at:
        return _parameter_hint(str(error.args[0]), text)
    if "with X not a vector" in str(error):
        return "; a place has an x and a y, as in `at (1.2, 0)`"
    if str(error) == "invalid syntax" and "new " in at:
        return "; specifiers (at …, facing …, with …) are separated by commas"
    return ""


def _name_hint(name: str, text: str) -> str:
    if not name[:1].isupper():
        return ""
    if not MODEL.search(text):
        return "; Robot, Goal and the obstacles come with the line `model model`, which the program lacks"
    classes = re.findall(r"^class (\w+)", VOCABULARY.read_text(encoding="utf-8"), re.MULTILINE)
    return f"; known: {', '.join(classes)}{did_you_mean(name, classes)}"


def _parameter_hint(name: str, text: str) -> str:
    defined = PARAMETERS.findall(text + VOCABULARY.read_text(encoding="utf-8"))
    known = [parameter for one in defined for parameter in re.findall(r"(\w+)\s*=", one)]
    if name in known:
        return f": a requirement cannot read globalParameters: write `x = globalParameters.{name}` above it and read x"
    return f": there is no `param {name} = …`; known: {', '.join(sorted(set(known)))}{did_you_mean(name, known)}"
