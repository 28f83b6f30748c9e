"""car.json: the car's description that its firmware keeps (docs/firmware.md describes the file).

Input: a Design. Output: the file's content, with a hash that identifies the design.
"""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.car.firmware_parameters import firmware_parameters

FORMAT = 1
HASH_DIGITS = 16
MOST_NAME_BYTES = 32
# The firmware derives these from wheels, wheel_radius_m and track_m of the file.
FIXED = ("WHEEL_RADIUS_M", "TRACK_M")
FIXED_ENDINGS = ("_SIDE", "_DIRECTION")


def car_json(design: Design) -> dict[str, Any]:
    """The content of car.json: lengths in m, masses in kg, servo channels counted from 1."""
    body = body_json(design)
    weights = [part["mass_kg"] for part in (*body["segments"], *body["wheels"])]
    return {
        "format": FORMAT,
        "name": design_name(design),
        "hash": _hash(design, body),
        **_geometry(body),
        "length_m": design.length_mm / 1000,
        "width_m": design.values["width"] / 1000,
        "mass_kg": round(sum(weights), 4),
        "parameters": {
            name: value
            for name, value in firmware_parameters(design, body).items()
            if name not in FIXED and not name.endswith(FIXED_ENDINGS)
        },
    }


def design_name(design: Design) -> str:
    """A readable name: modules, width × length and wheel radius in mm, at most 32 bytes of UTF-8."""
    values = design.values
    text = f"{design.composition} {values['width']:g}x{design.length_mm:g} r{values['radius']:g}"
    return text.encode()[:MOST_NAME_BYTES].decode(errors="ignore")


def design_hash(design: Design) -> str:
    """The first 16 hexadecimal digits of the SHA-256 of type, parameters and wiring; they identify the design."""
    return _hash(design, body_json(design))


def _hash(design: Design, body: Mapping[str, Any]) -> str:
    content = [design.type, dict(sorted(design.values.items())), _geometry(body)]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:HASH_DIGITS]


def _geometry(body: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "wheel_radius_m": body["wheels"][0]["radius_m"],
        "track_m": body["track_m"],
        "wheels": [
            {
                "channel": wheel["channel"] + 1,
                "side": wheel["side"],
                "direction": wheel["servo"]["direction"],
                "x_m": wheel["x_m"],
            }
            for wheel in body["wheels"]
        ],
    }
