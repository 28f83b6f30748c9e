"""The designs that a command names: a vehicle of a listing, with values set on the command line."""

from collections.abc import Sequence
from pathlib import Path

from foldcar.commands.options import design_settings
from foldcar.errors import FoldcarError
from foldcar.study.family import Family, read_family
from foldcar.study.listing import Listing
from foldcar.study.listing_file import read_listing


def listed_family(listing: Path, vehicle: str | None, settings: Sequence[str]) -> tuple[Listing, Family]:
    """The listing, and those designs of its vehicle that have the settings (NAME=MM).

    ``vehicle`` may be None if the listing has only one. FoldcarError if there is no such vehicle or value.
    """
    listed, _ = read_listing(listing)
    if vehicle is None and len(listed.vehicles) != 1:
        known = ", ".join(listed.vehicles)
        raise FoldcarError(f"{listing}: vehicles: has several; choose one with --vehicle: {known}")
    (family,) = _families(listing, listed, vehicle, settings)
    return listed, family


def listed_families(listing: Path, vehicle: str | None, settings: Sequence[str]) -> list[Family]:
    """Those designs of the vehicle, or of every one if ``vehicle`` is None, that have the settings. FoldcarError."""
    listed, _ = read_listing(listing)
    return _families(listing, listed, vehicle, settings)


def _families(file: Path, listed: Listing, vehicle: str | None, settings: Sequence[str]) -> list[Family]:
    if vehicle is not None and vehicle not in listed.vehicles:
        raise FoldcarError(f'{file}: vehicles: has no "{vehicle}"; known: {", ".join(listed.vehicles)}')
    names = list(listed.vehicles) if vehicle is None else [vehicle]
    chosen = design_settings(settings)
    return [read_family(file, name, listed.vehicles[name]).narrowed(chosen) for name in names]
