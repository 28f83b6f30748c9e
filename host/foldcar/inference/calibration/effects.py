"""What values of the parameters do to a run: a changed scene, and a variation of the car (car/variation.py).

Input: a scene of docs/carsim.md, values by name, a seed and the number of the run's sample. What scatters depends on
seed and number alone, so that runs with other values share it.

Some parameters no calibration knows: only a reality may have them (REAL_ONLY).
"""

import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.car.variation import draw, workshop

# How far each kind of terrain stands out of the plane.
HEIGHT_KEYS = ("height_m", "depth_m", "height_sd_m")


@dataclass(frozen=True, slots=True)
class RealParameter:
    """A parameter of realities from ``least`` to ``largest``; ``nominal`` is what the simulator has without it."""

    unit: str
    nominal: float
    least: float
    largest: float
    mujoco_only: bool = False


# By their names in a variation of the car.
REAL_ONLY = {
    "wheel_camber_rad": RealParameter("rad", 0.0, -0.3, 0.3, mujoco_only=True),
    "tyre_contact_time_s": RealParameter("s", 0.005, 0.004, 0.05, mujoco_only=True),
    "com_x_m": RealParameter("m", 0.0, -0.05, 0.05),
    "com_y_m": RealParameter("m", 0.0, -0.05, 0.05),
    "supply_resistance_ohm": RealParameter("Ω", 0.0, 0.0, 5.0),
}


def calibrated_scene(scene: Mapping[str, Any], values: Mapping[str, float], seed: int, number: int) -> dict[str, Any]:
    """The scene with scaled friction and heights and a scattered start."""
    stream = random.Random(f"{seed}/{number}/start")
    start = dict(scene["start"])
    position_sd, heading_sd = values["start_position_sd_m"], values["start_heading_sd_rad"]
    for key, sd in (("x_m", position_sd), ("y_m", position_sd), ("heading_rad", heading_sd)):
        start[key] = _rounded(start[key] + sd * stream.gauss(0, 1))
    return {
        **scene,
        "friction": _rounded(scene["friction"] * values["friction"]),
        "terrain": [_piece(piece, values) for piece in scene["terrain"]],
        "start": start,
    }


def calibrated_variation(
    values: Mapping[str, float], listed: Mapping[str, float], seed: int, number: int | str
) -> dict[str, Any]:
    """The variation, as :func:`draw` makes it, of a car with these values.

    ``listed`` are the listing's own spreads by name, empty without any: those of wheels give way to ``wheel_spread``,
    those of the whole car stay.
    """
    spread = dict(listed) | {
        name: values["wheel_spread"] * known.sd for name, known in workshop().items() if known.per == "wheel"
    }
    variation = draw(spread, seed, number)
    for name, factor in (("servo_torque", values["servo_torque"]), ("servo_speed", values["servo_speed"])):
        # A difference is relative: 0 is the design's.
        variation[name] = [_rounded(factor * (1 + deviation) - 1) for deviation in variation[name]]
    variation["com_z_m"] = _rounded(variation.get("com_z_m", 0.0) + values["com_height_m"])
    variation["track_m"] = values["track_m"]
    for name in REAL_ONLY.keys() & values.keys():
        # A spread of the listing's has its draw already.
        variation[name] = _rounded(variation.get(name, 0.0) + values[name])
    return variation


def _piece(piece: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    changed = dict(piece)
    for key in HEIGHT_KEYS:
        if key in piece:
            changed[key] = _rounded(piece[key] * values["obstacle_height"])
    if piece["kind"] == "half_round":
        # Higher than half its chord, it would be no arc.
        changed["height_m"] = min(changed["height_m"], piece["length_m"] / 2)
    if piece["kind"] == "patch":
        changed["friction"] = _rounded(piece["friction"] * values["friction"])
    return changed


def _rounded(value: float) -> float:
    return float(f"{value:.9g}") + 0.0
