"""car.json: the car's description that its firmware keeps (docs/firmware.md), and the firmware's parameters for it.

Input: a Design. Output: the file's content, with a hash that identifies the design; values of rows of the parameter table
that `carsim params` prints, which is declared in the firmware and is only checked against here.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.errors import FoldcarError

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


# Values of CHn_SIDE.
SIDES = {"unused": 0, "left": 1, "right": 2}
CHANNELS = 8


@dataclass(frozen=True, slots=True)
class TableRow:
    """One row of the firmware's parameter table; limits and default are in ``unit``."""

    name: str
    unit: str
    minimum: float
    maximum: float
    default: float


def firmware_parameters(design: Design, body: Mapping[str, Any] | None = None) -> dict[str, float]:
    """The firmware's parameter values for this car; ``body`` is its body_json, if known already.

    Channels count from 1 in parameter names and from 0 in the body.
    """
    body = body if body is not None else body_json(design)
    wheels = {wheel["channel"]: wheel for wheel in body["wheels"]}
    first = body["wheels"][0]
    values: dict[str, float] = {
        "WHEEL_RADIUS_M": first["radius_m"],
        "TRACK_M": body["track_m"],
        "WHEEL_MAX_RAD_S": first["servo"]["no_load_speed_rad_s"],
    }
    for channel in range(CHANNELS):
        prefix, wheel = f"CH{channel + 1}", wheels.get(channel)
        if wheel is None:
            values[f"{prefix}_SIDE"] = SIDES["unused"]
            continue
        servo = wheel["servo"]
        span_us = servo["saturation_us"] - servo["deadband_us"]
        values[f"{prefix}_SIDE"] = SIDES[wheel["side"]]
        values[f"{prefix}_DIRECTION"] = servo["direction"]
        values[f"{prefix}_NEUTRAL_US"] = servo["neutral_us"]
        values[f"{prefix}_DEADBAND_US"] = servo["deadband_us"]
        values[f"{prefix}_GAIN_US"] = float(f"{span_us / servo['no_load_speed_rad_s']:.9g}")
    return values


def check_parameters(values: Mapping[str, float], table: Mapping[str, TableRow]) -> None:
    """FoldcarError if the table lacks a parameter or its limits exclude the value."""
    for name, value in values.items():
        row = table.get(name)
        if row is None:
            raise FoldcarError(f"firmware parameter {name}: the firmware of this carsim has no such parameter")
        if not row.minimum <= value <= row.maximum:
            limits = f"{row.minimum:g} to {row.maximum:g} {row.unit}".rstrip()
            raise FoldcarError(f"firmware parameter {name}: {value:g} is outside the firmware's limits {limits}")
