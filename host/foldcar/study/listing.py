"""The schema of experiment listings (JSON); unknown keys are errors.

Lengths of vehicles are in millimetres. A vehicle parameter may be a number, a list, or a range (``{"from": 65, "to": 245,
"step": 5}``, both ends included). With more than one value, the vehicle is a family.
"""

import math
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from foldcar.errors import FoldcarError
from foldcar.shown_text import one_line
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_SEED, checked_threshold

MAX_FAMILY_VALUES = 100_000


class ListingError(FoldcarError):
    """Mistakes in a listing; each begins with the path of its key, or with the option that replaced it."""

    def __init__(self, file: Path | str, *mistakes: str) -> None:
        self.file, self.mistakes = file, mistakes
        all_mistakes = "; ".join(mistakes)
        message = f"{len(mistakes)} mistakes: {all_mistakes}" if len(mistakes) > 1 else all_mistakes
        super().__init__(f"{file}: {message}")

    def lines(self) -> list[str]:
        """Return the lines of the message.

        A single mistake is one line. Several mistakes are a line with their number, and a line for each mistake.
        """
        if len(self.mistakes) < 2:
            return super().lines()
        lines = [f"{self.file}: {len(self.mistakes)} mistakes:"]
        for mistake in self.mistakes:
            mistake_on_one_line = " ".join(mistake.split())
            lines.append(f"  {mistake_on_one_line}")
        return lines


def _values(raw: Any) -> tuple[float, ...]:
    """Return the values of a vehicle parameter from a number, a list or a range. Raises ValueError."""
    if isinstance(raw, dict):
        return _range_values(raw)
    items = raw if isinstance(raw, list) else [raw]
    if not items:
        raise ValueError("an empty list has no value")
    # family.py checks which parameters are booleans, because it knows the vehicle's modules.
    values = tuple(item if isinstance(item, bool) else _number(item) for item in items)
    if len(set(values)) < len(values):
        repeated = next(value for value in values if values.count(value) > 1)
        raise ValueError(f"{repeated:g} occurs twice in the list")
    return values


def _range_values(raw: dict[str, Any]) -> tuple[float, ...]:
    """Return the values of a range. Raises ValueError if its keys or its step are invalid."""
    if set(raw) != {"from", "to", "step"}:
        raise ValueError('a range has exactly the keys "from", "to", "step"')
    first, last, step = (_number(raw[key]) for key in ("from", "to", "step"))
    if step <= 0:
        raise ValueError(f"step {step:g} must be above 0")
    if last < first:
        raise ValueError(f'"to" {last:g} is below "from" {first:g}')
    # Exact fractions of the typed decimals, so that three steps of 0.1 are 0.3.
    start, step_width = Fraction(repr(first)), Fraction(repr(step))
    steps, remainder = divmod(Fraction(repr(last)) - start, step_width)
    if steps >= MAX_FAMILY_VALUES:
        raise ValueError(f"the range has {steps + 1} values, the limit is {MAX_FAMILY_VALUES}")
    if remainder:
        last_value = float(start + steps * step_width)
        raise ValueError(f'"to" {last:.12g} is not reached in steps of {step:.12g}; the last value is {last_value:.12g}')
    return tuple(float(start + index * step_width) for index in range(steps + 1))


def _number(raw: Any) -> float:
    """Return a finite number as float. Raises ValueError for anything else."""
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not math.isfinite(raw):
        raise ValueError(f"{raw!r} is not a number; write a number, a list of numbers or a range")
    return float(raw)


def _spread(raw: Any) -> Any:
    """Return a spread as it is written. Raises ValueError if it is neither a name nor an object."""
    if raw is not None and not isinstance(raw, str | dict):
        raise ValueError(f"{raw!r} is neither the name of a spread nor an object of spreads")
    return raw


def _part_name(raw: Any) -> Any:
    """Return a part's name as a string; a film's name is a number and may be written as one."""
    is_number = isinstance(raw, int | float) and not isinstance(raw, bool)
    return f"{raw:g}" if is_number else raw


Name = Annotated[str, AfterValidator(one_line)]
Values = Annotated[tuple[float | bool, ...], BeforeValidator(_values)]
Identifier = Annotated[str, BeforeValidator(lambda raw: str(raw) if type(raw) is int else raw)]


class Strict(BaseModel):
    """A JSON object without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def _thresholds(raw: Any) -> tuple[float, ...]:
    """Return the thresholds of success from a number or an ascending list. Raises ValueError."""
    items = raw if isinstance(raw, list) else [raw]
    thresholds = tuple(checked_threshold(_number(item)) for item in items)
    if not thresholds:
        raise ValueError("an empty list has no threshold")
    if list(thresholds) != sorted(set(thresholds)):
        raise ValueError(f"{raw!r} is not in ascending order")
    return thresholds


class ExperimentParams(Strict):
    """``timeout`` in s, number of sampled ``environments``, ``speed`` in m/s (None: full), ``yaw_rate`` in rad/s.

    ``threshold``: success rates, 0 to 1 and ascending, that good designs reach.
    ``variation``: the spread of built cars, by name or as overrides (None: all cars are as designed).
    ``variation_seed``: None for the environment's seed.
    """

    timeout: float = Field(120.0, gt=0)
    environments: int = Field(1, ge=1, le=MAX_ENVIRONMENTS)
    threshold: Annotated[tuple[float, ...], BeforeValidator(_thresholds)] = ()
    speed: float | None = Field(None, gt=0, le=5)
    yaw_rate: float = Field(0.0, ge=-20, le=20)
    variation: Annotated[str | dict[str, Any] | None, BeforeValidator(_spread)] = None
    variation_seed: int | None = Field(None, ge=0, le=MAX_SEED)

    @model_validator(mode="after")
    def _check_variation_seed(self) -> "ExperimentParams":
        if self.variation_seed is not None and self.variation is None:
            raise ValueError('"variation_seed" has no effect without "variation"')
        return self


class ListedExperiment(Strict):
    """A vehicle (or family) in an environment."""

    veh_id: Identifier
    env_id: Identifier
    params: ExperimentParams = ExperimentParams()  # type: ignore[call-arg]


class ListedVehicle(Strict):
    """A type string, groups of parameters (``common`` or of a module letter), and names of parts by kind."""

    type: str
    parts: dict[str, Annotated[str, BeforeValidator(_part_name)]] = {}
    params: list[dict[str, dict[str, Values]]] = []


class ListedCondition(Strict):
    """A condition on an environment: these objects and parameters keep the values that they have in ``sample``.

    If both lists are None, everything keeps its value. If one is None, only what the other names keeps its value.
    """

    sample: int = Field(ge=0, lt=MAX_ENVIRONMENTS)
    objects: list[str] | None = None
    params: list[str] | None = None


class ListedEnvironment(Strict):
    """A Scenic program (path relative to the listing) with its seed and parameters, lengths in m."""

    scenic_filename: Name
    wbt_filename: str | None = None
    seed: int = Field(0, ge=0, le=MAX_SEED)
    scenic_params: dict[str, Any] = {}
    condition: ListedCondition | None = None


class Listing(Strict):
    """A listing file. Without experiments it contains only designs, to be built or viewed.

    ``title`` and ``notes``, in Markdown, stand on top of the report.
    """

    title: str = Field("", max_length=200)
    notes: str = Field("", max_length=5000)
    experiments: dict[Name, ListedExperiment] = Field({}, min_length=1)
    vehicles: dict[Name, ListedVehicle] = Field(min_length=1)
    environments: dict[Name, ListedEnvironment] = {}
