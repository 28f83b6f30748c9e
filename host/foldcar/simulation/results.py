"""The result of a run: the row that stores contain, exports write and reports read."""

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.simulation.engines import find_carsim, program_command
from foldcar.simulation.runner import CarsimError

# The outcomes that carsim reports, best first; "terminated": the Scenic program ended the run.
NATIVE_OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "fault", "terminated")

PASSED = "passed"
# A run that violated a requirement of the Scenic program. Scenic discards such simulations: they say nothing about the
# design and count in no rate.
REJECTED = "rejected"
FAILED = "failed"

# All outcomes, in the order of tables, legends and stacked bars.
OUTCOMES = (*NATIVE_OUTCOMES, REJECTED, FAILED)


@dataclass(frozen=True, slots=True)
class Metric:
    """A number of a run's result, as `carsim metrics` describes it; some successful runs lack an ``optional`` one."""

    name: str
    unit: str
    optional: bool
    help: str


# The metrics of a run's answer and their names; the store has a column for each. They are read from carsim at first use,
# so that code without a store does not need carsim.
METRICS: tuple[Metric, ...]
NUMBERS: tuple[str, ...]


def __getattr__(name: str) -> Any:
    """Return METRICS or NUMBERS; Python calls this if the module does not have the attribute ``name`` yet.

    At the first use of either, carsim is asked for its metrics and both are defined, so later uses no longer come here.
    Raises CarsimError if carsim does not print its metrics.
    """
    if name not in ("METRICS", "NUMBERS"):
        raise AttributeError(name)
    metrics = _read_metrics()
    module_attributes = globals()
    module_attributes["METRICS"] = metrics
    module_attributes["NUMBERS"] = tuple(metric.name for metric in metrics)
    return module_attributes[name]


def _read_metrics() -> tuple[Metric, ...]:
    """Return the metrics that carsim computes of each run. Raises CarsimError."""
    program = find_carsim()
    try:
        output = subprocess.run([*program_command(program), "metrics"], capture_output=True, check=True).stdout
        return tuple(Metric(**row) for row in json.loads(output))
    except (OSError, subprocess.SubprocessError, ValueError, TypeError) as error:
        raise CarsimError(f"{program}: `carsim metrics` printed no metrics") from error


def outcome_of(answer: Mapping[str, Any]) -> str:
    """Return the outcome of a simulator's answer to a run; an answer with an ``error`` is a failed run."""
    return FAILED if "error" in answer else str(answer["outcome"])


def has_passed(outcome: str) -> bool | None:
    """Return whether a run with that outcome passed; None if it was rejected, which counts in no rate."""
    if outcome == REJECTED:
        return None
    return outcome == PASSED


def no_rate_text(runs: int) -> str:
    """Return a sentence on why ``runs`` runs, which were all rejected, give no rate."""
    start = "the only run was rejected: it" if runs == 1 else f"all {runs:,} runs were rejected: they"
    return f"there is no rate: {start} violated a requirement of the program"


@dataclass(frozen=True, slots=True)
class Recorded:
    """A value that a program recorded: ``kind`` is ``initial``, ``final`` or ``series``.

    ``value`` is JSON; the value of a series is a list of [time in s, value].
    """

    kind: str
    value: Any


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one design in one sampled environment.

    ``metrics`` maps every name of METRICS to its number, or to None. ``design`` maps the design's parameters to their
    values, with units in the names (``width_mm``). A failed run has a ``message`` and no numbers.
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
