"""The experiment listing: the published JSON form, with unknown keys refused.

Lengths of vehicles are in millimetres. A vehicle parameter may be a number, a list, or a range (``{"from": 65, "to": 245,
"step": 5}``, both ends included): more than one value makes a family.
"""

import math
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from foldcar.errors import FoldcarError
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_SEED, checked_threshold

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
        return [
            f"{self.file}: {self._count()}".rstrip(),
            *(f"  {' '.join(mistake.split())}" for mistake in self.mistakes),
        ]

    def _count(self) -> str:
        return f"{len(self.mistakes)} mistakes: " if len(self.mistakes) > 1 else ""


def _values(raw: Any) -> tuple[float, ...]:
    """The values of a vehicle parameter."""
    if isinstance(raw, dict):
        return _range_values(raw)
    items = raw if isinstance(raw, list) else [raw]
    if not items:
        raise ValueError("an empty list has no value")
    # Which parameters are true or false is known where the vehicle's modules are (family.py).
    values = tuple(item if isinstance(item, bool) else _number(item) for item in items)
    if len(set(values)) < len(values):
        twice = next(value for value in values if values.count(value) > 1)
        raise ValueError(f"{twice:g} stands twice in the list")
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
        raise ValueError(f"the range has {steps + 1} values, the limit is {MAX_FAMILY_VALUES}")
    if rest:
        reached = float(start + steps * width)
        raise ValueError(f'"to" {last:.12g} is not reached in steps of {step:.12g}, as {reached:.12g} is')
    return tuple(float(start + index * width) for index in range(steps + 1))


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


Values = Annotated[tuple[float | bool, ...], BeforeValidator(_values)]
Identifier = Annotated[str, BeforeValidator(lambda raw: str(raw) if type(raw) is int else raw)]


class Strict(BaseModel):
    """A JSON object without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def _thresholds(raw: Any) -> tuple[float, ...]:
    """The thresholds of success, from one number or a list of them."""
    thresholds = tuple(checked_threshold(_number(item)) for item in (raw if isinstance(raw, list) else [raw]))
    if not thresholds:
        raise ValueError("an empty list has no threshold")
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
    environments: int = Field(1, ge=1, le=MAX_ENVIRONMENTS)
    threshold: Annotated[tuple[float, ...], BeforeValidator(_thresholds)] = ()
    speed: float | None = Field(None, gt=0, le=5)
    yaw_rate: float = Field(0.0, ge=-20, le=20)
    variation: Annotated[str | dict[str, Any] | None, BeforeValidator(_spread)] = None
    variation_seed: int | None = Field(None, ge=0, le=MAX_SEED)

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

    sample: int = Field(ge=0, lt=MAX_ENVIRONMENTS)
    objects: list[str] | None = None
    params: list[str] | None = None


class ListedEnvironment(Strict):
    """A Scenic program (path relative to the listing) with its seed and parameters, lengths in m."""

    scenic_filename: str
    wbt_filename: str | None = None
    seed: int = Field(0, ge=0, le=MAX_SEED)
    scenic_params: dict[str, Any] = {}
    condition: ListedCondition | None = None


class Listing(Strict):
    """A whole file. Without experiments it contains designs only, to be built or viewed.

    ``title`` and ``notes`` stand on the report.
    """

    title: str = Field("", max_length=200)
    notes: str = Field("", max_length=5000)
    experiments: dict[str, ListedExperiment] = Field({}, min_length=1)
    vehicles: dict[str, ListedVehicle] = Field(min_length=1)
    environments: dict[str, ListedEnvironment] = {}
