"""The shapes of a store's JSON texts, which pydantic checks because other programs may have changed a store.

Input: a table's column and a text. Output: whether the text has the shape that foldcar writes.
"""

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any

from pydantic import AfterValidator, Field, NonNegativeInt, TypeAdapter, ValidationError, with_config
from typing_extensions import NotRequired, TypedDict

from foldcar.shown_text import one_line
from foldcar.store.tables import DESIGN, EXPERIMENT, LIMITS, REALITY_RUN, RECORDED, SAMPLE, TRIAL, Table

# A text that is printed in sentences, whose lines it must not break.
Line = Annotated[str, AfterValidator(one_line)]
Number = Annotated[float, Field(ge=LIMITS["REAL"][0], le=LIMITS["REAL"][1])]
Numbers = dict[str, Number]
# The parameters of a design: numbers, and names of parts such as motors.
Parameters = dict[str, Number | str]


@with_config(extra="forbid")
class StoppingRuleFacts(TypedDict):
    """The fields of a StoppingRule."""

    half_width: Number | None
    thresholds: list[Number]
    confidence: Number


@with_config(extra="forbid")
class RealityFacts(TypedDict):
    """The reality that an experiment was simulated in."""

    name: Line
    fingerprint: str
    experiment: Line


@with_config(extra="forbid")
class ExperimentFacts(TypedDict):
    """The fields of an ExperimentInfo that have no column, and facts that only sweeps use."""

    vehicle_type: Line
    varied: dict[str, list[Number | str]]
    fixed: Parameters
    timeout_s: Number
    speed_m_s: Number | None
    yaw_rate_rad_s: Number
    scenic_program: Line
    scenic_params: dict[str, Any]
    seed: int
    condition: dict[str, Any] | None
    variation: Numbers
    variation_seed: int
    success_rule: Line
    success_defined: bool
    skipped: NotRequired[list[str]]
    reality: NotRequired[RealityFacts | None]
    listed_environment: NotRequired[str | None]
    thresholds: NotRequired[list[Number]]
    until: NotRequired[StoppingRuleFacts | None]
    searched: NotRequired[bool]
    objectives: NotRequired[list[str]]
    engine: NotRequired[str]
    unlike_sides: NotRequired[Line]
    terrain_objects: NotRequired[list[tuple[str, NonNegativeInt]]]
    realities: NotRequired[NonNegativeInt]
    no_realities: NotRequired[Line]
    reality_spread: NotRequired[str]
    ended_runs: NotRequired[NonNegativeInt | None]
    files: NotRequired[dict[str, str]]


SHAPES: Mapping[tuple[str, str], Any] = {
    (EXPERIMENT.name, "facts"): ExperimentFacts,
    (DESIGN.name, "parameters"): Parameters,
    (RECORDED.name, "value"): Any,
    (REALITY_RUN.name, "scores"): list[Number],
    (SAMPLE.name, "objects"): list[tuple[str, Numbers]],
    (TRIAL.name, "design"): Parameters,
    (TRIAL.name, "deviations"): dict[str, tuple[Number, Number, Number]],
    ("variation", "json"): dict[str, Number | list[Number]],
}


@cache
def _adapter(table: str, column: str) -> "TypeAdapter[Any]":
    """Return the pydantic validator of a column."""
    return TypeAdapter(SHAPES[table, column])


def has_shape(table: Table, column: str, text: str) -> bool:
    """Return whether the text is JSON of the column's shape."""
    try:
        _adapter(table.name, column).validate_json(text, strict=True)
    except ValidationError:
        return False
    return True
