"""`--set NAME=MM`: values of design parameters."""

from collections.abc import Sequence
from typing import Annotated

import typer

from foldcar.errors import FoldcarError

Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=MM", help="Choose a design parameter, e.g. width=95 or W.length=60."),
]


def design_settings(words: Sequence[str]) -> dict[str, float]:
    """Parse NAME=MM words to values (mm or degrees) by parameter; FoldcarError if a word is invalid."""
    settings: dict[str, float] = {}
    for word in words:
        key, equals, text = word.partition("=")
        if key in settings:
            raise FoldcarError(f"--set {word}: {key} is given twice, first as {settings[key]:g}")
        try:
            settings[key] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise FoldcarError(f"--set {word}: not NAME=MM, as in --set width=95")
    return settings
