"""A trial's log as an MCAP file of JSON messages, for Foxglove and PlotJuggler.

Input: a .tlog, facts about the trial, a foxglove.SceneUpdate of car and ground. Output: the file, written atomically:
one topic for each sender (/car, /simulator, /host) and type of message with a schema from the dialect, status texts
also as foxglove.Log on /log, the scene on /scene, the simulated car's pose as foxglove.FrameTransform on /tf (a real
car's as a film shows it, else at its start), a film's poses on /camera/pose, the facts as metadata. Fields that are not
finite (NaN: not known) are left out.
Times are the car's, so that a simulation at another rate shows seconds of the car.
"""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy

from foldcar.link.connection import CAR_SYSTEM, SIMULATOR_COMPONENT
from foldcar.link.tlog import read_tlog, trial_start_s
from foldcar.outputs import atomic_file
from foldcar.version import __version__

# If the car's clock goes back by more than this, the car was reset; smaller steps are messages out of order.
DISORDER_US = 1_000_000
# The columns of a film's track.
FILMED = (
    "time_s", "x_m", "y_m", "z_m", "heading_rad", "pitch_rad", "roll_rad", "var_x_m2", "cov_x_y_m2",
    "cov_x_heading_m_rad", "var_y_m2", "cov_y_heading_m_rad", "var_heading_rad2", "var_z_m2", "var_pitch_rad2",
    "var_roll_rad2",
)  # fmt: skip
_FILMED_SCHEMA = {"type": "object", "title": "camera.Pose", "properties": {name: {"type": "number"} for name in FILMED}}
NO_START = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}


# Foxglove recognises its messages by their names; these schemas have only the fields that foldcar writes.
def _object(**properties: Any) -> dict[str, Any]:
    """Return the JSON schema of an object with these required properties."""
    return {"type": "object", "properties": properties, "required": list(properties)}


def _list_of(items: Any) -> dict[str, Any]:
    """Return the JSON schema of a list of such items."""
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
    cylinders=_list_of(_object(pose=_POSE, size=_VECTOR, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)),
    lines=_list_of({"type": "object"}),
    triangles=_list_of(_TRIANGLES),
    texts=_list_of({"type": "object"}),
    models=_list_of({"type": "object"}),
)
LOG = _object(timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER)
# foxglove.Log levels by MAVLink severity, 0 (emergency) to 7 (debug).
LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)
SCENE_UPDATE = _object(deletions=_list_of({"type": "object"}), entities=_list_of(_ENTITY))
FRAME_TRANSFORM = _object(
    timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
)

WORLD, CAR = "world", "car"


def export_mcap(
    log: Path,
    file: Path,
    facts: Mapping[str, str],
    scene_update: Mapping[str, Any] | None = None,
    start: Mapping[str, float] = NO_START,
    filmed: Sequence[Sequence[float]] = (),
) -> int:
    """Convert a log to the MCAP ``file``; return the number of the log's messages. Raises FoldcarError.

    ``start`` is the pose in which the car was placed, shown until the car's own pose is known. ``filmed`` are rows of a
    film's track, with the columns FILMED.
    """
    from mcap.writer import Writer

    messages = [
        (time_us, message)
        for time_us, message in read_tlog(log)
        if message.get_type() != "BAD_DATA" and not message.get_type().startswith("UNKNOWN")
    ]
    times_us = car_times_us(messages)
    with atomic_file(file) as binary:
        writer: Any = Writer(binary)
        writer.start(library=f"foldcar {__version__}")
        writer.add_metadata("trial", dict(facts))
        topics = _Topics(writer)
        if messages and scene_update is not None:
            first_us = min(times_us)
            entities = [{**entity, "timestamp": time_stamp(first_us)} for entity in scene_update["entities"]]
            topics.add("/scene", "foxglove.SceneUpdate", SCENE_UPDATE, {**scene_update, "entities": entities}, first_us)
            topics.add_pose(first_us, start["x_m"], start["y_m"], start.get("z_m", 0.0), start["heading_rad"], 0.0, 0.0)
        for time_us, (_, message) in sorted(zip(times_us, messages, strict=True), key=lambda pair: pair[0]):
            kind = message.get_type()
            topics.add(f"/{_sender(message)}/{kind}", kind, _schema(message), _content(message), time_us)
            if kind == "STATUSTEXT":
                topics.add("/log", "foxglove.Log", LOG, _foxglove_log(message, time_us), time_us)
            if kind == "FOLDCAR_TRUTH":
                pose = (message.x, message.y, message.z, message.heading, message.pitch, message.roll)
                if all(map(math.isfinite, pose)):
                    topics.add_pose(time_us, *pose)
        start_us = _trial_start_us(messages, times_us) if filmed else None
        if start_us is not None:
            has_true_pose = any(message.get_type() == "FOLDCAR_TRUTH" for _, message in messages)
            for row in filmed:
                time_us = start_us + round(1e6 * row[0])
                content = dict(zip(FILMED, row, strict=True))
                topics.add("/camera/pose", "camera.Pose", _FILMED_SCHEMA, content, time_us)
                if not has_true_pose:
                    topics.add_pose(time_us, *row[1:7])
        writer.finish()
    return len(messages)


def _trial_start_us(messages: Sequence[tuple[int, Any]], times_us: Sequence[int]) -> int | None:
    """Return when the log's trial began (µs since 1970); None if there is no trial."""
    start_s = trial_start_s([message for _, message in messages])
    # When the car was switched on, by each of its trial messages.
    boot_times_us = [
        time_us - 1000 * message.time_boot_ms
        for time_us, (_, message) in zip(times_us, messages, strict=True)
        if message.get_type() == "FOLDCAR_TRIAL"
    ]
    return None if start_s is None or not boot_times_us else int(boot_times_us[-1]) + round(1e6 * start_s)


class _Topics:
    """Writes messages on topics of an MCAP file; a topic is registered with its schema at its first message."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._channels: dict[str, int] = {}

    def add(self, topic: str, name: str, schema: Mapping[str, Any], content: Any, time_us: int) -> None:
        """Write a message; ``name`` is the schema's name."""
        if topic not in self._channels:
            schema_id = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", schema_id)
        data = json.dumps(content, allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], time_us * 1000, data, time_us * 1000)

    def add_pose(self, time_us: int, *pose: float) -> None:
        """Write the car's pose: x, y, z (m), heading, pitch, roll (rad)."""
        self.add("/tf", "foxglove.FrameTransform", FRAME_TRANSFORM, frame_transform(time_us, *pose), time_us)


def _sender(message: Any) -> str:
    """Return the sender of a message: host, simulator or car."""
    if message.get_srcSystem() != CAR_SYSTEM:
        return "host"
    return "simulator" if message.get_srcComponent() == SIMULATOR_COMPONENT else "car"


def _content(message: Any) -> dict[str, Any]:
    """Return a message's fields by name, without those that are NaN or infinite, which JSON cannot hold."""
    result = {}
    for name in message.get_fieldnames():
        value = getattr(message, name)
        value = list(value) if isinstance(value, bytes | bytearray | tuple) else value
        values = value if isinstance(value, list) else [value]
        if all(not isinstance(item, float) or math.isfinite(item) for item in values):
            result[name] = value
    return result


def _schema(message: Any) -> dict[str, Any]:
    """Return the JSON schema of a message's type, from the dialect's field types."""
    properties = {}
    units = message.fieldunits_by_name
    types = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    for name in message.get_fieldnames():
        kind = types[name]
        item_type = "string" if kind == "char" else "number" if kind in ("float", "double") else "integer"
        property_schema: dict[str, Any] = {"type": item_type}
        if kind != "char" and isinstance(getattr(message, name), list | tuple | bytes | bytearray):
            property_schema = {"type": "array", "items": {"type": item_type}}
        if name in units:
            # pymavlink writes units in brackets, as "[mV]".
            property_schema["description"] = units[name].strip("[]")
        properties[name] = property_schema
    return {"type": "object", "title": message.get_type(), "properties": properties}


def car_times_us(messages: Sequence[tuple[int, Any]]) -> list[int]:
    """Return a time (µs since 1970) for each message of a log, pairs of the host's time (µs) and the message.

    Times begin at the host's time and then advance with the car's clock, because a simulated car's clock may have another
    rate, and host times include the link's delays. Messages without a car's time are interpolated by their host times.
    """
    # Pairs (host time, result), ascending in both, between which other messages are interpolated.
    anchors: list[tuple[int, int]] = []
    # The result for messages with a car's time, by index.
    car_times: dict[int, int] = {}
    # What is added to the car's time since boot.
    offset_us: int | None = None
    last_boot_us = 0
    for index, (host_us, message) in enumerate(messages):
        boot_us = _since_boot_us(message)
        if boot_us is None:
            continue
        if offset_us is None:
            offset_us = host_us - boot_us
        elif boot_us < last_boot_us - DISORDER_US:
            # A reset has set the car's clock back; the host's clock gives the duration of the reset.
            last_host_us, last_us = anchors[-1]
            offset_us = last_us + (host_us - last_host_us) - boot_us
        last_boot_us = boot_us
        car_times[index] = offset_us + boot_us
        if not anchors or (host_us > anchors[-1][0] and car_times[index] >= anchors[-1][1]):
            anchors.append((host_us, car_times[index]))
    if not anchors:
        return [host_us for host_us, _ in messages]
    hosts, results = (numpy.array(side, dtype=float) for side in zip(*anchors, strict=True))
    # Subtracted, so that floating-point numbers keep microseconds.
    origin = hosts[0]
    interpolated = numpy.interp([host_us - origin for host_us, _ in messages], hosts - origin, results - origin)
    times = []
    for index, (host_us, _) in enumerate(messages):
        # Before the first and after the last anchor, the host's clock continues.
        outside = min(0.0, host_us - hosts[0]) + max(0.0, host_us - hosts[-1])
        times.append(car_times.get(index, round(interpolated[index] + outside + origin)))
    return times


def _since_boot_us(message: Any) -> int | None:
    """Return the time (µs since boot) in a message of the car or its simulator; None if it has no such time."""
    if message.get_srcSystem() != CAR_SYSTEM:
        return None
    if message.get_type() == "FOLDCAR_TRUTH":
        return int(message.time_usec)
    boot_ms = getattr(message, "time_boot_ms", None)
    return None if boot_ms is None else 1000 * int(boot_ms)


def _foxglove_log(message: Any, time_us: int) -> dict[str, Any]:
    """Return a status text as Foxglove's Log message."""
    return {
        "timestamp": time_stamp(time_us),
        "level": LEVELS[message.severity] if message.severity < len(LEVELS) else 0,
        "message": message.text,
        "name": _sender(message),
        "file": "",
        "line": 0,
    }


def time_stamp(time_us: int) -> dict[str, int]:
    """Return Foxglove's form of a time (µs since 1970)."""
    seconds, micros = divmod(time_us, 1_000_000)
    return {"sec": seconds, "nsec": micros * 1000}


def vector(x: float, y: float, z: float) -> dict[str, float]:
    """Return Foxglove's Vector3 or Point3."""
    return {"x": x, "y": y, "z": z}


def quaternion(heading_rad: float, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> dict[str, float]:
    """Return the quaternion of a rotation by the heading (about z), then the pitch (nose up), then the roll (left up)."""
    # x points forward, y left, z up. So nose up is a negative rotation about y.
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
    """Return Foxglove's FrameTransform with the car's pose in the world at a time (µs since 1970)."""
    return {
        "timestamp": time_stamp(time_us),
        "parent_frame_id": WORLD,
        "child_frame_id": CAR,
        "translation": vector(x_m, y_m, z_m),
        "rotation": quaternion(heading_rad, pitch_rad, roll_rad),
    }
