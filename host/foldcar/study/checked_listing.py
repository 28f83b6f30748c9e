"""A listing with all its mistakes at once: those of its form, and those of its cars and programs.

Input: a listing file. Output: the Listing, or a ListingError that names every key at fault, its value and its limit.
"""

from pathlib import Path

from foldcar.did_you_mean import did_you_mean
from foldcar.study.family import Family, read_family
from foldcar.study.listing import Listing, ListingError
from foldcar.study.listing_file import load_listing, validated_listing


def read_checked_listing(file: Path, programs: bool) -> tuple[Listing, str]:
    """The listing and its text, its vehicles checked, and its ``programs`` if they are wanted. ListingError."""
    data, text = load_listing(file)
    listing, mistakes = validated_listing(data)
    for name, vehicle in listing.vehicles.items():
        try:
            family = read_family(file, name, vehicle)
        except ListingError as error:
            mistakes += error.mistakes
        else:
            mistakes += _family_mistakes(family)
    if programs:
        mistakes += _missing_programs(file, listing)
    if mistakes:
        raise ListingError(file, *mistakes)
    return listing, text


def _family_mistakes(family: Family) -> tuple[str, ...]:
    """Why no car of the family can be built; nothing if one can."""
    try:
        next(iter(family))
    except ListingError as error:
        return error.mistakes
    return ()


def _missing_programs(file: Path, listing: Listing) -> list[str]:
    missing = []
    for name, environment in listing.environments.items():
        program = file.parent / environment.scenic_filename
        if not program.is_file():
            others = [str(other.relative_to(file.parent)) for other in sorted(file.parent.glob("*.scenic"))]
            close = did_you_mean(environment.scenic_filename, others)
            missing.append(f"environments.{name}.scenic_filename: {program} is not a file{close}")
    return missing
