"""Variation of built cars around their design: distributions, draws from them, and the body of one built car.

Input: standard deviations by name (defaults and their sources in workshop.json), a seed, a sample number; a body as in
docs/carsim.md and the simulator's limits. Output: differences as JSON values, for wheels as lists of eight by servo
channel; the body with them. The firmware keeps the parameters of the design, because it does not know the differences.
"""

import json
import math
import random
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import TypeAdapter

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


@cache
def workshop() -> dict[str, Spread]:
    """Every spread by name, with its default standard deviation."""
    text = files("foldcar.car").joinpath("workshop.json").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, Spread]).validate_python(json.loads(text)["spreads"])


def spread_named(name_or_object: Any, place: str) -> Mapping[str, float]:
    """Parse the standard deviations by name that a listing sets at ``place``.

    ``"workshop"`` is the defaults; ``{"from": "workshop", "supply_v": 0.4}`` changes those named. Raises FoldcarError for
    unknown names or values that are not numbers within the limits.
    """
    changes = dict(name_or_object) if isinstance(name_or_object, Mapping) else {"from": name_or_object}
    start = changes.pop("from", None)
    if start != WORKSHOP:
        raise FoldcarError(f'{place}: unknown variation {start!r}; known: "{WORKSHOP}"')
    spread = {name: quantity.sd for name, quantity in workshop().items()}
    for name, value in changes.items():
        if name not in spread:
            raise FoldcarError(f'{place}: unknown spread "{name}"; known: {", ".join(spread)}')
        quantity = workshop()[name]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise FoldcarError(f"{place}.{name}: {value!r} is not a number")
        if not 0 <= value <= quantity.largest_sd:
            limits = f"0 to {quantity.largest_sd:g} ({quantity.unit}, one sd)"
            raise FoldcarError(f"{place}.{name}: {value:g} is outside {limits}")
        spread[name] = float(value)
    return spread


def named_car(name: str) -> str:
    """Return the ``sample`` with which :func:`draw` draws the built car of that name, not one of a sample."""
    return f"car {name}"


def draw(spread: Mapping[str, float], seed: int, sample: int | str) -> dict[str, Any]:
    """Draw the differences between the built car of ``sample`` and its design, which depend on the arguments only.

    Each name has its own random stream, so that its standardised draws do not depend on the other spreads.
    """
    variation: dict[str, Any] = {}
    for name, sd in spread.items():
        quantity = workshop()[name]
        stream = random.Random(f"{seed}/{sample}/{name}")
        count = CHANNELS if quantity.per == "wheel" else 1
        draws = [sd * max(-CUT_OFF, min(CUT_OFF, stream.gauss(0, 1))) for _ in range(count)]
        if quantity.distribution == "half-normal":
            draws = [abs(value) for value in draws]
            variation[phase_name(name)] = [stream.uniform(0, 2 * math.pi) for _ in range(count)]
        variation[name] = draws if quantity.per == "wheel" else draws[0]
    return variation


def phase_name(name: str) -> str:
    """The key, in a draw, of the direction of a half-normal spread: ``eccentricity_m`` → ``eccentricity_phase_rad``."""
    return name.removesuffix("_m") + "_phase_rad"


# Minimum and maximum of a body's numbers by their path, as `carsim limits` prints them.
NumberLimits = Mapping[str, tuple[float, float]]
# FACTORS: numbers that are multiplied by 1 + the difference named. SHIFTS: numbers to which the difference of the same
# name is added.
FACTORS = {
    "body": {},
    "body.segments": {
        "grip": "belly_grip",
        **dict.fromkeys(("mass_kg", "roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2"), "mass"),
    },
    "body.wheels": {"radius_m": "wheel_radius", "grip": "tyre_grip"},
    "body.wheels.servo": {"no_load_speed_rad_s": "servo_speed", "stall_torque_n_m": "servo_torque"},
}
SHIFTS = {
    "body": ("track_m", "supply_v"),
    "body.segments": ("com_x_m", "com_y_m", "com_z_m"),
    "body.wheels": (),
    "body.wheels.servo": ("neutral_us", "deadband_us"),
}
# The differences of servos, which wheels without a servo do not have.
SERVO_DIFFERENCES = frozenset((*FACTORS["body.wheels.servo"].values(), *SHIFTS["body.wheels.servo"]))
# Numbers that the difference named replaces: only hidden realities have these; they are alike at all wheels.
GIVEN = {
    "body": {"supply_resistance_ohm": "supply_resistance_ohm"},
    "body.wheels": {"wheel_camber_rad": "camber_rad", "tyre_contact_time_s": "contact_time_s"},
}
# No mass or speed becomes less than this fraction of its nominal value.
MIN_FACTOR = 0.05
# The maximum eccentricity of a wheel as a fraction of its radius.
MAX_ECCENTRICITY = 0.4


def vary_body(body: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    """Return the body with the differences; values outside the limits are clamped to them."""
    segments = [_varied("body.segments", segment, variation, limits) for segment in body["segments"]]
    own, alike = ({GIVEN[place][name]: variation[name] for name in variation if name in GIVEN[place]} for place in GIVEN)
    wheels = [{**_wheel(wheel, variation, limits), **alike} for wheel in body["wheels"]]
    return {**_varied("body", body, variation, limits), **own, "segments": segments, "wheels": wheels}


def _varied(place: str, values: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    """Return the numbers at a place of the body with the differences that apply there."""
    changed = {key: values[key] * max(MIN_FACTOR, 1 + variation.get(name, 0.0)) for key, name in FACTORS[place].items()}
    changed |= {key: values[key] + variation.get(key, 0.0) for key in SHIFTS[place]}
    return {**values, **{key: _within(limits[f"{place}.{key}"], value) for key, value in changed.items()}}


def _wheel(wheel: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    own = {name: of[wheel["channel"]] for name, of in variation.items() if isinstance(of, list)}
    varied = _varied("body.wheels", wheel, own, limits)
    if "servo" in wheel:
        servo = varied["servo"] = _varied("body.wheels.servo", wheel["servo"], own, limits)
        servo["saturation_us"] = max(servo["saturation_us"], servo["deadband_us"] + 1)
    if own.get("eccentricity_m", 0.0) > 0:
        varied["eccentricity_m"] = _within((0, MAX_ECCENTRICITY * varied["radius_m"]), own["eccentricity_m"])
        phase = phase_name("eccentricity_m")
        varied[phase] = _within(limits[f"body.wheels.{phase}"], own[phase])
    return varied


def _within(limits: tuple[float, float], value: float) -> float:
    """Clamp the value to the limits and round it to nine significant digits, as in body_json."""
    least, largest = limits
    return float(f"{min(max(value, least), largest):.9g}") + 0.0
