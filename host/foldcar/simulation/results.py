"""What a run gave: the row that stores keep, exports write and reports read."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

# What carsim itself reports, best first.
NATIVE_OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "fault")

# Every outcome, in the order of tables, legends and stacked bars: the program ended the run, one of its
# requirements was violated while it ran, or the run crashed and has no numbers.
OUTCOMES = (*NATIVE_OUTCOMES, "terminated", "rejected", "failed")


# The numbers of a run's answer, whoever simulated it; the distance is None without a goal.
NUMBERS = ("elapsed_time_s", "distance_to_target_m", "consumed_energy_j", "max_roll_rad", "max_pitch_rad")


def outcome_of(answer: Mapping[str, Any]) -> str:
    """The outcome of a simulator's answer to a run: an answer with an ``error`` is a failed run."""
    return "failed" if "error" in answer else str(answer["outcome"])


@dataclass(frozen=True, slots=True)
class Recorded:
    """What a program recorded under a name: ``kind`` is ``initial``, ``final`` or ``series``.

    ``value`` is plain JSON; that of a series is a list of [time in s, value].
    """

    kind: str
    value: Any


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one design in one sampled environment.

    ``design`` maps the design's parameters to their values, units in the names (``width_mm``). The
    distance is from the car's middle to the target, in the ground plane, and None where there is none; the
    energy is electrical. A failed run has ``message`` and no numbers.
    """

    experiment: str
    vehicle: str
    environment: str
    sample: int
    outcome: str
    elapsed_time_s: float | None
    distance_to_target_m: float | None
    consumed_energy_j: float | None
    max_roll_rad: float | None
    max_pitch_rad: float | None
    message: str | None
    design: Mapping[str, float | str]
    recorded: Mapping[str, Recorded]
