"""Data that all exported models of a car share: names; inertias, places and servo limits of its wheels.

Different cars, environments and samples have different names, of letters, digits and underscores, as PROTO requires.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from typing import Any


def identifier(text: str) -> str:
    """Return a text with only letters, digits and underscores.

    A hash distinguishes it from texts that would become the same.
    """
    plain = re.sub("[^A-Za-z0-9]+", "_", text)
    return plain if plain == text else f"{plain}_{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def car_name(vehicle: str, values: Mapping[str, float | str]) -> str:
    """Return the name of a listing's vehicle with these parameters (mm, degrees) and parts: ``Foldcar1_width95``."""
    return "_".join(
        [f"Foldcar{identifier(vehicle)}", *(f"{key.replace('.', '_')}{_number(value)}" for key, value in values.items())]
    )


def scene_name(environment: str, sample: int) -> str:
    """Return the name of a sampled environment: ``env1_sample3``."""
    return f"env{identifier(environment)}_sample{sample}"


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return f"_{value.replace('.', 'p')}"
    return f"{value:.9g}".replace(".", "p").replace("-", "m").replace("+", "")


def segment_name(index: int) -> str:
    """Return the name of the segment with that index, counted from the front."""
    return f"segment{index}"


def main_segment(body: Mapping[str, Any]) -> int:
    """Return the index of the segment over the origin of the car; if there is none, that of the nearest segment."""
    distances = [max(0.0, abs(s["x_m"]) - s["length_m"] / 2) for s in body["segments"]]
    return distances.index(min(distances))


def wheel_name(wheel: Mapping[str, Any]) -> str:
    """Return the name of a wheel by its channel, which is the output of its servo if it has one."""
    return f"wheel{wheel['channel']}"


def wheel_inertia_kg_m2(wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Return moments of inertia (kg m²) about axle and diameter of a uniform disc as wide as the tyre."""
    spin = 0.5 * wheel["mass_kg"] * wheel["radius_m"] ** 2
    return spin, 0.5 * spin + wheel["mass_kg"] * wheel["width_m"] ** 2 / 12


def tyre_center_m(wheel: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return the tyre's centre (m) relative to the axle in the car's axes, at the wheel's initial angle."""
    phase, eccentricity_m = wheel["eccentricity_phase_rad"], wheel["eccentricity_m"]
    return eccentricity_m * math.cos(phase), 0.0, eccentricity_m * math.sin(phase)


def axle_m(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return the centre (m) of a wheel's axle in the car's frame."""
    side = 1 if wheel["side"] == "left" else -1
    return wheel["x_m"], side * body["track_m"] / 2, 0.0


def servo_limits(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Return stall torque (N m) and no-load speed (rad/s) of a wheel's servo at the car's supply voltage."""
    servo = wheel["servo"]
    scale = body["supply_v"] / servo["rated_v"]
    return servo["stall_torque_n_m"] * scale, servo["no_load_speed_rad_s"] * scale
