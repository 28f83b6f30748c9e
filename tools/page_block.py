"""The part of a page of docs/ between two marks, which a tool writes."""

from pathlib import Path

from foldcar.errors import FoldcarError


def replaced(text: str, page: Path, begin: str, end: str, between: str) -> str:
    """The text with the part between two marks, each of which must occur once, replaced; else FoldcarError."""
    if text.count(begin) != 1 or text.count(end) != 1:
        raise FoldcarError(f"{page}: the marks {begin} and {end} must occur once each")
    before, _, rest = text.partition(begin)
    return f"{before}{begin}\n{between}{end}{rest.partition(end)[2]}"
