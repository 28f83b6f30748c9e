"""Variation of built cars around their design: distributions, and draws from them.

Input: standard deviations by name (defaults and their sources in workshop.json), a seed, a sample number. Output:
differences as JSON values, for wheels as lists of eight by servo channel; carsim applies them as a run's reality
(docs/carsim.md). The firmware keeps the parameters of the design, because it does not know the differences.
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
def workshop_spreads() -> dict[str, Spread]:
    """Return every spread by name, with its default standard deviation."""
    text = files("foldcar.car").joinpath("workshop.json").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, Spread]).validate_python(json.loads(text)["spreads"])


def spread_named(name_or_object: Any, place: str) -> Mapping[str, float]:
    """Return the standard deviations, by name, that a listing has at ``place``.

    ``"workshop"`` stands for the defaults, and ``{"from": "workshop", "supply_v": 0.4}`` changes one of them. Raises
    FoldcarError for an unknown name, and for a value that is not a number within its limits.
    """
    changes = dict(name_or_object) if isinstance(name_or_object, Mapping) else {"from": name_or_object}
    if "from" not in changes:
        raise FoldcarError(f'{place}: lacks "from"; write {{"from": "{WORKSHOP}", …}}')
    base = changes.pop("from")
    if base != WORKSHOP:
        raise FoldcarError(f'{place}: unknown variation {base!r}; known: "{WORKSHOP}"')
    spread = {name: quantity.sd for name, quantity in workshop_spreads().items()}
    for name, value in changes.items():
        if name not in spread:
            raise FoldcarError(f'{place}: unknown spread "{name}"; known: {", ".join(spread)}')
        quantity = workshop_spreads()[name]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise FoldcarError(f"{place}.{name}: {value!r} is not a number")
        if not 0 <= value <= quantity.largest_sd:
            limits = f"0 to {quantity.largest_sd:g} ({quantity.unit}, one sd)"
            # Not as a float, because an integer may be too large for one.
            raise FoldcarError(f"{place}.{name}: {value!s:.40} is outside {limits}")
        spread[name] = float(value)
    return spread


def named_car(name: str) -> str:
    """Return the ``sample`` with which :func:`draw` draws the built car of that name, not one of a sample."""
    return f"car {name}"


def draw(spread: Mapping[str, float], seed: int, sample: int | str) -> dict[str, Any]:
    """Draw how the built car of a sample differs from its design, for each quantity of the ``spread``.

    ``spread`` has standard deviations by name. The result depends on the arguments only. It has a list for a quantity of
    the wheels, and a number for a quantity of the whole car. Each name has a random stream of its own, so its draws do
    not change if the listing adds another quantity.
    """
    variation: dict[str, Any] = {}
    for name, sd in spread.items():
        quantity = workshop_spreads()[name]
        stream = random.Random(f"{seed}/{sample}/{name}")
        count = CHANNELS if quantity.per == "wheel" else 1
        draws = []
        for _ in range(count):
            standard_normal = stream.gauss(0, 1)
            draws.append(sd * max(-CUT_OFF, min(CUT_OFF, standard_normal)))
        if quantity.distribution == "half-normal":
            # The quantity is the magnitude of a vector, such as an eccentricity. All of these are of wheels, so the
            # random directions are a list, too.
            draws = [abs(value) for value in draws]
            variation[direction_key(name)] = [stream.uniform(0, 2 * math.pi) for _ in range(count)]
        variation[name] = draws if quantity.per == "wheel" else draws[0]
    return variation


def direction_key(name: str) -> str:
    """Return the key under which a draw has the direction of a half-normal quantity.

    Example: direction_key("eccentricity_m") is "eccentricity_phase_rad"
    """
    return name.removesuffix("_m") + "_phase_rad"


# The differences of servos, which wheels without a servo do not have.
SERVO_DIFFERENCES = frozenset(("servo_speed", "servo_torque", "neutral_us", "deadband_us"))
