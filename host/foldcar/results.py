"""What a run gave: the row that stores keep, exports write and reports read."""

from dataclasses import dataclass

# Every outcome carsim reports, best first: the order of tables, legends and stacked bars.
OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "fault")


@dataclass(frozen=True, slots=True)
class Result:
    """One run of one design in one sampled environment.

    ``design`` maps the design's parameters to their values, units in the names (``width_mm``). The
    distance is from the car's middle to the target, in the ground plane; the energy is electrical.
    """

    experiment: str
    vehicle: str
    environment: str
    sample: int
    outcome: str
    elapsed_time_s: float
    distance_to_target_m: float
    consumed_energy_j: float
    max_roll_rad: float
    max_pitch_rad: float
    design: dict[str, float | str]
