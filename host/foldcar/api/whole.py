"""Whole numbers among the arguments of the Python interface."""

import contextlib
import operator

from foldcar.errors import FoldcarError


def whole(name: str, value: object, least: int, most: int) -> int:
    """``value`` as a whole number from ``least`` to ``most``; FoldcarError naming it if it is none."""
    with contextlib.suppress(TypeError):
        number = operator.index(value)  # type: ignore[arg-type]
        if not isinstance(value, bool) and least <= number <= most:
            return number
    raise FoldcarError(f"{name}: {value!r} is not a whole number from {least} to {most}")
