"""Reads the file of an experiment listing (JSON; comments and trailing commas are allowed).

It reports all mistakes in form, cars and programs, each with its key.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import json5
from pydantic import ValidationError

from foldcar.errors import FoldcarError
from foldcar.outputs import is_database
from foldcar.shown_text import shown_line
from foldcar.study.brackets import unclosed
from foldcar.study.family import read_family
from foldcar.study.limits import check_numbers
from foldcar.study.listing import (
    ExperimentParams,
    ListedCondition,
    ListedEnvironment,
    ListedExperiment,
    ListedVehicle,
    Listing,
    ListingError,
    Strict,
)
from foldcar.typed import did_you_mean, did_you_mean_file, read_text

# Characters of a listing that a message shows.
MAX_SHOWN = 40
# pydantic's error types for a value that should be a JSON object.
NOT_AN_OBJECT = ("dict_type", "model_type", "model_attributes_type")
# The schema at each path; the path omits the names that a listing gives to its experiments, vehicles and environments.
OBJECTS: dict[tuple[Any, ...], type[Strict]] = {
    (): Listing,
    ("experiments",): ListedExperiment,
    ("experiments", "params"): ExperimentParams,
    ("vehicles",): ListedVehicle,
    ("environments",): ListedEnvironment,
    ("environments", "condition"): ListedCondition,
}


# pydantic's kinds of mistakes in foldcar's words: those with a limit, by the limit's name, and others.
LIMITS = {
    "ge": {"greater_than_equal": "below the minimum"},
    "gt": {"greater_than": "not above"},
    "le": {"less_than_equal": "above the maximum"},
    "lt": {"less_than": "not below"},
}
WORDINGS = {
    **dict.fromkeys(("int_type", "int_from_float", "int_parsing"), "is not a whole number"),
    **dict.fromkeys(("float_type", "float_parsing", "finite_number"), "is not a number"),
    "string_type": "is not a text",
    **dict.fromkeys(("bool_type", "bool_parsing"), "is neither true nor false"),
    "list_type": "is not a list, […]",
    # Every minimum length is 1.
    **dict.fromkeys(("too_short", "string_too_short"), "is empty"),
}


def read_listing(file: Path, programs: bool = False) -> tuple[Listing, str]:
    """Read and check a listing; return it with the file's text.

    ``programs`` also checks that the Scenic programs exist. Raises ListingError with all mistakes of form; if there are
    none, with all other mistakes. Each names its key, value and limit.
    """
    data, text = load_listing(file)
    listing, mistakes = validated_listing(data)
    if mistakes:
        raise ListingError(file, *mistakes)
    mistakes = _reference_mistakes(listing)
    for name, vehicle in listing.vehicles.items():
        try:
            # Raises ListingError if no car of the family can be built.
            next(iter(read_family(file, name, vehicle)))
        except ListingError as error:
            mistakes += error.mistakes
    if programs:
        mistakes += _missing_programs(file, listing)
    if mistakes:
        raise ListingError(file, *mistakes)
    return listing, text


def load_listing(file: Path) -> tuple[Any, str]:
    """Read a listing and return its JSON data and its text.

    Raises ListingError if the file cannot be read, or if it is not JSON.
    """
    if file.suffix == ".scenic" and file.is_file():
        raise ListingError(file, "is a Scenic program; name a listing that has it as a scenic_filename (docs/listing.md)")
    if is_database(file):
        raise ListingError(file, "is a store, which `foldcar report` reads; a listing is a JSON file")
    try:
        text = read_text(file)
    except FoldcarError as error:
        raise ListingError(file, str(error).removeprefix(f"{file}: ")) from error
    try:
        data = json5.loads(text, allow_duplicate_keys=False)
    except ValueError as error:
        mistake = unclosed(text) or _json_mistake(text, str(error))
        raise ListingError(file, f"is not JSON: {mistake}") from error
    except RecursionError as error:
        raise ListingError(file, "is nested too deeply") from error
    try:
        check_numbers(data)
    except ValueError as error:
        raise ListingError(file, str(error)) from None
    _check_characters(file, data)
    return data, text


def _check_characters(file: Path, data: Any) -> None:
    """Raise ListingError if a text in the data has half a character, which cannot be encoded as UTF-8.

    JSON writes some characters as two escapes, such as \\ud83d and \\ude00. A half is one of these without the other.
    """
    try:
        json.dumps(data, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        # The escape as it stands in the file, without quotation marks.
        escape = ascii(error.object[error.start]).strip("'")
        raise ListingError(file, f"{escape}: is half a character; write the whole character instead") from None


def _json_mistake(text: str, message: str) -> str:
    """Return the mistake that the parser's ``message`` describes, with its line and column in ``text``.

    The parser calls a character unexpected if a comma is missing before it. This says that a comma is missing.
    """
    match = re.fullmatch(r"<string>:(?P<line>\d+) (?P<problem>Unexpected .+) at column (?P<column>\d+)", message)
    if match is None:
        return message.removeprefix("<string>:")
    # Both count from 1.
    line, column = int(match["line"]), int(match["column"])
    place = f"line {line}, column {column}"
    lines = text.split("\n")
    text_before_in_line = lines[line - 1][: column - 1]
    text_after_in_line = lines[line - 1][column - 1 :]
    text_before = "\n".join([*lines[: line - 1], text_before_in_line]).rstrip()
    if text_before.endswith(('"', "}", "]")) or text_before[-1:].isalnum():
        # A value ends here. It must be followed by a comma or by a closing bracket.
        return f"{place}: a comma is missing before {text_after_in_line[:MAX_SHOWN]}"
    return f"{place}: {match['problem'].lower()}"


def validated_listing(data: Any) -> tuple[Listing, list[str]]:
    """Return the listing and all mistakes in its form; with a mistake, the listing is empty."""
    try:
        return Listing.model_validate(data), []
    except ValidationError as error:
        return Listing.model_construct(), [listing_mistake(mistake) for mistake in error.errors()]


def listing_mistake(mistake: Any) -> str:
    """Return a line about one of pydantic's mistakes. It names the key, the value and the limit."""
    location = mistake["loc"]
    path = shown_line(".".join(map(str, location))) or "the file"
    kind = mistake["type"]
    if kind == "extra_forbidden":
        return f"{path}: {_unknown_key(location)}"
    if kind == "missing":
        return f"{path}: is missing"
    message = mistake["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        # A check of foldcar itself. Its message says all.
        return f"{path}: {message}"
    value = repr(mistake["input"])
    if len(value) > MAX_SHOWN:
        value = f"{value[: MAX_SHOWN - 3]}..."
    return f"{path}: {value}{_wrong_value(mistake, message)}"


def _unknown_key(location: Sequence[Any]) -> str:
    """Return what is wrong with a key that no listing has: ``unknown key``, the valid keys there, and a suggestion.

    ``location`` is the path to the key, such as (experiments, 1, params, speed).
    """
    # Every second part of the path is a name or an index that the listing's author has chosen. OBJECTS leaves these out.
    sections = tuple(location[:-1:2])
    # `wbt_filename` is accepted, but unused, so it is not suggested.
    valid_keys = [key for key in OBJECTS[sections].model_fields if key != "wbt_filename"]
    return f"unknown key; known: {', '.join(valid_keys)}{did_you_mean(location[-1], valid_keys)}"


def _wrong_value(mistake: Mapping[str, Any], message: str) -> str:
    """Return what is wrong with a value, such as `` is below the minimum 1``, to be written after the value.

    ``message`` is pydantic's message, which is used if foldcar has no wording of its own for this kind of mistake.
    """
    kind, limits = mistake["type"], mistake.get("ctx", {})
    if kind in NOT_AN_OBJECT:
        return " is not a JSON object, {…}"
    for limit_name, wording_by_kind in LIMITS.items():
        if limit_name in limits and kind in wording_by_kind:
            return f" is {wording_by_kind[kind]} {limits[limit_name]}"
    if kind in WORDINGS:
        return f" {WORDINGS[kind]}"
    return f": {message[0].lower()}{message[1:]}"


def _reference_mistakes(listing: Listing) -> list[str]:
    """Return a line for each experiment that names a missing vehicle or environment."""
    section_by_key: dict[str, Mapping[str, Any]] = {"veh_id": listing.vehicles, "env_id": listing.environments}
    mistakes = []
    for name, experiment in listing.experiments.items():
        for key, section in section_by_key.items():
            reference = getattr(experiment, key)
            if reference not in section:
                known = ", ".join(section) or "none"
                suggestion = did_you_mean(reference, section)
                mistakes.append(f'experiments.{name}.{key}: no "{reference}"; known: {known}{suggestion}')
    return mistakes


def _missing_programs(file: Path, listing: Listing) -> list[str]:
    """Return a line for each environment whose Scenic program is missing."""
    missing = []
    for name, environment in listing.environments.items():
        program = file.parent / environment.scenic_filename
        if not program.is_file():
            suggestion = did_you_mean_file(program)
            missing.append(f"environments.{name}.scenic_filename: {program} is not a file{suggestion}")
    return missing
