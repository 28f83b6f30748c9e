"""Values that a Scenic program records, as JSON."""

import math
import sys
from typing import Any

import numpy

from foldcar.errors import FoldcarError

# Far below the limits of carsim and of Python's json.
MAX_DEPTH = 20


def to_json(value: Any, name: str, depth: int = 0) -> Any:
    """Convert the value of the record ``name`` to JSON data.

    Vectors become [x, y, z], orientations [yaw, pitch, roll] in radians, numpy's arrays lists. ``depth`` counts the lists
    and dictionaries around the value. Raises FoldcarError, which names the record, for other types of values.
    """
    if depth > MAX_DEPTH:
        raise FoldcarError(f"record {name}: its value is nested deeper than {MAX_DEPTH}")
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _text(value, name)
    if isinstance(value, int):
        if abs(value) > sys.float_info.max:
            raise FoldcarError(f"record {name}: an integer is above the limit {sys.float_info.max:.2g}")
        return int(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise FoldcarError(f"record {name}: {value} is not finite")
        return float(value)
    if isinstance(value, numpy.generic | numpy.ndarray):
        return to_json(value.tolist(), name, depth)
    if isinstance(value, list | tuple):
        return [to_json(item, name, depth + 1) for item in value]
    if isinstance(value, dict):
        other_keys = [key for key in value if not isinstance(key, str)]
        if other_keys:
            raise FoldcarError(f"record {name}: the key {other_keys[0]!r} of its value is not a string")
        return {_text(key, name): to_json(item, name, depth + 1) for key, item in value.items()}
    if type(value).__module__ == "scenic.core.vectors":
        euler_angles = getattr(value, "eulerAngles", None)
        return to_json(list(value) if euler_angles is None else list(euler_angles), name)
    raise FoldcarError(f"record {name}: a {type(value).__name__} cannot be stored; record its numbers instead")


def _text(text: str, name: str) -> str:
    """Return a text of the record ``name``. Raises FoldcarError if it cannot be encoded as UTF-8."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise FoldcarError(f"record {name}: the string {text!a} is not Unicode (half of a surrogate pair)") from None
    return str(text)
