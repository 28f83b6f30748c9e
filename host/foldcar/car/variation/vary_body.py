"""The simulator's body of one built car.

Input: a body as in docs/carsim.md and a draw of spread.py. Output: the body with the drawn differences. The firmware
keeps the parameters of the design: it has no knowledge of the differences.
"""

from collections.abc import Mapping
from typing import Any

from foldcar.car.variation.spread import phase_name


def vary_body(body: Mapping[str, Any], variation: Mapping[str, Any]) -> dict[str, Any]:
    """The body with the differences; values outside the limits of docs/carsim.md are clamped to them."""
    return {
        **body,
        "segments": [_segment(segment, variation) for segment in body["segments"]],
        "wheels": [_wheel(wheel, variation) for wheel in body["wheels"]],
        "supply_v": _within(0.1, body["supply_v"] + variation.get("supply_v", 0.0), 60),
    }


def _segment(segment: Mapping[str, Any], variation: Mapping[str, Any]) -> dict[str, Any]:
    mass, grip = _factor(variation.get("mass", 0.0)), _factor(variation.get("belly_grip", 0.0))
    varied = {**segment, "grip": _within(0, segment["grip"] * grip, 5)}
    varied["mass_kg"] = _within(0.0005, segment["mass_kg"] * mass, 50)
    for axis in ("roll", "pitch", "yaw"):
        key = f"{axis}_inertia_kg_m2"
        varied[key] = _within(1e-7, segment[key] * mass, 50)
    for key in ("com_x_m", "com_y_m", "com_z_m"):
        varied[key] = _within(-1, segment[key] + variation.get(key, 0.0), 1)
    return varied


def _wheel(wheel: Mapping[str, Any], variation: Mapping[str, Any]) -> dict[str, Any]:
    channel = wheel["channel"]

    def of_wheel(name: str) -> float:
        value: float = variation[name][channel] if name in variation else 0.0
        return value

    servo = dict(wheel["servo"])
    servo["no_load_speed_rad_s"] = _within(
        0.1, servo["no_load_speed_rad_s"] * _factor(of_wheel("servo_speed")), 200
    )
    servo["stall_torque_n_m"] = _within(
        1e-4, servo["stall_torque_n_m"] * _factor(of_wheel("servo_torque")), 50
    )
    servo["neutral_us"] = _within(500, servo["neutral_us"] + of_wheel("neutral_us"), 2500)
    servo["deadband_us"] = _within(0, servo["deadband_us"] + of_wheel("deadband_us"), 500)
    servo["saturation_us"] = max(servo["saturation_us"], servo["deadband_us"] + 1)
    varied = {**wheel, "servo": servo}
    varied["radius_m"] = _within(0.005, wheel["radius_m"] * _factor(of_wheel("wheel_radius")), 0.5)
    varied["grip"] = _within(0, wheel["grip"] * _factor(of_wheel("tyre_grip")), 5)
    if of_wheel("eccentricity_m") > 0:
        varied["eccentricity_m"] = _within(0, of_wheel("eccentricity_m"), 0.4 * varied["radius_m"])
        varied["eccentricity_phase_rad"] = _within(0, of_wheel(phase_name("eccentricity_m")), 7)
    return varied


def _factor(relative: float) -> float:
    """1 + ``relative``, at least 0.05, so that no mass or speed becomes zero or negative."""
    return max(0.05, 1 + relative)


def _within(least: float, value: float, largest: float) -> float:
    """The value clamped to the limits and rounded to nine significant digits, as in body_json."""
    return float(f"{min(max(value, least), largest):.9g}") + 0.0
