"""The text of a Scenic program and of what it imports, to find whether a name is read anywhere.

Input: a frame of the program while it is compiled. Output: texts. Python's and Scenic's own modules are left out, and
what is installed beside them unless it is a Scenic program.
"""

import re
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

INSTALLED = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "purelib", "platlib"))
# Its classes read their own properties only.
VOCABULARY = str(Path(__file__).resolve().parent / "vocabulary")
IMPORT = re.compile(r"^\s*(?:from|import|model)\s+([\w.]+)", re.MULTILINE)


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
        if not isinstance(file, str) or file.startswith(VOCABULARY):
            continue
        if file.endswith(".scenic") or not file.startswith(INSTALLED):
            yield file
