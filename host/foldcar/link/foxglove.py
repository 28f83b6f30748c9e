"""Foxglove's messages as JSON: schemas of what is written of them, times, poses.

Foxglove knows them by their names; the schemas here are those fields of its own that foldcar writes.
"""

import math
from typing import Any


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _list_of(items: Any) -> dict[str, Any]:
    return {"type": "array", "items": items}


_INTEGER, _NUMBER, _TEXT = {"type": "integer"}, {"type": "number"}, {"type": "string"}
_TIME = {**_object(sec=_INTEGER, nsec=_INTEGER), "title": "time"}
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object(position=_VECTOR, orientation=_QUATERNION)
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_TRIANGLES = _object(
    pose=_POSE, points=_list_of(_VECTOR), color=_COLOUR, colors=_list_of(_COLOUR), indices=_list_of(_INTEGER)
)
_ENTITY = _object(
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime={**_object(sec=_INTEGER, nsec=_INTEGER), "title": "duration"},
    frame_locked={"type": "boolean"},
    metadata=_list_of(_object(key=_TEXT, value=_TEXT)),
    arrows=_list_of({"type": "object"}),
    cubes=_list_of(_object(pose=_POSE, size=_VECTOR, color=_COLOUR)),
    spheres=_list_of({"type": "object"}),
    cylinders=_list_of(
        _object(pose=_POSE, size=_VECTOR, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)
    ),
    lines=_list_of({"type": "object"}),
    triangles=_list_of(_TRIANGLES),
    texts=_list_of({"type": "object"}),
    models=_list_of({"type": "object"}),
)
LOG = _object(timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER)
SCENE_UPDATE = _object(deletions=_list_of({"type": "object"}), entities=_list_of(_ENTITY))
FRAME_TRANSFORM = _object(
    timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
)

WORLD, CAR = "world", "car"


def time_stamp(time_us: int) -> dict[str, int]:
    """A time (µs since 1970)."""
    seconds, micros = divmod(time_us, 1_000_000)
    return {"sec": seconds, "nsec": micros * 1000}


def vector(x: float, y: float, z: float) -> dict[str, float]:
    """A Vector3 or Point3."""
    return {"x": x, "y": y, "z": z}


def quaternion(heading_rad: float, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> dict[str, float]:
    """A turn about z, then nose up, then left side up."""
    (cy, sy), (cp, sp), (cr, sr) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in (heading_rad, -pitch_rad, roll_rad)
    )
    return {
        "x": cy * cp * sr - sy * sp * cr,
        "y": cy * sp * cr + sy * cp * sr,
        "z": sy * cp * cr - cy * sp * sr,
        "w": cy * cp * cr + sy * sp * sr,
    }


def frame_transform(
    time_us: int, x_m: float, y_m: float, z_m: float, heading_rad: float, pitch_rad: float, roll_rad: float
) -> dict[str, Any]:
    """The car's frame in the world at a time."""
    return {
        "timestamp": time_stamp(time_us),
        "parent_frame_id": WORLD,
        "child_frame_id": CAR,
        "translation": vector(x_m, y_m, z_m),
        "rotation": quaternion(heading_rad, pitch_rad, roll_rad),
    }
