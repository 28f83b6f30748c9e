"""The result of a run: the row that stores contain, exports write and reports read."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

# The outcomes that carsim reports, best first.
NATIVE_OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "fault")

# A run that violated a requirement of the Scenic program. Scenic discards such a simulation: it tells nothing of the
# design, and belongs in no rate.
REJECTED = "rejected"

# Every outcome, in the order of tables, legends and stacked bars: terminated by the Scenic program, rejected, failed
# without numbers.
OUTCOMES = (*NATIVE_OUTCOMES, "terminated", REJECTED, "failed")


@dataclass(frozen=True, slots=True)
class Metric:
    """A number that a run results in. ``optional`` ones are None in some runs that did not fail."""

    name: str
    unit: str
    meaning: str
    optional: bool = False


# The metrics of a run's answer (docs/carsim.md), whoever simulated it. The store has a column for each, and stores
# written before a metric was entered here get one; a metric is taken out only with a new version of the store.
METRICS = (
    Metric("elapsed_time_s", "s", "time from the start of the run to its end"),
    Metric("distance_to_target_m", "m", "distance in the ground plane from car to target at the end", optional=True),
    Metric("consumed_energy_j", "J", "electrical energy drawn from the servo supply"),
    Metric("max_roll_rad", "rad", "largest magnitude of roll"),
    Metric("max_pitch_rad", "rad", "largest magnitude of pitch"),
)
NUMBERS = tuple(metric.name for metric in METRICS)


def outcome_of(answer: Mapping[str, Any]) -> str:
    """The outcome of a simulator's answer to a run: an answer with an ``error`` is a failed run."""
    return "failed" if "error" in answer else str(answer["outcome"])


def has_passed(outcome: str) -> bool | None:
    """Whether a run with that outcome passed; None if it was rejected. Failed runs did not pass."""
    return None if outcome == REJECTED else outcome == "passed"


def no_rate_text(runs: int) -> str:
    """Why runs, all of them rejected, make no rate."""
    return f"there is no rate: all {runs:,} runs were rejected: they violated a requirement of the program"


@dataclass(frozen=True, slots=True)
class Recorded:
    """A value that a program recorded: ``kind`` is ``initial``, ``final`` or ``series``.

    ``value`` is JSON; that of a series is a list of [time in s, value].
    """

    kind: str
    value: Any


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one design in one sampled environment.

    ``metrics`` maps every name of METRICS to its number, None where the run has none. ``design`` maps the design's
    parameters to their values, units in the names (``width_mm``). A failed run has ``message`` and no numbers.
    """

    experiment: str
    vehicle: str
    environment: str
    sample: int
    outcome: str
    metrics: Mapping[str, float | None]
    message: str | None
    design: Mapping[str, float | str]
    recorded: Mapping[str, Recorded]
