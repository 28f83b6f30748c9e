"""What `carsim limits` prints: the limits of the simulator's input, and the rules by which its trials run."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrialRules:
    """A trial's times (s), and when it ends.

    The car settles for ``settling_s`` before the trial begins, the physics takes steps of ``step_s``, the firmware
    ticks every ``firmware_tick_s``. A car has tipped when the upward part of its up axis is below ``tipped_up``, and is
    stuck when within ``stuck_time_s`` it has neither moved ``stuck_distance_m`` nor turned ``stuck_turn_rad``.
    """

    settling_s: float
    step_s: float
    firmware_tick_s: float
    tipped_up: float
    stuck_distance_m: float
    stuck_turn_rad: float
    stuck_time_s: float


@dataclass(frozen=True, slots=True)
class CarsimLimits:
    """``numbers`` are the least and the largest value by path, as in ``body.wheels.servo.neutral_us``."""

    numbers: Mapping[str, tuple[float, float]]
    trial: TrialRules
