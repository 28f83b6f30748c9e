"""Cars in Python, by type and values or as a listing's vehicle, and the simulator's input for their runs."""

from collections.abc import Iterable, Mapping
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
from foldcar.shown_text import shown_value
from foldcar.store.writer import canonical_json
from foldcar.study.experiments import run_settings
from foldcar.study.family import read_family
from foldcar.study.limits import MAX_SEED
from foldcar.study.listing import ExperimentParams, ListingError
from foldcar.study.listing_file import listing_mistake, validated_listing

# The names that arguments have in a listing.
LISTING_KEYS = {"timeout_s": "timeout", "speed_m_s": "speed", "yaw_rate_rad_s": "yaw_rate"}
# Number of designs whose results are cached: compiling one takes about 10 ms, as long as a run.
KEPT_DESIGNS = 1000


def design(type: str, /, **values: float) -> Design:
    """Return the design of a car from its type string and its parameters (mm, degrees).

    Parameters that are not given have their default values. A parameter is named as in foldcar's tables, and its unit may
    be left out: ``width_mm`` or ``width``. Raises FoldcarError if there is no such parameter, or if the car cannot be
    built.

    >>> car = foldcar.design("W_B_W", width_mm=95, W_length=60, W2_radius=50)
    >>> car.width_mm, car.radii_mm
    (95.0, (60.0, 50.0))
    """
    if not isinstance(type, str):
        raise FoldcarError(f'type: {shown_value(type)} is not a type string, such as "W_B_W"')
    key_by_column = _parameter_keys(type, values)
    values_by_column = columns_named(values, key_by_column, f'design("{type}")')
    values_by_key = {key_by_column[column]: value for column, value in values_by_column.items()}
    car_design = compose(type, values_by_key)
    # This raises DesignError if the car cannot be folded.
    folded_car(car_design)
    return car_design


def _parameter_keys(type_string: str, names: Iterable[str]) -> dict[str, str]:
    """Return the keys of the parameters that a car of this type has, by their column in foldcar's tables.

    A car has the parameters of its kinds of modules, such as ``W.length`` of all modules W. Besides, a parameter may be
    set for a single module, such as ``W2.length``, whose column is ``W2_length``. ``names`` are columns. If one of them
    is of a single module, the result also has all parameters of this module.
    """
    kinds_of_modules = set(modules_of(type_string))
    key_by_column = {}
    for key, parameter in parameters().items():
        if parameter.modules & kinds_of_modules:
            key_by_column[parameter.column] = key
    single_modules = {name.partition("_")[0] for name in names}
    for module in single_modules:
        for parameter_name in names_in(module):
            found = find_parameter(module, parameter_name)
            if found is not None and found.modules & kinds_of_modules:
                key_by_column[found.column] = found.key
    return key_by_column


def design_of(car: Design | Mapping[str, Any]) -> Design:
    """Return ``car``, or the only design of a listing's vehicle: ``{"type": …, "params": [{"common": {…}}, …]}``.

    Raises FoldcarError if it is invalid, cannot be built or is a family of several designs.
    """
    if isinstance(car, Design):
        return car
    if not isinstance(car, Mapping):
        raise FoldcarError(
            f'design: {shown_value(car)} is neither a result of foldcar.design nor a vehicle of a listing, {{"type": …}}'
        )
    listing, mistakes = validated_listing({"vehicles": {"design": dict(car)}})
    if mistakes:
        raise ListingError("design", *mistakes)
    return read_family(Path("design"), "design", listing.vehicles["design"]).single()


def body_and_settings(
    design: Design, timeout_s: float, speed_m_s: float | None, yaw_rate_rad_s: float
) -> tuple[str, str]:
    """Return what the simulator needs for runs of a design, as two JSON texts: the car's body and the settings of runs.

    The body has the car's sizes, masses and servos. The settings have the three other arguments. Raises FoldcarError if
    an argument is outside its limits.
    """
    return _body_and_settings(
        design.type,
        tuple(design.values.items()),
        timeout_s=finite("timeout_s", timeout_s),
        speed_m_s=None if speed_m_s is None else finite("speed_m_s", speed_m_s),
        yaw_rate_rad_s=finite("yaw_rate_rad_s", yaw_rate_rad_s),
    )


def built_cars(count: int, variation: str | Mapping[str, float], variation_seed: int) -> list[str]:
    """Draw how each of ``count`` built cars differs from its design, and return these differences as JSON texts.

    A difference is a random number with the standard deviation of its quantity, such as a servo's speed. ``variation``
    and ``variation_seed`` mean the same as in a listing. Raises FoldcarError.
    """
    if not isinstance(variation, str | Mapping):
        raise FoldcarError(
            f'variation: {shown_value(variation)} is neither "workshop" nor standard deviations, '
            '{"from": "workshop", …}'
        )
    standard_deviations = spread_named(variation, "variation")
    seed = checked_int("variation_seed", variation_seed, 0, MAX_SEED)
    return [canonical_json(draw(standard_deviations, seed, sample)) for sample in range(count)]


@lru_cache(KEPT_DESIGNS)
def _body_and_settings(
    type_string: str, values: tuple[tuple[str, float], ...], **arguments: float | None
) -> tuple[str, str]:
    """Return the body and the settings of a design, as :func:`body_and_settings` does. Results are cached.

    ``values`` are the design's parameters, in a form that can be cached. ``arguments`` are the other arguments of
    :func:`body_and_settings` by name; None stands for the default of a listing.
    """
    design = compose(type_string, dict(values))
    body = body_json(design)
    # The arguments have the same limits as the values of a listing, so they are checked like these.
    listing_values = {}
    for name, argument in arguments.items():
        if argument is not None:
            listing_values[LISTING_KEYS[name]] = argument
    try:
        params = ExperimentParams.model_validate(listing_values)
    except ValidationError as error:
        raise FoldcarError(_named_as_argument(listing_mistake(error.errors()[0]))) from None
    try:
        settings = run_settings(design, body, _table(), params.timeout, params.speed, params.yaw_rate, "simulation")
    except ListingError as error:
        raise FoldcarError(_named_as_argument(str(error).removeprefix("simulation.params."))) from None
    return canonical_json(body), canonical_json(settings)


def _named_as_argument(mistake: str) -> str:
    """Return a mistake of a listing, which begins with its key, with the argument's name in place of the key."""
    key, _, text = mistake.partition(":")
    for argument, listing_key in LISTING_KEYS.items():
        if listing_key == key:
            return f"{argument}:{text}"
    return mistake


@cache
def _table() -> dict[str, TableRow]:
    """Return the firmware's parameters by name."""
    return simulator().parameter_table()
