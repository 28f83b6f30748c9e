"""The result of a run: the row that stores contain, exports write and reports read."""

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.simulation.engines import find_carsim
from foldcar.simulation.runner import CarsimError

# The outcomes that carsim reports, best first; the last: the Scenic program ended the run.
NATIVE_OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "fault", "terminated")

# A run that violated a requirement of the Scenic program. Scenic discards such a simulation: it tells nothing of the
# design, and belongs in no rate.
REJECTED = "rejected"

# Every outcome, in the order of tables, legends and stacked bars: those of carsim, rejected, failed without numbers.
OUTCOMES = (*NATIVE_OUTCOMES, REJECTED, "failed")


@dataclass(frozen=True, slots=True)
class Metric:
    """A number that a run results in, as `carsim metrics` tells of it; ``optional``: some that did not fail have none."""

    name: str
    unit: str
    optional: bool
    help: str


# The metrics of a run's answer, whoever simulated it, and their names. The store has a column for each; a store of a
# simulator without one of them gets that column. They are asked for when first read: who needs no store needs no carsim.
METRICS: tuple[Metric, ...]
NUMBERS: tuple[str, ...]


def __getattr__(name: str) -> Any:
    if name not in ("METRICS", "NUMBERS"):
        raise AttributeError(name)
    program = find_carsim()
    try:
        told = subprocess.run([program, "metrics"], capture_output=True, check=True).stdout
        found = tuple(Metric(**row) for row in json.loads(told))
    except (OSError, subprocess.SubprocessError, ValueError, TypeError) as error:
        raise CarsimError(f"{program}: `carsim metrics` printed no metrics") from error
    globals().update(METRICS=found, NUMBERS=tuple(metric.name for metric in found))
    return globals()[name]


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
