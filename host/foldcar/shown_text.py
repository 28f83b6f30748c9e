"""Escapes control characters in all text for standard output and error, because it may come from files, names or cars.

Escape sequences and right-to-left marks in a name could hide or forge the text beside it on a terminal. `show_text`
replaces both streams by ones that escape such characters, as \\x1b. `shown_console` does the same for rich, whose own
escape sequences must reach the terminal. Characters that the stream's encoding lacks are escaped, too.
"""

import io
import re
import sys
from typing import Any, TextIO, cast

# Control characters except tab and line feed, direction marks and isolates, line separators, and surrogates.
_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
# Surrogates that stand for undecodable bytes of a file's name (the encoding of names may be ASCII).
_UNDECODED = re.compile("[\udc80-\udcff]+")
# Beginnings of formulas, which spreadsheets run. A sign before a number is harmless.
_FORMULA = re.compile(r"\s*(?:[=@\uff1d\uff20]|[+\-\uff0b\uff0d](?!(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$|inf$|nan$))")
_MARKUP = re.compile(r"[\\`*\[\]<>|&~#]|(?<!\w)_|_(?!\w)")


def shown(text: str) -> str:
    """Return the text with control characters and undecodable bytes escaped."""
    return _STEERING.sub(lambda match: match[0].encode("unicode_escape").decode(), decoded(text))


def breaks_line(name: str) -> bool:
    """Return whether a name would end the line in which it is printed; other control characters are escaped there."""
    return bool(name) and name.splitlines() != [name]


def one_line(name: str) -> str:
    """Return a name that is printed in sentences, for pydantic. Raises ValueError if it breaks their lines."""
    if breaks_line(name):
        raise ValueError("a name has no line breaks")
    return name


def shown_line(text: str) -> str:
    """Return the text as :func:`shown`, with tabs and line feeds escaped, too, so that it stays in its line.

    Example: shown_line("A\\nB") is "A\\\\nB"
    """
    return shown(text).replace("\t", r"\t").replace("\n", r"\n")


def decoded(text: str) -> str:
    """Return the text with undecoded bytes of file names (Python's surrogates) decoded as UTF-8, or else escaped."""
    return _UNDECODED.sub(lambda match: match[0].encode(errors="surrogateescape").decode(errors="backslashreplace"), text)


def spreadsheet_cell(cell: Any) -> Any:
    """Return the cell for a CSV file, with an apostrophe before text that a spreadsheet would run as a formula.

    An apostrophe is also added before a formula that has apostrophes already, so that :func:`without_apostrophe` returns
    it as it was. Carriage returns become line feeds, because Python before 3.13 does not quote them, and one would end
    its row.

    Example: spreadsheet_cell("=1+1") is "'=1+1", spreadsheet_cell("-1.5") is "-1.5"
    """
    if not isinstance(cell, str):
        return cell
    text = with_line_feeds(cell)
    is_formula = _FORMULA.match(text.lstrip("'")) is not None
    return f"'{text}" if is_formula else text


def with_line_feeds(text: str) -> str:
    """Return a text in which every line ends with a line feed."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def without_apostrophe(cell: str) -> str:
    """Return the text of a cell that :func:`spreadsheet_cell` wrote."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell.lstrip("'")) else cell


def markdown_text(text: object) -> str:
    """Return the text in one line with Markdown's markup escaped; an underscore inside a word is not markup."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(str(text).split()))


class ShownText:
    """A text stream that writes to ``as_is`` with control characters escaped; otherwise it behaves as ``as_is``."""

    def __init__(self, as_is: TextIO) -> None:
        self.as_is = as_is

    def write(self, text: str) -> int:
        """Write the text with control characters escaped."""
        return self.as_is.write(shown(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.as_is, name)


def show_text() -> None:
    """Replace standard output and error by streams that escape control characters."""
    sys.stdout, sys.stderr = _escaping_stream(sys.stdout), _escaping_stream(sys.stderr)


def plain_stream(stream: Any) -> Any:
    """Return the stream without the ``ShownText`` around it."""
    return stream.as_is if isinstance(stream, ShownText) else stream


def data_output() -> TextIO:
    """Return the stream to which a command writes data, such as a table for another program.

    A terminal is returned as it is, so control characters are shown escaped. Otherwise data is written unescaped. If the
    encoding of the output lacks some letters, it becomes UTF-8.
    """
    if sys.stdout.isatty():
        return sys.stdout
    output = plain_stream(sys.stdout)
    if _lacks_letters(output):
        output.reconfigure(encoding="utf-8")
    return cast(TextIO, output)


def _escaping_stream(stream: Any) -> TextIO:
    """Return a stream that escapes control characters, and those that the encoding lacks, and writes to ``stream``."""
    if _lacks_letters(stream):
        stream.reconfigure(errors="backslashreplace")
    return cast(TextIO, stream if isinstance(stream, ShownText) else ShownText(stream))


def _lacks_letters(stream: Any) -> bool:
    """Return whether the stream's encoding is not a Unicode one, so that it cannot write all characters."""
    return isinstance(stream, io.TextIOWrapper) and not stream.encoding.lower().startswith("utf")


def shown_value(value: object) -> str:
    """Return any value as messages show it, not longer than a line."""
    try:
        text = repr(value)
    except ValueError:
        # Python does not print integers of more than some thousand digits.
        return f"an integer of {int(value).bit_length()} bits"  # type: ignore[call-overload]
    return text if len(text) <= 60 else f"{text[:57]}..."
