"""`--set NAME=MM`: values of design parameters; `--set KIND=NAME`: parts."""

from collections.abc import Sequence
from typing import Annotated

import typer

from foldcar.car.parts.choices import OPTIONS
from foldcar.errors import FoldcarError
from foldcar.typed_numbers import decimal_number

Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=MM", help="Choose a parameter or a part, e.g. width=95, W.length=60, tyre=none."),
]


def design_settings(words: Sequence[str]) -> dict[str, float | str]:
    """Parse NAME=MM words to values (mm or degrees) by parameter or names of parts by kind; FoldcarError."""
    settings: dict[str, float | str] = {}
    for word in words:
        key, equals, text = word.partition("=")
        if key in settings:
            first = settings[key]
            shown = first if isinstance(first, str) else f"{first:g}"
            raise FoldcarError(f"--set {word}: {key} is given twice, first as {shown}")
        if equals and key in OPTIONS:
            settings[key] = text
            continue
        try:
            settings[key] = decimal_number(text)
        except ValueError:
            equals = ""
        if not equals:
            raise FoldcarError(f"--set {word}: not NAME=MM, as in --set width=95, nor a part, as in --set tyre=none")
    return settings
