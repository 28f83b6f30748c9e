"""The designs that a command names: a vehicle of a listing, with values set on the command line."""

from collections.abc import Sequence
from pathlib import Path

from foldcar.commands.design_settings import design_settings
from foldcar.errors import FoldcarError
from foldcar.study.checked_listing import read_checked_listing
from foldcar.study.family import Family, read_family
from foldcar.study.listing import Listing


def listed_family(listing: Path, vehicle: str | None, settings: Sequence[str]) -> tuple[Listing, Family]:
    """The listing, and those designs of its vehicle that have the settings (NAME=MM).

    ``vehicle`` may be None if the listing has only one. FoldcarError if there is no such vehicle or value.
    """
    listed, _ = read_checked_listing(listing, programs=False)
    known = ", ".join(listed.vehicles)
    if vehicle is None:
        if len(listed.vehicles) != 1:
            raise FoldcarError(f"{listing}: vehicles: has several; choose one with --vehicle: {known}")
        (vehicle,) = listed.vehicles
    if vehicle not in listed.vehicles:
        raise FoldcarError(f'{listing}: vehicles: has no "{vehicle}"; known: {known}')
    family = read_family(listing, vehicle, listed.vehicles[vehicle])
    return listed, family.narrowed(design_settings(settings))
