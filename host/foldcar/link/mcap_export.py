"""A trial's log as an MCAP file of JSON messages, for Foxglove and PlotJuggler.

Input: a .tlog and facts about the trial. Output: the file, written atomically: one topic for each sender (/car,
/simulator, /host) and type of message with a schema from the dialect, status texts also as foxglove.Log on /log, the
facts as metadata. Values that JSON cannot represent (NaN, infinities) are null.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar import __version__
from foldcar.atomic_file import atomic_file
from foldcar.link.connection import CAR_SYSTEM, SIMULATOR_COMPONENT
from foldcar.link.tlog import read_tlog

# foxglove.Log levels by MAVLink severity, 0 (emergency) to 7 (debug).
LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)
LOG_SCHEMA = {
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "level": {"type": "integer"},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer"},
    },
}


def export_mcap(log: Path, file: Path, facts: Mapping[str, str]) -> int:
    """Write ``file`` and return the number of messages; FoldcarError if log or file fails."""
    from mcap.writer import Writer

    count = 0
    with atomic_file(file) as binary:
        writer: Any = Writer(binary)
        writer.start(library=f"foldcar {__version__}")
        writer.add_metadata("trial", dict(facts))
        channels: dict[str, int] = {}
        for time_us, message in read_tlog(log):
            kind = message.get_type()
            if kind == "BAD_DATA" or kind.startswith("UNKNOWN"):
                continue
            _add(writer, channels, f"/{_sender(message)}/{kind}", kind, _schema(message), _content(message), time_us)
            if kind == "STATUSTEXT":
                _add(writer, channels, "/log", "foxglove.Log", LOG_SCHEMA, _log(message, time_us), time_us)
            count += 1
        writer.finish()
    return count


def _add(
    writer: Any, channels: dict[str, int], topic: str, name: str, schema: Mapping[str, Any], content: Any, time_us: int
) -> None:
    if topic not in channels:
        schema_id = writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        channels[topic] = writer.register_channel(topic, "json", schema_id)
    data = json.dumps(content, allow_nan=False).encode()
    writer.add_message(channels[topic], time_us * 1000, data, time_us * 1000)


def _sender(message: Any) -> str:
    if message.get_srcSystem() != CAR_SYSTEM:
        return "host"
    return "simulator" if message.get_srcComponent() == SIMULATOR_COMPONENT else "car"


def _content(message: Any) -> dict[str, Any]:
    return {name: _json_value(getattr(message, name)) for name in message.get_fieldnames()}


def _json_value(value: Any) -> Any:
    if isinstance(value, bytes | bytearray):
        return list(value)
    if isinstance(value, list | tuple):
        return [_json_value(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


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
    seconds, micros = divmod(time_us, 1_000_000)
    return {
        "timestamp": {"sec": seconds, "nsec": micros * 1000},
        "level": LEVELS[message.severity] if message.severity < len(LEVELS) else 0,
        "message": message.text,
        "name": _sender(message),
        "file": "",
        "line": 0,
    }
