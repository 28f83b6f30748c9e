"""What people type: numbers of ASCII digits, names that they misspell, and text files."""

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
        # Such as UTF-16 without a byte order mark.
        raise FoldcarError(f"{file}: is not UTF-8 text (it contains NUL characters): save it as UTF-8")
    return text


def whole_number(text: str) -> int:
    """The whole number; ValueError if it is none."""
    return int(_plain(text))


def decimal_number(text: str) -> float:
    """The number, inf and nan included; ValueError if it is none."""
    return float(_plain(text))


def _plain(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number: it has letters or signs other than 0 to 9, e, . + and -")
    return text


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``; did you mean "width"?``, or nothing if no known name is close to ``word``."""
    close = difflib.get_close_matches(word, list(known), 1)
    return f'; did you mean "{close[0]}"?' if close else ""


def did_you_mean_file(file: Path) -> str:
    """The same for a missing file: the closest name in its folder with its ending."""
    # A link that leads nowhere has the name itself.
    others = (other for other in sorted(file.parent.glob("*")) if other.suffix == file.suffix and other.exists())
    stems = [other.stem for other in others]
    close = difflib.get_close_matches(file.stem, stems, 1)
    return f'; did you mean "{close[0]}{file.suffix}"?' if close else ""
