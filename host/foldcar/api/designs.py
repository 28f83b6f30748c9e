"""Cars in Python, by type and values or as a listing's vehicle, and the simulator's input for their runs."""

from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from foldcar.api.arguments import checked_int, columns_named, finite
from foldcar.api.environment import simulator
from foldcar.car.body import TableRow, body_json
from foldcar.car.design import Design, compose, modules_of
from foldcar.car.design_parameters import find_parameter, names_in, parameters
from foldcar.car.folded_car import folded_car
from foldcar.car.variation import draw, spread_named
from foldcar.errors import FoldcarError
from foldcar.store.writer import canonical_json
from foldcar.study.experiments import run_settings
from foldcar.study.family import read_family
from foldcar.study.limits import MAX_SEED
from foldcar.study.listing import ExperimentParams, ListingError
from foldcar.study.listing_file import validated_listing

# The names of these arguments in a listing.
LISTING_KEYS = {"timeout_s": "timeout", "speed_m_s": "speed", "yaw_rate_rad_s": "yaw_rate"}
# Compiling a design takes about 10 ms, as long as a run, so the results for the last designs are cached.
KEPT_DESIGNS = 1000


def design(type: str, /, **values: float) -> Design:
    """Return the car of this type string with these parameters (mm, degrees), and defaults for all others.

    Names are columns of tables, with or without unit. Raises FoldcarError if there is no such parameter or the car cannot
    be built.

    >>> car = foldcar.design("W_B_W", width_mm=95, W_length=60, W2_radius=50)
    >>> car.width_mm, car.radii_mm
    (95.0, (60.0, 50.0))
    """
    letters = set(modules_of(type))
    keys = {parameter.column: key for key, parameter in parameters().items() if parameter.modules & letters}
    for place in {name.partition("_")[0] for name in values}:
        of_place = (find_parameter(place, name) for name in names_in(place))
        keys |= {p.column: p.key for p in of_place if p is not None and p.modules & letters}
    named = columns_named(values, keys, f'design("{type}")')
    result = compose(type, {keys[column]: value for column, value in named.items()})
    # Raises DesignError if the car cannot be folded.
    folded_car(result)
    return result


def design_of(car: Design | Mapping[str, Any]) -> Design:
    """Return ``car``, or the only design of a listing's vehicle: ``{"type": …, "params": [{"common": {…}}, …]}``.

    Raises FoldcarError if it is invalid, cannot be built or is a family of several designs.
    """
    if isinstance(car, Design):
        return car
    if not isinstance(car, Mapping):
        raise FoldcarError(f"design: {car!r} is neither a Design nor a vehicle of a listing")
    listing, mistakes = validated_listing({"vehicles": {"design": dict(car)}})
    if mistakes:
        raise ListingError("design", *mistakes)
    return read_family(Path("design"), "design", listing.vehicles["design"]).single()


def prepared(design: Design, timeout_s: float, speed_m_s: float | None, yaw_rate_rad_s: float) -> tuple[str, str]:
    """Return body and settings of the design's runs as JSON. Raises FoldcarError if an argument exceeds its limits."""
    arguments = {"timeout_s": timeout_s, "speed_m_s": speed_m_s, "yaw_rate_rad_s": yaw_rate_rad_s}
    numbers = [None if value is None else finite(name, value) for name, value in arguments.items()]
    return _prepared(design.type, tuple(design.values.items()), *numbers)


def built_cars(count: int, spread: str | Mapping[str, float], seed: int) -> list[str]:
    """Return the realities of ``count`` built cars, drawn as for a listing's ``variation``. Raises FoldcarError."""
    standard_deviations = spread_named(spread, "variation")
    number = checked_int("variation_seed", seed, 0, MAX_SEED)
    return [canonical_json(draw(standard_deviations, number, k)) for k in range(count)]


@lru_cache(KEPT_DESIGNS)
def _prepared(type_string: str, values: tuple[tuple[str, float], ...], *arguments: float | None) -> tuple[str, str]:
    """Return body and settings as JSON, from hashable arguments so that the result is cached."""
    design = compose(type_string, dict(values))
    body = body_json(design)
    # Check the arguments with a listing's limits.
    listing_values = {
        key: argument for key, argument in zip(LISTING_KEYS.values(), arguments, strict=True) if argument is not None
    }
    try:
        params = ExperimentParams.model_validate(listing_values)
    except ValidationError as error:
        first = error.errors()[0]
        name = {listed: name for name, listed in LISTING_KEYS.items()}[str(first["loc"][0])]
        raise FoldcarError(f"{name}: {first['input']:g}: {first['msg'].lower()}") from None
    settings = run_settings(design, body, _table(), params.timeout, params.speed, params.yaw_rate, "simulation")
    return canonical_json(body), canonical_json(settings)


@cache
def _table() -> dict[str, TableRow]:
    return simulator().parameter_table()
