"""A trial's log as an MCAP file of JSON messages, for Foxglove and PlotJuggler.

Input: a .tlog, facts about the trial, a foxglove.SceneUpdate of car and ground. Output: the file, written atomically:
one topic for each sender (/car, /simulator, /host) and type of message with a schema from the dialect, status texts
also as foxglove.Log on /log, the scene on /scene, the simulated car's pose as foxglove.FrameTransform on /tf (a real
car's stays at its start), the facts as metadata. Fields that are not finite (NaN: not known) are left out.

Times are the car's (:mod:`foldcar.link.car_times`), so that a simulation at another rate shows seconds of the car.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar import __version__
from foldcar.link.car_times import car_times_us
from foldcar.link.connection import CAR_SYSTEM, SIMULATOR_COMPONENT
from foldcar.link.foxglove import FRAME_TRANSFORM, LOG, SCENE_UPDATE, frame_transform, time_stamp
from foldcar.link.tlog import read_tlog
from foldcar.outputs import atomic_file

# foxglove.Log levels by MAVLink severity, 0 (emergency) to 7 (debug).
LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)
NO_START = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}


def export_mcap(
    log: Path,
    file: Path,
    facts: Mapping[str, str],
    scene_update: Mapping[str, Any] | None = None,
    start: Mapping[str, float] = NO_START,
) -> int:
    """Write ``file`` and return the number of the log's messages; FoldcarError if log or file fails.

    ``start`` is where the car was put down, for the pose of a car that does not know its own.
    """
    from mcap.writer import Writer

    known = [
        (time_us, message)
        for time_us, message in read_tlog(log)
        if message.get_type() != "BAD_DATA" and not message.get_type().startswith("UNKNOWN")
    ]
    times_us = car_times_us(known)
    with atomic_file(file) as binary:
        writer: Any = Writer(binary)
        writer.start(library=f"foldcar {__version__}")
        writer.add_metadata("trial", dict(facts))
        topics = _Topics(writer)
        if known and scene_update is not None:
            first_us = min(times_us)
            entities = [{**one, "timestamp": time_stamp(first_us)} for one in scene_update["entities"]]
            topics.add("/scene", "foxglove.SceneUpdate", SCENE_UPDATE, {**scene_update, "entities": entities}, first_us)
            pose = (start["x_m"], start["y_m"], start.get("z_m", 0.0), start["heading_rad"], 0.0, 0.0)
            topics.add("/tf", "foxglove.FrameTransform", FRAME_TRANSFORM, frame_transform(first_us, *pose), first_us)
        for time_us, (_, message) in sorted(zip(times_us, known, strict=True), key=lambda pair: pair[0]):
            kind = message.get_type()
            topics.add(f"/{_sender(message)}/{kind}", kind, _schema(message), _content(message), time_us)
            if kind == "STATUSTEXT":
                topics.add("/log", "foxglove.Log", LOG, _log(message, time_us), time_us)
            if kind == "FOLDCAR_TRUTH":
                pose = (message.x, message.y, message.z, message.heading, message.pitch, message.roll)
                if all(map(math.isfinite, pose)):
                    transform = frame_transform(time_us, *pose)
                    topics.add("/tf", "foxglove.FrameTransform", FRAME_TRANSFORM, transform, time_us)
        writer.finish()
    return len(known)


class _Topics:
    """Registers topics with their schemas as they come."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._channels: dict[str, int] = {}

    def add(self, topic: str, name: str, schema: Mapping[str, Any], content: Any, time_us: int) -> None:
        """Write a message; ``name`` is that of the schema."""
        if topic not in self._channels:
            schema_id = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", schema_id)
        data = json.dumps(content, allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], time_us * 1000, data, time_us * 1000)


def _sender(message: Any) -> str:
    if message.get_srcSystem() != CAR_SYSTEM:
        return "host"
    return "simulator" if message.get_srcComponent() == SIMULATOR_COMPONENT else "car"


def _content(message: Any) -> dict[str, Any]:
    values = {name: _json_value(getattr(message, name)) for name in message.get_fieldnames()}
    return {name: value for name, value in values.items() if _finite(value)}


def _json_value(value: Any) -> Any:
    return list(value) if isinstance(value, bytes | bytearray | tuple) else value


def _finite(value: Any) -> bool:
    values = value if isinstance(value, list) else [value]
    return all(not isinstance(one, float) or math.isfinite(one) for one in values)


def _schema(message: Any) -> dict[str, Any]:
    """The JSON schema of a message's type, from the dialect's field types."""
    properties = {}
    units = message.fieldunits_by_name
    types = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    for name in message.get_fieldnames():
        kind = types[name]
        one = "string" if kind == "char" else "number" if kind in ("float", "double") else "integer"
        whole: dict[str, Any] = {"type": one}
        if kind != "char" and isinstance(getattr(message, name), list | tuple | bytes | bytearray):
            whole = {"type": "array", "items": {"type": one}}
        if name in units:
            whole["description"] = units[name].strip("[]")
        properties[name] = whole
    return {"type": "object", "title": message.get_type(), "properties": properties}


def _log(message: Any, time_us: int) -> dict[str, Any]:
    return {
        "timestamp": time_stamp(time_us),
        "level": LEVELS[message.severity] if message.severity < len(LEVELS) else 0,
        "message": message.text,
        "name": _sender(message),
        "file": "",
        "line": 0,
    }
