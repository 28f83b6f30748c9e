"""The simulator's body of a design: exactly the ``body`` object of docs/carsim.md, without its id.

Input: a Design, compiled to its folded car (millimetres). Output: plain JSON in SI units, rounded to
nine significant digits so that the same car has the same bytes on every machine.
"""

import math
from typing import Any

from foldcar.car.design import Design
from foldcar.car.folded.model import Axle, FoldedCar, HingeJoint
from foldcar.car.folded.weight import body_properties, wheel_mass_kg
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import Catalogue, catalogue
from foldcar.car.parts.film import Film

MM = 1e-3


def body_json(design: Design) -> dict[str, Any]:
    """The simulator's body of the design: segments, hinges, wheels with servos, supply voltage (SI units).

    DesignError if the design cannot be compiled.
    """
    car = folded_car(design)
    # All wheels are alike.
    wheel_kg = wheel_mass_kg(car, car.axles[0].wheel)
    body = {
        "segments": [_segment(design, car, index) for index in range(len(design.segments))],
        "hinges": [_hinge(hinge, car.parts.film) for hinge in car.hinges],
        "track_m": (car.axles[0].center_mm[1] - car.axles[1].center_mm[1]) * MM,
        "wheels": [_wheel(axle, wheel_kg, car.parts) for axle in car.axles],
        "supply_v": car.parts.battery.supply_v.value,
    }
    rounded: dict[str, Any] = _rounded(body)
    return rounded


def full_speed_m_s(design: Design) -> float:
    """The design's highest speed (m/s): no-load wheel speed at the supply voltage times the wheel radius."""
    line = design.parts.servo.at_voltage(design.parts.battery.supply_v.value)
    speed: float = _rounded(line.no_load_speed_rad_s * design.values["radius"] * MM)
    return speed


def _segment(design: Design, car: FoldedCar, index: int) -> dict[str, Any]:
    box = design.segments[index]
    properties = body_properties(car, f"segment{index}")
    return {
        "x_m": box.center_mm * MM,
        "length_m": box.length_mm * MM,
        "width_m": design.values["width"] * MM,
        "height_m": design.values["height"] * MM,
        "center_z_m": 0.0,
        "mass_kg": properties.mass_kg,
        "com_x_m": properties.center_m[0],
        "com_y_m": properties.center_m[1],
        "com_z_m": properties.center_m[2],
        "roll_inertia_kg_m2": properties.inertia_kg_m2[0, 0],
        "pitch_inertia_kg_m2": properties.inertia_kg_m2[1, 1],
        "yaw_inertia_kg_m2": properties.inertia_kg_m2[2, 2],
        # Grip is a contact's friction coefficient relative to that of a tyre.
        "grip": car.parts.film.friction.value / catalogue().tyre_friction.value,
    }


def _hinge(hinge: HingeJoint, film: Film) -> dict[str, Any]:
    stiffness = hinge.stiffness_n_m_rad
    # A loss factor is damping times angular frequency over stiffness, at the frequency of its measurement.
    damping = film.loss_factor.value * stiffness / (2 * math.pi * film.loss_frequency_hz.value)
    return {
        "x_m": hinge.center_mm[0] * MM,
        "z_m": hinge.center_mm[2] * MM,
        "stiffness_n_m_rad": stiffness,
        "damping_n_m_s_rad": damping,
        "min_rad": hinge.min_rad,
        "max_rad": hinge.max_rad,
    }


def _wheel(axle: Axle, mass_kg: float, parts: Catalogue) -> dict[str, Any]:
    servo, supply_v = parts.servo, parts.battery.supply_v.value
    line = servo.at_voltage(supply_v)
    return {
        "channel": axle.channel,
        "segment": int(axle.body.removeprefix("segment")),
        "side": axle.side,
        "x_m": axle.center_mm[0] * MM,
        "radius_m": axle.radius_mm * MM,
        "width_m": axle.tyre_width_mm * MM,
        "mass_kg": mass_kg,
        "grip": parts.tyre_friction.value / catalogue().tyre_friction.value,
        "eccentricity_m": 0.0,
        "eccentricity_phase_rad": 0.0,
        "servo": {
            "stall_torque_n_m": line.stall_torque_n_m,
            "no_load_speed_rad_s": line.no_load_speed_rad_s,
            "rated_v": supply_v,
            "stall_current_a": line.stall_current_a,
            "no_load_current_a": line.no_load_current_a,
            "rotor_inertia_kg_m2": servo.rotor_inertia_kg_m2.value,
            "neutral_us": servo.neutral_us.value,
            "deadband_us": servo.deadband_us.value,
            "saturation_us": servo.saturation_us.value,
            "direction": axle.direction,
        },
    }


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        # Adding zero turns -0.0, which cancelling terms may leave, into 0.0.
        return float(f"{value:.9g}") + 0.0
    return value
