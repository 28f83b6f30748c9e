"""Reads the file of an experiment listing (JSON; comments and trailing commas allowed).

Names all mistakes by key: of form, of cars, of programs.
"""

import contextlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import json5
from pydantic import ValidationError

from foldcar.outputs import SQLITE_MAGIC
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
from foldcar.typed import did_you_mean

MODELS: dict[str, type[Strict]] = {
    "experiments": ListedExperiment,
    "vehicles": ListedVehicle,
    "environments": ListedEnvironment,
}
# What pydantic calls a value that should be a JSON object and is not.
NO_OBJECT = ("dict_type", "model_type", "model_attributes_type")
INNER_MODELS: dict[str, type[Strict]] = {"params": ExperimentParams, "condition": ListedCondition}


def read_listing(file: Path, programs: bool = False) -> tuple[Listing, str]:
    """The listing in ``file`` and the file's text, its vehicles checked, and its ``programs`` if they are wanted.

    ListingError of all mistakes: it names every key at fault, its value and its limit.
    """
    data, text = load_listing(file)
    listing, mistakes = validated_listing(data)
    for name, vehicle in listing.vehicles.items():
        try:
            # Raises why no car of the family can be built.
            next(iter(read_family(file, name, vehicle)))
        except ListingError as error:
            mistakes += error.mistakes
    if programs:
        mistakes += _missing_programs(file, listing)
    if mistakes:
        raise ListingError(file, *mistakes)
    return listing, text


def load_listing(file: Path) -> tuple[Any, str]:
    """The JSON data in ``file`` and the file's text; ListingError."""
    try:
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise ListingError(file, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        if error.object.startswith(SQLITE_MAGIC):
            raise ListingError(file, "is a store, which `foldcar report` reads; a listing is a JSON file") from None
        raise ListingError(file, f"is not UTF-8 text (byte {error.start})") from error
    try:
        data = json5.loads(text, allow_duplicate_keys=False)
    except ValueError as error:
        raise ListingError(file, f"is not JSON: {_json_mistake(str(error), text)}") from error
    except RecursionError as error:
        raise ListingError(file, "is not a listing: nested too deeply") from error
    try:
        check_numbers(data)
    except ValueError as error:
        raise ListingError(file, str(error)) from None
    return data, text


def _json_mistake(message: str, text: str) -> str:
    """The parser's message with the place first, and what is missing there as a rule."""
    if not text.strip():
        return "the file is empty"
    found = re.fullmatch(r"<string>:(\d+) Unexpected (.+) at column (\d+)", message)
    if found is None:
        return message.removeprefix("<string>:")
    line, what, column = found.groups()
    if what == "end of input":
        return f"line {line}: it ends too early: a }}, a ] or a quote is missing"
    before = text.splitlines()[: int(line)]
    before[-1] = before[-1][: int(column) - 1]
    last = "".join(before).rstrip()[-1:]
    missing = "; is a comma or a colon missing before it?" if last in ('"', "}", "]", "'") or last.isalnum() else ""
    return f"line {line}, column {column}: unexpected {what}{missing}"


def validated_listing(data: Any) -> tuple[Listing, list[str]]:
    """The listing, without the parts that have mistakes of form, and all mistakes of form and reference."""
    mistakes = []
    try:
        listing = Listing.model_validate(data)
    except ValidationError as error:
        mistakes = [_mistake(one) for one in error.errors()]
        listing = _sound_part(data)
    return listing, mistakes + _reference_mistakes(data, listing)


def _sound_part(data: Any) -> Listing:
    """What is valid by itself of a listing that is not."""
    sound: dict[str, dict[str, Any]] = {}
    for section, model in MODELS.items():
        sound[section] = {}
        for name, raw in _section(data, section).items():
            with contextlib.suppress(ValidationError):
                sound[section][name] = model.model_validate(raw)
    return Listing.model_construct(**sound)  # type: ignore[arg-type]


def _section(data: Any, section: str) -> dict[str, Any]:
    found = data.get(section) if isinstance(data, dict) else None
    return found if isinstance(found, dict) else {}


def _mistake(mistake: Any) -> str:
    location, kind, value = mistake["loc"], mistake["type"], mistake["input"]
    if kind == "extra_forbidden":
        *parents, key = location
        known = list(_model_at(parents).model_fields)
        unknown = f'unknown key "{key}"; known: {", ".join(known)}{did_you_mean(str(key), known)}'
        return f"{_path(parents)}: {unknown}"
    path = _path(location)
    if kind == "missing":
        return f"{path}: is missing"
    message = mistake["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        return f"{path}: {message}"
    shown = repr(value)
    shown = shown if len(shown) <= 40 else f"{shown[:37]}..."
    if kind in NO_OBJECT:
        return f"{path}: {shown} is not a JSON object, {{…}}"
    return f"{path}: {shown}: {message[0].lower()}{message[1:]}"


def _path(location: Sequence[Any]) -> str:
    return ".".join(str(step) for step in location) or "the file"


def _model_at(location: Sequence[Any]) -> type[Strict]:
    """The model of the JSON object at that place."""
    if not location:
        return Listing
    return INNER_MODELS[location[2]] if len(location) > 2 else MODELS[location[0]]


def _reference_mistakes(data: Any, listing: Listing) -> list[str]:
    mistakes = []
    for name, experiment in listing.experiments.items():
        for key, reference, section in (
            ("veh_id", experiment.veh_id, "vehicles"),
            ("env_id", experiment.env_id, "environments"),
        ):
            known = _section(data, section)
            if reference not in known:
                mistakes.append(
                    f'experiments.{name}.{key}: "{reference}" is not among {section}: '
                    f"{', '.join(known) or 'none'}{did_you_mean(reference, known)}"
                )
    return mistakes


def _missing_programs(file: Path, listing: Listing) -> list[str]:
    missing = []
    for name, environment in listing.environments.items():
        program = file.parent / environment.scenic_filename
        if not program.is_file():
            others = [str(other.relative_to(file.parent)) for other in sorted(file.parent.glob("*.scenic"))]
            close = did_you_mean(environment.scenic_filename, others)
            missing.append(f"environments.{name}.scenic_filename: {program} is not a file{close}")
    return missing
