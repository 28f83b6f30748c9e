"""Values that a Scenic program records, as JSON."""

import math
from typing import Any

import numpy

from foldcar.errors import FoldcarError


def to_json(value: Any, name: str) -> Any:
    """``value`` as JSON data, copied; FoldcarError that names the record ``name`` if it means nothing without Scenic.

    Vectors become [x, y, z], orientations [yaw, pitch, roll] in radians, numpy's arrays lists.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise FoldcarError(f"record {name}: {value} is not finite")
        return float(value)
    if isinstance(value, numpy.generic | numpy.ndarray):
        return to_json(value.tolist(), name)
    if isinstance(value, list | tuple):
        return [to_json(item, name) for item in value]
    if isinstance(value, dict):
        keys = [key for key in value if not isinstance(key, str)]
        if keys:
            raise FoldcarError(f"record {name}: the key {keys[0]!r} of its value is no text")
        return {key: to_json(item, name) for key, item in value.items()}
    if type(value).__module__ == "scenic.core.vectors":
        angles = getattr(value, "eulerAngles", None)
        return to_json(list(value) if angles is None else list(angles), name)
    raise FoldcarError(f"record {name}: a {type(value).__name__} is nothing to store; record its numbers instead")
