"""Nearby cars: how a built car differs from its design, drawn at random and put into its simulator body.

Input: spreads by name (standard deviations; defaults and their sources in parts_data/workshop.json), a seed,
a sample. Output: differences as plain JSON, wheels' as eight values by servo channel; the body with them. The
firmware's parameters stay those of the design: the car does not know.
"""

import math
import random
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from foldcar.controller import CHANNELS
from foldcar.errors import FoldcarError

WORKSHOP = "workshop"
# Draws beyond this many standard deviations are put there: nobody drives such a car.
CUT_OFF = 3.0


class Spread(BaseModel):
    """One way in which cars differ. A half-normal one is a magnitude with a direction of its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    per: Literal["wheel", "car"]
    unit: str
    distribution: Literal["normal", "half-normal"]
    sd: float
    largest_sd: float
    source: str


class _Workshop(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    spreads: dict[str, Spread]


@cache
def workshop() -> dict[str, Spread]:
    """Every spread there is, by name, with its default."""
    text = files("foldcar").joinpath("parts_data").joinpath("workshop.json").read_text(encoding="utf-8")
    return _Workshop.model_validate_json(text).spreads


def spread_named(name_or_object: Any, place: str) -> Mapping[str, float]:
    """The standard deviations a listing asks for at ``place``; FoldcarError if it asks for something unknown.

    ``"workshop"`` is the defaults, ``{"from": "workshop", "supply_v": 0.4}`` the same but for those named.
    """
    changes = dict(name_or_object) if isinstance(name_or_object, Mapping) else {"from": name_or_object}
    if "from" not in changes:
        raise FoldcarError(f'{place}: "from" is missing; known: "{WORKSHOP}"')
    start = changes.pop("from")
    if start != WORKSHOP:
        raise FoldcarError(f'{place}: unknown variation {start!r}; known: "{WORKSHOP}"')
    spread = {name: known.sd for name, known in workshop().items()}
    for name, value in changes.items():
        if name not in spread:
            raise FoldcarError(f'{place}: unknown spread "{name}"; known: {", ".join(spread)}')
        known = workshop()[name]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise FoldcarError(f"{place}.{name}: {value!r} is not a number")
        if not 0 <= value <= known.largest_sd:
            raise FoldcarError(
                f"{place}.{name}: {value:g} is outside 0 to {known.largest_sd:g} ({known.unit}, one sd)"
            )
        spread[name] = float(value)
    return spread


def draw(spread: Mapping[str, float], seed: int, sample: int) -> dict[str, Any]:
    """How the car of ``sample`` differs from any design.

    Each name has a stream of its own, so that its standard draws stay the same whatever else varies or by how
    much. Depends on nothing but the arguments.
    """
    variation: dict[str, Any] = {}
    for name, sd in spread.items():
        known = workshop()[name]
        stream = random.Random(f"{seed}/{sample}/{name}")
        count = CHANNELS if known.per == "wheel" else 1
        draws = [sd * max(-CUT_OFF, min(CUT_OFF, stream.gauss(0, 1))) for _ in range(count)]
        if known.distribution == "half-normal":
            draws = [abs(value) for value in draws]
            variation[_phase_name(name)] = [stream.uniform(0, 2 * math.pi) for _ in range(count)]
        variation[name] = draws if known.per == "wheel" else draws[0]
    return variation


def apply(body: Mapping[str, Any], variation: Mapping[str, Any]) -> dict[str, Any]:
    """The body of docs/carsim.md with those differences; what would be impossible is put to its limit."""
    return {
        **body,
        "segments": [_segment(segment, variation) for segment in body["segments"]],
        "wheels": [_wheel(wheel, variation) for wheel in body["wheels"]],
        "supply_v": _within(0.1, body["supply_v"] + variation.get("supply_v", 0.0), 60),
    }


def _phase_name(name: str) -> str:
    return name.removesuffix("_m") + "_phase_rad"


def _segment(segment: Mapping[str, Any], variation: Mapping[str, Any]) -> dict[str, Any]:
    mass, grip = _factor(variation.get("mass", 0.0)), _factor(variation.get("belly_grip", 0.0))
    varied = {**segment, "grip": _within(0, segment["grip"] * grip, 5)}
    varied["mass_kg"] = _within(0.0005, segment["mass_kg"] * mass, 50)
    for axis in ("roll", "pitch", "yaw"):
        key = f"{axis}_inertia_kg_m2"
        varied[key] = _within(1e-7, segment[key] * mass, 50)
    for key in ("com_x_m", "com_y_m", "com_z_m"):
        varied[key] = _within(-1, segment[key] + variation.get(key, 0.0), 1)
    return varied


def _wheel(wheel: Mapping[str, Any], variation: Mapping[str, Any]) -> dict[str, Any]:
    channel = wheel["channel"]

    def of_wheel(name: str) -> float:
        value: float = variation[name][channel] if name in variation else 0.0
        return value

    servo = dict(wheel["servo"])
    servo["no_load_speed_rad_s"] = _within(
        0.1, servo["no_load_speed_rad_s"] * _factor(of_wheel("servo_speed")), 200
    )
    servo["stall_torque_n_m"] = _within(
        1e-4, servo["stall_torque_n_m"] * _factor(of_wheel("servo_torque")), 50
    )
    servo["neutral_us"] = _within(500, servo["neutral_us"] + of_wheel("neutral_us"), 2500)
    servo["deadband_us"] = _within(0, servo["deadband_us"] + of_wheel("deadband_us"), 500)
    servo["saturation_us"] = max(servo["saturation_us"], servo["deadband_us"] + 1)
    varied = {**wheel, "servo": servo}
    varied["radius_m"] = _within(0.005, wheel["radius_m"] * _factor(of_wheel("wheel_radius")), 0.5)
    varied["grip"] = _within(0, wheel["grip"] * _factor(of_wheel("tyre_grip")), 5)
    if of_wheel("eccentricity_m") > 0:
        varied["eccentricity_m"] = _within(0, of_wheel("eccentricity_m"), 0.4 * varied["radius_m"])
        varied["eccentricity_phase_rad"] = _within(0, of_wheel(_phase_name("eccentricity_m")), 7)
    return varied


def _factor(relative: float) -> float:
    """One more than ``relative``, but no wheel runs backwards and no mass is lost for good."""
    return max(0.05, 1 + relative)


def _within(least: float, value: float, largest: float) -> float:
    """Nine digits, as bodies have."""
    return float(f"{min(max(value, least), largest):.9g}") + 0.0
