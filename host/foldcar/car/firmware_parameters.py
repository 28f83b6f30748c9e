"""The firmware parameters of a design: values of rows of the table that `carsim params` prints.

Input: a Design; its body says which channel drives which wheel. Output: values by parameter name. The table itself
is declared in the firmware; this file only checks values against it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.errors import FoldcarError

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
