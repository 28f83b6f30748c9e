"""Arguments of the Python interface."""

import contextlib
import math
import operator
from collections.abc import Iterable, Mapping

from foldcar.car.design_parameters import declared, key_of
from foldcar.errors import FoldcarError
from foldcar.typed import did_you_mean


def whole(name: str, value: object, least: int, most: int) -> int:
    """``value`` as a whole number from ``least`` to ``most``; FoldcarError naming it if it is none."""
    with contextlib.suppress(TypeError):
        number = operator.index(value)  # type: ignore[arg-type]
        if not isinstance(value, bool) and least <= number <= most:
            return number
    raise FoldcarError(f"{name}: {value!r} is not a whole number from {least} to {most}")


def finite(name: str, value: object, what: str = "a number") -> float:
    """``value`` as a finite number; FoldcarError naming it if it is not one."""
    # numpy's numbers are numbers too, texts and booleans are not.
    if not isinstance(value, str | bool):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            number = float(value)  # type: ignore[arg-type]
            if math.isfinite(number):
                return number
    raise FoldcarError(f"{name}: {value!r:.60} is not {what}")


def column_named(name: str, columns: Iterable[str], what: str) -> str:
    """The column called ``name``, or its only one without unit (``W_length``) or without module too (``tire_thickness``).

    FoldcarError, which begins with ``what``, if there is none or several.
    """
    known = list(columns)
    if name in known:
        return name
    units = {column: declared(key).unit for column in known if (key := key_of(column)) is not None}
    short = {column: column.removesuffix(f"_{units.get(column, '')}") for column in known}
    found = [column for column in known if short[column] == name]
    found = found or [column for column in known if short[column].endswith(f"_{name}")]
    if len(found) > 1:
        raise FoldcarError(f"{what}: {name} may be {' or '.join(found)}; write which")
    if not found:
        close = did_you_mean(name, [*known, *short.values()])
        raise FoldcarError(f"{what}: {name} is no design parameter; there are {', '.join(known)}{close}")
    return found[0]


def columns_named(values: Mapping[str, object], columns: Iterable[str], what: str) -> dict[str, float]:
    """The numbers of ``values`` by column. FoldcarError for names as above, no number, or a column named twice."""
    known, result = list(columns), dict[str, float]()
    for name, value in values.items():
        column = column_named(name, known, what)
        if column in result:
            raise FoldcarError(f"{what}: {name}: {column} is given twice")
        result[column] = finite(f"{what}: {name}", value, "a number (mm or degrees)")
    return result
