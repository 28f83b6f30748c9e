"""The simulator's body of one built car.

Input: a body as in docs/carsim.md, a draw of spread.py and the simulator's limits. Output: the body with the drawn
differences. The firmware keeps the parameters of the design: it has no knowledge of the differences.
"""

from collections.abc import Mapping
from typing import Any

from foldcar.car.variation.spread import phase_name

# The least and the largest value of a body's numbers by their path, as `carsim limits` prints them.
NumberLimits = Mapping[str, tuple[float, float]]
# An axle does not come closer to its tyre than this share of the radius.
LARGEST_ECCENTRICITY = 0.4


def vary_body(body: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    """The body with the differences; values outside the limits are clamped to them."""
    return {
        **body,
        "segments": [_segment(segment, variation, limits) for segment in body["segments"]],
        "wheels": [_wheel(wheel, variation, limits) for wheel in body["wheels"]],
        "track_m": _within(limits["body.track_m"], body["track_m"] + variation.get("track_m", 0.0)),
        "supply_v": _within(limits["body.supply_v"], body["supply_v"] + variation.get("supply_v", 0.0)),
    }


def _segment(segment: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    mass = _factor(variation.get("mass", 0.0))
    values = {
        "grip": segment["grip"] * _factor(variation.get("belly_grip", 0.0)),
        "mass_kg": segment["mass_kg"] * mass,
        **{key: segment[key] * mass for key in ("roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2")},
        **{key: segment[key] + variation.get(key, 0.0) for key in ("com_x_m", "com_y_m", "com_z_m")},
    }
    return {**segment, **{key: _within(limits[f"body.segments.{key}"], value) for key, value in values.items()}}


def _wheel(wheel: Mapping[str, Any], variation: Mapping[str, Any], limits: NumberLimits) -> dict[str, Any]:
    channel = wheel["channel"]

    def of_wheel(name: str) -> float:
        value: float = variation[name][channel] if name in variation else 0.0
        return value

    servo = dict(wheel["servo"])
    values = {
        "no_load_speed_rad_s": servo["no_load_speed_rad_s"] * _factor(of_wheel("servo_speed")),
        "stall_torque_n_m": servo["stall_torque_n_m"] * _factor(of_wheel("servo_torque")),
        "neutral_us": servo["neutral_us"] + of_wheel("neutral_us"),
        "deadband_us": servo["deadband_us"] + of_wheel("deadband_us"),
    }
    servo.update({key: _within(limits[f"body.wheels.servo.{key}"], value) for key, value in values.items()})
    servo["saturation_us"] = max(servo["saturation_us"], servo["deadband_us"] + 1)
    varied = {**wheel, "servo": servo}
    varied["radius_m"] = _within(limits["body.wheels.radius_m"], wheel["radius_m"] * _factor(of_wheel("wheel_radius")))
    varied["grip"] = _within(limits["body.wheels.grip"], wheel["grip"] * _factor(of_wheel("tyre_grip")))
    if of_wheel("eccentricity_m") > 0:
        largest = LARGEST_ECCENTRICITY * varied["radius_m"]
        varied["eccentricity_m"] = _within((0, largest), of_wheel("eccentricity_m"))
        phase = of_wheel(phase_name("eccentricity_m"))
        varied["eccentricity_phase_rad"] = _within(limits["body.wheels.eccentricity_phase_rad"], phase)
    return varied


def _factor(relative: float) -> float:
    """1 + ``relative``, at least 0.05, so that no mass or speed becomes zero or negative."""
    return max(0.05, 1 + relative)


def _within(limits: tuple[float, float], value: float) -> float:
    """The value clamped to the limits and rounded to nine significant digits, as in body_json."""
    least, largest = limits
    return float(f"{min(max(value, least), largest):.9g}") + 0.0
