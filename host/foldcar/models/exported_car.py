"""What all exported models say of a car: names; inertias, places and servo limits of its wheels.

Cars, environments and samples that differ have different names, of letters, digits and underscores only, as PROTO names.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from typing import Any


def identifier(text: str) -> str:
    """``text`` with other characters replaced; then its hash keeps it apart from another one that reads the same."""
    plain = re.sub("[^A-Za-z0-9]+", "_", text)
    return plain if plain == text else f"{plain}_{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def car_name(vehicle: str, values: Mapping[str, float | str]) -> str:
    """The name of the listing's vehicle with these parameters (mm, degrees) and parts: ``Foldcar1_width95``."""
    return "_".join(
        [f"Foldcar{identifier(vehicle)}", *(f"{key.replace('.', '_')}{_number(value)}" for key, value in values.items())]
    )


def scene_name(environment: str, sample: int) -> str:
    """The name of a sampled environment: ``env1_sample3``."""
    return f"env{identifier(environment)}_sample{sample}"


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return f"_{value.replace('.', 'p')}"
    return f"{value:.9g}".replace(".", "p").replace("-", "m").replace("+", "")


def segment_name(index: int) -> str:
    """The name of the segment with that index, counted from the front."""
    return f"segment{index}"


def main_segment(body: Mapping[str, Any]) -> int:
    """The index of the segment that carries the car's origin: the first over it."""
    distances = [max(0.0, abs(s["x_m"]) - s["length_m"] / 2) for s in body["segments"]]
    return distances.index(min(distances))


def wheel_name(wheel: Mapping[str, Any]) -> str:
    """The name of a wheel, by its channel: its servo's output, if it has one."""
    return f"wheel{wheel['channel']}"


def wheel_inertia_kg_m2(wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Moments of inertia (kg m²) about the axle and about a diameter, of a uniform disc as wide as the tyre."""
    spin = 0.5 * wheel["mass_kg"] * wheel["radius_m"] ** 2
    return spin, 0.5 * spin + wheel["mass_kg"] * wheel["width_m"] ** 2 / 12


def tyre_center_m(wheel: Mapping[str, Any]) -> tuple[float, float, float]:
    """The tyre's centre relative to the axle (m) in the car's axes, at the wheel's initial angle."""
    phase, off = wheel["eccentricity_phase_rad"], wheel["eccentricity_m"]
    return off * math.cos(phase), 0.0, off * math.sin(phase)


def axle_m(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> tuple[float, float, float]:
    """The centre of a wheel's axle (m) in the car's frame."""
    side = 1 if wheel["side"] == "left" else -1
    return wheel["x_m"], side * body["track_m"] / 2, 0.0


def servo_limits(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Stall torque (N m) and no-load speed (rad/s) of a wheel's servo at the car's supply voltage."""
    servo = wheel["servo"]
    scale = body["supply_v"] / servo["rated_v"]
    return servo["stall_torque_n_m"] * scale, servo["no_load_speed_rad_s"] * scale
