"""Types and units of Parquet columns: recorded lists as lists, units as the metadata ``unit`` of a column.

Input: names of columns, values of the store. Output: pyarrow's fields.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from foldcar.simulation.results import METRICS, Recorded

UNITS = {**{metric.name: metric.unit for metric in METRICS}, "elapsed_time_s": "s"}
# Units that names of parameters and sampled values end in.
SUFFIXES = ("mm", "deg", "m", "rad", "v", "us")
NUMBER = int | float


def field(name: str, kind: Any) -> Any:
    """A column of that type of pyarrow's, with its unit if it has one."""
    import pyarrow as pa

    suffix = name.rpartition("_")[2]
    unit = UNITS.get(name, suffix if suffix in SUFFIXES else None)
    return pa.field(name, kind, metadata=None if unit is None else {"unit": unit})


def list_type(recorded: Iterable[Recorded | None]) -> Any:
    """The type that holds all values of a name as lists; None if only JSON does.

    A list of numbers is list<double>, a series list<struct<time_s, value>>.
    """
    import pyarrow as pa

    found = [one for one in recorded if one is not None and one.value is not None]
    if not found or not all(isinstance(one.value, list) for one in found):
        return None
    if all(one.kind == "series" for one in found):
        inner = _type_of([entry[1] for one in found for entry in one.value])
        return inner and pa.list_(pa.struct([pa.field("time_s", pa.float64(), metadata={"unit": "s"}), ("value", inner)]))
    return None if any(one.kind == "series" for one in found) else _type_of([one.value for one in found])


def list_cell(recorded: Recorded | None) -> Any:
    """A value as a cell of a column of :func:`list_type`."""
    if recorded is None or recorded.kind != "series":
        return None if recorded is None else recorded.value
    return [{"time_s": time_s, "value": value} for time_s, value in recorded.value or ()]


def _type_of(values: Sequence[Any]) -> Any:
    """The type of numbers, truths, texts, or lists of one of them; None for anything else, or a mixture."""
    import pyarrow as pa

    known = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in known):
        return pa.bool_() if known else pa.float64()
    if all(isinstance(value, NUMBER) and not isinstance(value, bool) for value in known):
        return pa.float64()
    if all(isinstance(value, str) for value in known):
        return pa.string()
    if all(isinstance(value, list) for value in known):
        inner = _type_of([one for value in known for one in value])
        return inner and pa.list_(inner)
    return None
