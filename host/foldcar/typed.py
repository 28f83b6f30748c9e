"""Reads what people type: numbers in ASCII digits, misspelt names, and text files."""

import difflib
from collections.abc import Iterable
from pathlib import Path

from foldcar.errors import FoldcarError


def read_text(file: Path) -> str:
    """Read a text file in UTF-8, with or without a byte order mark; every line ends in \\n. Raises FoldcarError."""
    try:
        text = file.read_text(encoding="utf-8-sig")
    except OSError as error:
        close = "" if file.exists() else did_you_mean_file(file)
        raise FoldcarError(f"{file}: cannot be read: {error.strerror}{close}") from error
    except UnicodeDecodeError as error:
        raise FoldcarError(f"{file}: is not UTF-8 text (byte {error.start}): save it as UTF-8") from error
    if "\0" in text:
        # UTF-16 without a byte order mark, for example.
        raise FoldcarError(f"{file}: is not UTF-8 text (it contains NUL characters): save it as UTF-8")
    return text


def whole_number(text: str) -> int:
    """Parse an integer. Raises ValueError if the text is not one."""
    return int(_plain(text))


def decimal_number(text: str) -> float:
    """Parse a number; inf and nan are allowed. Raises ValueError if the text is not a number."""
    return float(_plain(text))


def _plain(text: str) -> str:
    """Return the text of a number. Raises ValueError if it has underscores or non-ASCII digits, which Python accepts."""
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number: use only the digits 0 to 9, e, ., + and -")
    return text


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean "width"?``, or "" if no known name is similar to ``word``."""
    close = difflib.get_close_matches(word, list(known), 1)
    return f'; did you mean "{close[0]}"?' if close else ""


def did_you_mean_file(file: Path) -> str:
    """Return ``; did you mean "study.db"?`` for a missing file: the most similar name in its folder with its suffix.

    Returns "" if no name is similar.
    """
    # exists() excludes a broken symbolic link, which would have the name itself.
    stems = [other.stem for other in sorted(file.parent.glob("*")) if other.suffix == file.suffix and other.exists()]
    close = difflib.get_close_matches(file.stem, stems, 1)
    return f'; did you mean "{close[0]}{file.suffix}"?' if close else ""
