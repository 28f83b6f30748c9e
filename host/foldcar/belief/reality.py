"""Draws the reality of a drive (how car and ground differ from design and scene) from the simulator's parameters.

Input: parameters by name, a seed, the numbers of the drive and of the car. Output: the differences that carsim applies.
Random differences depend on seed and number alone, so that runs with other values share them.

No trial infers the parameters of REAL_ONLY: only a reality of a file may have them.
"""

import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.car.body import CHANNELS
from foldcar.car.variation import draw, workshop_spreads

# Parameters that a reality contains unchanged, as factors.
GROUND_FACTORS = ("friction", "obstacle_height")


@dataclass(frozen=True, slots=True)
class RealParameter:
    """A parameter of realities from ``least`` to ``largest``; ``nominal`` is what the simulator has without it."""

    unit: str
    nominal: float
    least: float
    largest: float
    mujoco_only: bool = False


# Parameters of realities only, by their names in a variation of the car.
REAL_ONLY = {
    "wheel_camber_rad": RealParameter("rad", 0.0, -0.3, 0.3, mujoco_only=True),
    "tyre_contact_time_s": RealParameter("s", 0.005, 0.004, 0.05, mujoco_only=True),
    "com_x_m": RealParameter("m", 0.0, -0.05, 0.05),
    "com_y_m": RealParameter("m", 0.0, -0.05, 0.05),
    "supply_resistance_ohm": RealParameter("Ω", 0.0, 0.0, 5.0),
}


def drawn_reality(
    values: Mapping[str, float], listed: Mapping[str, float], seed: int, drive: int, car: int | str
) -> dict[str, Any]:
    """Draw how car and ground differ from design and scene in one drive. Return it as ``reality`` of carsim's run line.

    ``values`` are the simulator's unknown parameters in this reality, by name. ``listed`` are the standard deviations
    between cars that the listing states, by the name of the quantity. If ``values`` has a ``wheel_spread``, it decides
    the standard deviations of the wheels instead. Drives with the same ``seed`` and the same ``car`` have the same car.
    ``drive`` is the number that decides where the car starts.
    """
    spread = dict(listed)
    if "wheel_spread" in values:
        for name, quantity in workshop_spreads().items():
            if quantity.per == "wheel":
                spread[name] = values["wheel_spread"] * quantity.sd
    reality = draw(spread, seed, car)
    for name in ("servo_torque", "servo_speed"):
        # A reality has the relative difference of each servo from the design, such as 0.1 for 10 % more. All servos are
        # multiplied by the factor in ``values``.
        differences = reality.get(name, [0.0] * CHANNELS)
        reality[name] = [values[name] * (1 + difference) - 1 for difference in differences]
    reality["com_z_m"] = reality.get("com_z_m", 0.0) + values["com_height_m"]
    reality["track_m"] = values["track_m"]
    for name in REAL_ONLY.keys() & values.keys():
        # This is added to the difference that the listing's variation may have drawn.
        reality[name] = reality.get(name, 0.0) + values[name]
    for name in GROUND_FACTORS:
        reality[name] = values[name]
    for name, deviate in start_deviates(seed, drive).items():
        sd_name = "start_heading_sd_rad" if name == "start_heading_rad" else "start_position_sd_m"
        reality[name] = values[sd_name] * deviate
    return reality


def start_deviates(seed: int, drive: int) -> dict[str, float]:
    """Return the standard normal deviates of a drive's start, by name in a reality."""
    stream = random.Random(f"{seed}/{drive}/start")
    return {name: stream.gauss(0, 1) for name in ("start_x_m", "start_y_m", "start_heading_rad")}
