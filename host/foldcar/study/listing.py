"""Reads the experiment listing: the published JSON form, with unknown keys refused.

Input: a JSON file (comments and trailing commas allowed). Output: a Listing. Lengths of vehicles are in millimetres.
A vehicle parameter may be a number, a list, or a range (``{"from": 65, "to": 245, "step": 5}``, both ends included):
more than one value makes a family.
"""

import contextlib
import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import json5
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from foldcar.did_you_mean import did_you_mean
from foldcar.errors import FoldcarError
from foldcar.study.json_numbers import check_numbers
from foldcar.study.limits import GREATEST_SEED, MOST_ENVIRONMENTS

MAX_FAMILY_VALUES = 100_000


class ListingError(FoldcarError):
    """Mistakes in a listing; each starts with the path of its key, or the option that took its place."""

    def __init__(self, file: Path | str, *mistakes: str) -> None:
        self.file, self.mistakes = file, mistakes
        super().__init__(f"{file}: {self._count()}{'; '.join(mistakes)}")

    def lines(self) -> list[str]:
        """The one mistake, or a line for each behind one that counts them."""
        if len(self.mistakes) < 2:
            return super().lines()
        return [f"{self.file}: {self._count()}".rstrip(), *(f"  {' '.join(one.split())}" for one in self.mistakes)]

    def _count(self) -> str:
        return f"{len(self.mistakes)} mistakes: " if len(self.mistakes) > 1 else ""


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


def _spread(raw: Any) -> Any:
    if raw is not None and not isinstance(raw, str | dict):
        raise ValueError(f"{raw!r} is neither the name of a spread nor an object of spreads")
    return raw


def _part_name(raw: Any) -> Any:
    """The name of a part: a film's may be written as the number that it is."""
    return f"{raw:g}" if isinstance(raw, int | float) and not isinstance(raw, bool) else raw


Values = Annotated[tuple[float, ...], BeforeValidator(_values)]
Identifier = Annotated[str, BeforeValidator(lambda raw: str(raw) if type(raw) is int else raw)]


class Strict(BaseModel):
    """A JSON object without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def _thresholds(raw: Any) -> tuple[float, ...]:
    """The thresholds of success, from one number or a list of them."""
    thresholds = tuple(_number(item) for item in (raw if isinstance(raw, list) else [raw]))
    if not thresholds:
        raise ValueError("an empty list has no threshold")
    if not all(0 < threshold < 1 for threshold in thresholds):
        raise ValueError(f"{raw!r} is not between 0 and 1: a threshold is a share of runs, as 0.75")
    if list(thresholds) != sorted(set(thresholds)):
        raise ValueError(f"{raw!r} does not ascend")
    return thresholds


class ExperimentParams(Strict):
    """``timeout`` in s, number of sampled ``environments``, ``speed`` in m/s (None: full), ``yaw_rate`` in rad/s.

    ``threshold``: the shares of passed runs, 0 to 1 and ascending, that tell good designs from bad ones.
    ``variation``: the spread of built cars by name or as overrides (None: cars are as designed);
    ``variation_seed`` None: the environment's.
    """

    timeout: float = Field(120.0, gt=0)
    environments: int = Field(1, ge=1, le=MOST_ENVIRONMENTS)
    threshold: Annotated[tuple[float, ...], BeforeValidator(_thresholds)] = ()
    speed: float | None = Field(None, gt=0, le=5)
    yaw_rate: float = Field(0.0, ge=-20, le=20)
    variation: Annotated[str | dict[str, Any] | None, BeforeValidator(_spread)] = None
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
    """A type string, groups of parameters, ``common`` or of a module letter, and names of parts by kind."""

    type: str
    parts: dict[str, Annotated[str, BeforeValidator(_part_name)]] = {}
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


MODELS: dict[str, type[Strict]] = {
    "experiments": ListedExperiment,
    "vehicles": ListedVehicle,
    "environments": ListedEnvironment,
}
# What pydantic calls a value that should be a JSON object and is not.
NO_OBJECT = ("dict_type", "model_type", "model_attributes_type")
INNER_MODELS: dict[str, type[Strict]] = {"params": ExperimentParams, "condition": ListedCondition}


def read_listing(file: Path) -> tuple[Listing, str]:
    """The listing in ``file`` and the file's text; ListingError of all its mistakes if it is invalid."""
    data, text = load_listing(file)
    listing, mistakes = validated_listing(data)
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
        raise ListingError(file, f"is not UTF-8 text (byte {error.start})") from error
    try:
        data = json5.loads(text, allow_duplicate_keys=False)
    except ValueError as error:
        raise ListingError(file, f"is not JSON: {str(error).removeprefix('<string>:')}") from error
    except RecursionError as error:
        raise ListingError(file, "is not a listing: nested too deeply") from error
    try:
        check_numbers(data)
    except ValueError as error:
        raise ListingError(file, str(error)) from None
    return data, text


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
