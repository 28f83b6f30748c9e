"""Cars in Python: by type and values, as a listing's vehicle, or as the Design that commands use."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar.api.names import columns_named
from foldcar.car.design import Design, compose, modules_of
from foldcar.car.folded_car import folded_car
from foldcar.car.modules import parameters
from foldcar.errors import FoldcarError
from foldcar.study.family import read_family
from foldcar.study.listing import ListingError
from foldcar.study.listing_file import validated_listing


def design(type: str, /, **values: float) -> Design:
    """The car of that type string with those parameters (mm, degrees) and defaults for all others.

    Names are those of tables' columns, with or without unit: ``design("W_B_W", width_mm=95, W_length=60)``. FoldcarError
    if there is no such parameter or the car cannot be built.
    """
    letters = set(modules_of(type))
    keys = {one.column: key for key, one in parameters().items() if one.modules & letters}
    named = columns_named(values, keys, f'design("{type}")')
    found = compose(type, {keys[column]: value for column, value in named.items()})
    # Raises what is wrong with the folded car.
    folded_car(found)
    return found


def design_of(car: Design | Mapping[str, Any]) -> Design:
    """``car`` itself, or the one design of a listing's vehicle: ``{"type": …, "params": [{"common": {…}}, …]}``.

    FoldcarError if it is invalid, cannot be built or is a family of several.
    """
    if isinstance(car, Design):
        return car
    if not isinstance(car, Mapping):
        raise FoldcarError(f"design: {car!r} is neither a Design nor a vehicle of a listing")
    listing, mistakes = validated_listing({"vehicles": {"design": dict(car)}})
    if mistakes:
        raise ListingError("design", *mistakes)
    return read_family(Path("design"), "design", listing.vehicles["design"]).single()
