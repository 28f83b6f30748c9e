"""What every export says of a car's parts: their names, and the wheels' inertias and places."""

import math
from collections.abc import Mapping
from typing import Any


def segment_name(index: int) -> str:
    """The name of a segment of the body, counted from the front."""
    return f"segment{index}"


def wheel_name(wheel: Mapping[str, Any]) -> str:
    """The name of a wheel: the servo output that drives it."""
    return f"wheel{wheel['channel']}"


def wheel_inertia_kg_m2(wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Of a solid disc as wide as the tyre: about its axle and about a diameter."""
    spin = 0.5 * wheel["mass_kg"] * wheel["radius_m"] ** 2
    return spin, 0.5 * spin + wheel["mass_kg"] * wheel["width_m"] ** 2 / 12


def tyre_center_m(wheel: Mapping[str, Any]) -> tuple[float, float, float]:
    """The tyre's centre from the axle, in the car's axes, as the car is put down."""
    phase, off = wheel["eccentricity_phase_rad"], wheel["eccentricity_m"]
    return off * math.cos(phase), 0.0, off * math.sin(phase)


def axle_m(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> tuple[float, float, float]:
    """Where a wheel turns, from the car's origin."""
    side = 1 if wheel["side"] == "left" else -1
    return wheel["x_m"], side * body["track_m"] / 2, 0.0


def servo_limits(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Stall torque (N·m) and no-load speed (rad/s) of a wheel's servo at the car's voltage."""
    servo = wheel["servo"]
    scale = body["supply_v"] / servo["rated_v"]
    return servo["stall_torque_n_m"] * scale, servo["no_load_speed_rad_s"] * scale
