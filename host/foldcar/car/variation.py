"""How built cars differ from their design: distributions, draws from them, and the body of one built car.

Input: standard deviations by name (defaults and their sources in workshop.json), a seed, a sample number; a body as in
docs/carsim.md and the simulator's limits. Output: differences as JSON values, those of wheels as lists of eight, by servo
channel; the body with them. The firmware keeps the parameters of the design: it has no knowledge of the differences.
"""

import math
import random
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from foldcar.car.body import CHANNELS
from foldcar.car.parts.quantity import Data
from foldcar.errors import FoldcarError

WORKSHOP = "workshop"
# Draws are clamped to this many standard deviations: builders would reject a car beyond.
CUT_OFF = 3.0


class Spread(Data):
    """The distribution of one quantity. A half-normal one is the magnitude of a vector of uniform direction."""

    per: Literal["wheel", "car"]
    unit: str
    distribution: Literal["normal", "half-normal"]
    sd: float
    largest_sd: float
    source: str


class _Workshop(Data):
    name: str
    spreads: dict[str, Spread]


@cache
def workshop() -> dict[str, Spread]:
    """Every spread by name, with its default standard deviation."""
    text = files("foldcar.car").joinpath("workshop.json").read_text(encoding="utf-8")
    return _Workshop.model_validate_json(text).spreads


def spread_named(name_or_object: Any, place: str) -> Mapping[str, float]:
    """The standard deviations by name that a listing sets at ``place``; FoldcarError for unknown names or bad values.

    ``"workshop"`` is the defaults; ``{"from": "workshop", "supply_v": 0.4}`` changes those named.
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
            raise FoldcarError(f"{place}.{name}: {value:g} is outside 0 to {known.largest_sd:g} ({known.unit}, one sd)")
        spread[name] = float(value)
    return spread


def draw(spread: Mapping[str, float], seed: int, sample: int) -> dict[str, Any]:
    """The differences between the built car number ``sample`` and its design; they depend on the arguments only.

    Each name has its own random stream, so that its standardised draws do not depend on the other spreads.
    """
    variation: dict[str, Any] = {}
    for name, sd in spread.items():
        known = workshop()[name]
        stream = random.Random(f"{seed}/{sample}/{name}")
        count = CHANNELS if known.per == "wheel" else 1
        draws = [sd * max(-CUT_OFF, min(CUT_OFF, stream.gauss(0, 1))) for _ in range(count)]
        if known.distribution == "half-normal":
            draws = [abs(value) for value in draws]
            variation[phase_name(name)] = [stream.uniform(0, 2 * math.pi) for _ in range(count)]
        variation[name] = draws if known.per == "wheel" else draws[0]
    return variation


def phase_name(name: str) -> str:
    """The key, in a draw, of the direction of a half-normal spread: ``eccentricity_m`` → ``eccentricity_phase_rad``."""
    return name.removesuffix("_m") + "_phase_rad"


# The least and the largest value of a body's numbers by their path, as `carsim limits` prints them.
NumberLimits = Mapping[str, tuple[float, float]]
# An axle does not come closer to its tyre than this share of the radius.
LARGEST_ECCENTRICITY = 0.4


def vary_body(body: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    """The body with the differences; values outside the limits are clamped to them."""
    return {
        **body,
        "segments": [_segment(segment, variation, limits) for segment in body["segments"]],
        "wheels": [_wheel(wheel, variation, limits) for wheel in body["wheels"]],
        "track_m": _within(limits["body.track_m"], body["track_m"] + variation.get("track_m", 0.0)),
        "supply_v": _within(limits["body.supply_v"], body["supply_v"] + variation.get("supply_v", 0.0)),
    }


def _segment(segment: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    mass = _factor(variation.get("mass", 0.0))
    values = {
        "grip": segment["grip"] * _factor(variation.get("belly_grip", 0.0)),
        "mass_kg": segment["mass_kg"] * mass,
        **{key: segment[key] * mass for key in ("roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2")},
        **{key: segment[key] + variation.get(key, 0.0) for key in ("com_x_m", "com_y_m", "com_z_m")},
    }
    return {**segment, **{key: _within(limits[f"body.segments.{key}"], value) for key, value in values.items()}}


def _wheel(wheel: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    channel = wheel["channel"]

    def of_wheel(name: str) -> float:
        value: float = variation[name][channel] if name in variation else 0.0
        return value

    servo = dict(wheel["servo"])
    values = {
        "no_load_speed_rad_s": servo["no_load_speed_rad_s"] * _factor(of_wheel("servo_speed")),
        "stall_torque_n_m": servo["stall_torque_n_m"] * _factor(of_wheel("servo_torque")),
        "neutral_us": servo["neutral_us"] + of_wheel("neutral_us"),
        "deadband_us": servo["deadband_us"] + of_wheel("deadband_us"),
    }
    servo.update({key: _within(limits[f"body.wheels.servo.{key}"], value) for key, value in values.items()})
    servo["saturation_us"] = max(servo["saturation_us"], servo["deadband_us"] + 1)
    varied = {**wheel, "servo": servo}
    varied["radius_m"] = _within(limits["body.wheels.radius_m"], wheel["radius_m"] * _factor(of_wheel("wheel_radius")))
    varied["grip"] = _within(limits["body.wheels.grip"], wheel["grip"] * _factor(of_wheel("tyre_grip")))
    if of_wheel("eccentricity_m") > 0:
        largest = LARGEST_ECCENTRICITY * varied["radius_m"]
        varied["eccentricity_m"] = _within((0, largest), of_wheel("eccentricity_m"))
        phase = of_wheel(phase_name("eccentricity_m"))
        varied["eccentricity_phase_rad"] = _within(limits["body.wheels.eccentricity_phase_rad"], phase)
    return varied


def _factor(relative: float) -> float:
    """1 + ``relative``, at least 0.05, so that no mass or speed becomes zero or negative."""
    return max(0.05, 1 + relative)


def _within(limits: tuple[float, float], value: float) -> float:
    """The value clamped to the limits and rounded to nine significant digits, as in body_json."""
    least, largest = limits
    return float(f"{min(max(value, least), largest):.9g}") + 0.0
