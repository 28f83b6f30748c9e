"""Reads the experiment listing: the published JSON form, with unknown keys refused.

Input: a JSON file (comments and trailing commas allowed). Output: a Listing. Lengths of vehicles are in millimetres.
A vehicle parameter may be a number, a list, or a range (``{"from": 65, "to": 245, "step": 5}``, both ends included):
more than one value makes a family.
"""

import math
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import json5
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from foldcar.errors import FoldcarError
from foldcar.study.json_numbers import check_numbers
from foldcar.study.limits import GREATEST_SEED, MOST_ENVIRONMENTS

MAX_FAMILY_VALUES = 100_000


class ListingError(FoldcarError):
    """An error in a listing; the message starts with the file and the path of the key."""


def _values(raw: Any) -> tuple[float, ...]:
    """The values of a vehicle parameter."""
    if isinstance(raw, dict):
        return _range_values(raw)
    items = raw if isinstance(raw, list) else [raw]
    if not items:
        raise ValueError("an empty list has no value")
    values = tuple(_number(item) for item in items)
    if len(set(values)) < len(values):
        raise ValueError("a value stands twice in the list")
    return values


def _range_values(raw: dict[str, Any]) -> tuple[float, ...]:
    if set(raw) != {"from", "to", "step"}:
        raise ValueError('a range has exactly the keys "from", "to", "step"')
    first, last, step = (_number(raw[key]) for key in ("from", "to", "step"))
    if step <= 0:
        raise ValueError(f"step {step:g} must be above 0")
    if last < first:
        raise ValueError(f'"to" {last:g} is below "from" {first:g}')
    # Fractions of the decimal numbers as typed: 0.1 is a tenth, and three steps of it are 0.3.
    start, width = Fraction(repr(first)), Fraction(repr(step))
    steps, rest = divmod(Fraction(repr(last)) - start, width)
    if steps >= MAX_FAMILY_VALUES:
        count = steps + 1 if steps < 10**12 else "more than 10^12"
        raise ValueError(f"the range has {count} values, the limit is {MAX_FAMILY_VALUES}")
    if rest:
        below, above = (f'"to" {_decimal(start + count * width)}' for count in (steps, steps + 1))
        raise ValueError(
            f'"to" {last:.12g} is not reached from {first:.12g} in steps of {step:.12g}: write {below} or {above}'
        )
    return tuple(float(start + index * width) for index in range(steps + 1))


def _decimal(number: Fraction) -> str:
    return f"{float(number):.12g}"


def _number(raw: Any) -> float:
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not math.isfinite(raw):
        raise ValueError(f"{raw!r} is not a number; write a number, a list of numbers or a range")
    return float(raw)


Values = Annotated[tuple[float, ...], BeforeValidator(_values)]
Identifier = Annotated[str, BeforeValidator(lambda raw: str(raw) if type(raw) is int else raw)]


class Strict(BaseModel):
    """A JSON object without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    raise ValueError(f'unknown key "{key}"; known: {", ".join(cls.model_fields)}')
        return data


class ExperimentParams(Strict):
    """``timeout`` in s, number of sampled ``environments``, ``speed`` in m/s (None: full), ``yaw_rate`` in rad/s.

    ``variation``: the spread of built cars by name or as overrides (None: cars are as designed);
    ``variation_seed`` None: the environment's.
    """

    timeout: float = Field(120.0, gt=0)
    environments: int = Field(1, ge=1, le=MOST_ENVIRONMENTS)
    speed: float | None = Field(None, gt=0, le=5)
    yaw_rate: float = Field(0.0, ge=-20, le=20)
    variation: str | dict[str, Any] | None = None
    variation_seed: int | None = Field(None, ge=0, le=GREATEST_SEED)

    @model_validator(mode="after")
    def _seed_has_a_use(self) -> "ExperimentParams":
        if self.variation_seed is not None and self.variation is None:
            raise ValueError('"variation_seed" says nothing without "variation"')
        return self


class ListedExperiment(Strict):
    """A vehicle (or family) in an environment."""

    veh_id: Identifier
    env_id: Identifier
    params: ExperimentParams = ExperimentParams()  # type: ignore[call-arg]


class ListedVehicle(Strict):
    """A type string and groups of parameters, ``common`` or of a module letter."""

    type: str
    params: list[dict[str, dict[str, Values]]] = []


class ListedCondition(Strict):
    """A condition on an environment: names of objects and parameters that keep their values of ``sample``.

    If both are None, everything keeps its value; if one is None, only what the other names.
    """

    sample: int = Field(ge=0, lt=MOST_ENVIRONMENTS)
    objects: list[str] | None = None
    params: list[str] | None = None


class ListedEnvironment(Strict):
    """A Scenic program (path relative to the listing) with its seed and parameters, lengths in m."""

    scenic_filename: str
    wbt_filename: str | None = None
    seed: int = Field(0, ge=0, le=GREATEST_SEED)
    scenic_params: dict[str, Any] = {}
    condition: ListedCondition | None = None


class Listing(Strict):
    """A whole file. Without experiments it contains designs only, to be built or viewed."""

    experiments: dict[str, ListedExperiment] = Field({}, min_length=1)
    vehicles: dict[str, ListedVehicle] = Field(min_length=1)
    environments: dict[str, ListedEnvironment] = {}


def read_listing(file: Path) -> tuple[Listing, str]:
    """The listing in ``file`` and the file's text; ListingError of one line if it is invalid."""
    try:
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise ListingError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ListingError(f"{file}: is not UTF-8 text (byte {error.start})") from error
    try:
        data = json5.loads(text, allow_duplicate_keys=False)
    except ValueError as error:
        raise ListingError(f"{file}: is not JSON: {str(error).removeprefix('<string>:')}") from error
    except RecursionError as error:
        raise ListingError(f"{file}: is not a listing: nested too deeply") from error
    try:
        check_numbers(data)
    except ValueError as error:
        raise ListingError(f"{file}: {error}") from None
    try:
        listing = Listing.model_validate(data)
    except ValidationError as error:
        raise ListingError(f"{file}: {_first_mistake(error)}") from error
    _check_references(file, listing)
    return listing, text


def _first_mistake(error: ValidationError) -> str:
    mistake = error.errors()[0]
    path = ".".join(str(step) for step in mistake["loc"]) or "the file"
    kind, value = mistake["type"], mistake["input"]
    if kind == "missing":
        return f"{path}: is missing"
    message = mistake["msg"].removeprefix("Value error, ")
    if kind == "value_error":
        return f"{path}: {message}"
    shown = repr(value)
    shown = shown if len(shown) <= 40 else f"{shown[:37]}..."
    return f"{path}: {shown}: {message[0].lower()}{message[1:]}"


def _check_references(file: Path, listing: Listing) -> None:
    for name, experiment in listing.experiments.items():
        for key, reference, known in (
            ("veh_id", experiment.veh_id, listing.vehicles),
            ("env_id", experiment.env_id, listing.environments),
        ):
            if reference not in known:
                raise ListingError(
                    f'{file}: experiments.{name}.{key}: "{reference}" is not among '
                    f"{'vehicles' if key == 'veh_id' else 'environments'}: {', '.join(known) or 'none'}"
                )
