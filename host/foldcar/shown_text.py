"""What standard output and error get of texts that come from files, names and cars.

A terminal obeys escape sequences, and turns a line around at right-to-left marks: a name could hide or forge what stands
beside it. `show_text` puts one stream in front of each that writes such letters out, as \\x1b; every text passes it, and
`shown_console` (for rich, whose own sequences must reach
the terminal) does the same. Letters that the stream's
encoding lacks are written out too.
"""

import io
import re
import sys
from typing import Any, TextIO, cast

# Control characters but tab and line feed; marks and isolates of direction, separators of lines; what is no character.
_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
# Bytes of a file's name that were no text in the encoding of names, which may be ASCII.
_UNDECODED = re.compile("[\udc80-\udcff]+")
# What spreadsheets run. A sign before a number is harmless.
_FORMULA = re.compile(r"\s*(?:[=@\uff1d\uff20]|[+\-\uff0b\uff0d](?!(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$|inf$|nan$))")
_MARKUP = re.compile(r"[\\`*\[\]<>|&~#]|(?<!\w)_|_(?!\w)")


def shown(text: str) -> str:
    """The text with what would steer a terminal written out, and bytes that are no text in UTF-8 too."""
    return _STEERING.sub(lambda found: found[0].encode("unicode_escape").decode(), decoded(text))


def decoded(text: str) -> str:
    """The text with bytes that Python could not decode (in a file's name) read as UTF-8, or else written out."""
    return _UNDECODED.sub(lambda found: found[0].encode(errors="surrogateescape").decode(errors="backslashreplace"), text)


def spreadsheet_cell(cell: Any) -> Any:
    """The cell of a CSV file; a text that a spreadsheet would run as a formula begins with an apostrophe.

    Example: spreadsheet_cell("=1+1") is "'=1+1", spreadsheet_cell("-1.5") is "-1.5"
    """
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell


def markdown_text(text: object) -> str:
    """The text in one line, with what Markdown would interpret escaped; an underscore within a word means nothing."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(str(text).split()))


class ShownText:
    """A text stream in front of ``as_is`` that writes `shown` texts, and is the same otherwise."""

    def __init__(self, as_is: TextIO) -> None:
        self.as_is = as_is

    def write(self, text: str) -> int:
        """Write the text as it may be shown."""
        return self.as_is.write(shown(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.as_is, name)


def show_text() -> None:
    """From now on standard output and error show texts."""
    sys.stdout, sys.stderr = _in_front_of(sys.stdout), _in_front_of(sys.stderr)


def plain_stream(stream: Any) -> Any:
    """The stream itself, without ``ShownText`` in front of it."""
    return stream.as_is if isinstance(stream, ShownText) else stream


def data_output() -> TextIO:
    """Standard output for data, not for a person: UTF-8 as in a file, unless it is a terminal."""
    if sys.stdout.isatty():
        return sys.stdout
    output = plain_stream(sys.stdout)
    if _lacks_letters(output):
        output.reconfigure(encoding="utf-8")
    return cast(TextIO, output)


def _in_front_of(stream: Any) -> TextIO:
    if _lacks_letters(stream):
        stream.reconfigure(errors="backslashreplace")
    return cast(TextIO, stream if isinstance(stream, ShownText) else ShownText(stream))


def _lacks_letters(stream: Any) -> bool:
    return isinstance(stream, io.TextIOWrapper) and not stream.encoding.lower().startswith("utf")
