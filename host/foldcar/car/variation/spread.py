"""Spreads: distributions of the differences between built cars and their design, and draws from them.

Input: standard deviations by name (defaults and their sources in workshop.json), a seed, a sample number. Output:
differences as JSON values; those of wheels are lists of eight, by servo channel.
"""

import math
import random
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from foldcar.car.firmware_parameters import CHANNELS
from foldcar.errors import FoldcarError

WORKSHOP = "workshop"
# Draws are clamped to this many standard deviations: builders would reject a car beyond.
CUT_OFF = 3.0


class Spread(BaseModel):
    """The distribution of one quantity. A half-normal one is the magnitude of a vector of uniform direction."""

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
    """Every spread by name, with its default standard deviation."""
    text = files("foldcar.car.variation").joinpath("workshop.json").read_text(encoding="utf-8")
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
            raise FoldcarError(
                f"{place}.{name}: {value:g} is outside 0 to {known.largest_sd:g} ({known.unit}, one sd)"
            )
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
