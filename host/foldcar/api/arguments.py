"""Checks the arguments of the Python interface."""

import contextlib
import math
import operator
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy

from foldcar.car.design_parameters import declared, key_of
from foldcar.errors import FoldcarError
from foldcar.shown_text import shown_value
from foldcar.typed import did_you_mean


def checked_int(name: str, value: object, minimum: int, maximum: int) -> int:
    """Return ``value`` as int. Raises FoldcarError, which names it, unless it is an integer within the limits."""
    with contextlib.suppress(TypeError):
        number = operator.index(value)  # type: ignore[arg-type]
        if not isinstance(value, bool) and minimum <= number <= maximum:
            return number
    raise FoldcarError(f"{name}: {shown_value(value)} is not an integer from {minimum} to {maximum}")


def checked_number(name: str, value: object, minimum: float, maximum: float) -> float:
    """Return ``value`` as float. Raises FoldcarError, which names it, unless it is a number within the limits."""
    expected = f"a number from {minimum:g} to {maximum:g}"
    number = finite(name, value, expected)
    if not minimum <= number <= maximum:
        raise FoldcarError(f"{name}: {shown_value(value)} is not {expected}")
    return number


def checked_confidence(value: object) -> float:
    """Return a level of confidence as float. Raises FoldcarError unless it is above 0 and below 1."""
    expected = "a number above 0 and below 1, such as 0.95"
    number = finite("confidence", value, expected)
    if not 0 < number < 1:
        raise FoldcarError(f"confidence: {shown_value(value)} is not {expected}")
    return number


def checked_bool(name: str, value: object) -> bool:
    """Return ``value``. Raises FoldcarError, which names it, unless it is True or False."""
    if isinstance(value, bool | numpy.bool_):
        return bool(value)
    raise FoldcarError(f"{name}: {shown_value(value)} is neither True nor False")


def checked_experiment(value: object) -> str | None:
    """Return the id of an experiment, or None. Raises FoldcarError if it is neither a string nor None."""
    if value is None or isinstance(value, str):
        return value
    raise FoldcarError(f'experiment: {shown_value(value)} is neither an id in quotes, such as "1", nor None')


def checked_path(name: str, value: object, expected: str) -> Path:
    """Return ``value`` as a path. Raises FoldcarError, which says that it is not the path of ``expected``."""
    with contextlib.suppress(TypeError):
        text = os.fspath(value)  # type: ignore[call-overload]
        if isinstance(text, str) and text and "\0" not in text:
            return Path(text)
    raise FoldcarError(f"{name}: {shown_value(value)} is not the path of {expected}")


def checked_params(value: object) -> Mapping[str, Any] | None:
    """Return the parameters of a Scenic program, or None. Raises FoldcarError if they are no mapping from names."""
    if value is None or (isinstance(value, Mapping) and all(isinstance(name, str) for name in value)):
        return value
    raise FoldcarError(
        f'params: {shown_value(value)} is not a dictionary of names and values, such as {{"friction": 0.5}}'
    )


def finite(name: str, value: object, expected: str = "a number") -> float:
    """Return ``value`` as float. Raises FoldcarError, which names the argument, unless it is a finite number.

    The message says that the value is not ``expected``.
    """
    # numpy's numbers are allowed; strings and booleans are not.
    if not isinstance(value, str | bool):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            number = float(value)  # type: ignore[arg-type]
            if math.isfinite(number):
                return number
    raise FoldcarError(f"{name}: {shown_value(value)} is not {expected}")


def _without_unit(column: str) -> str:
    """Return the name of a design parameter's column without its unit, such as ``W_length`` of W_length_mm."""
    key = key_of(column)
    unit = "" if key is None else declared(key).unit
    return column.removesuffix(f"_{unit}")


def column_named(name: str, columns: Iterable[str], context: str) -> str:
    """Return the column of a design parameter that ``name`` means.

    A column may be named in full (``W_length_mm``), without its unit (``W_length``), or without its module, too
    (``length``). Raises FoldcarError, which starts with ``context``, if the name means no column, or several.
    """
    names = list(columns)
    if name in names:
        return name
    short = {column: _without_unit(column) for column in names}
    matches = [column for column in names if short[column] == name]
    if not matches:
        matches = [column for column in names if short[column].endswith(f"_{name}")]
    if len(matches) > 1:
        raise FoldcarError(f"{context}: {name} may be {' or '.join(matches)}; write the full name")
    if not matches:
        close = did_you_mean(name, [*names, *short.values()])
        raise FoldcarError(f"{context}: {name} is not a design parameter; there are {', '.join(names)}{close}")
    return matches[0]


def columns_named(values: Mapping[str, object], columns: Iterable[str], context: str) -> dict[str, float]:
    """Return ``values`` with full column names as keys (see column_named), and floats as values.

    Raises FoldcarError, which starts with ``context``, for an unknown name, a repeated column, or an invalid number.
    """
    names, result = list(columns), dict[str, float]()
    for name, value in values.items():
        column = column_named(name, names, context)
        if column in result:
            raise FoldcarError(f"{context}: {name}: {column} is given twice")
        result[column] = finite(f"{context}: {name}", value, "a number (mm or degrees)")
    return result
