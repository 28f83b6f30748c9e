"""The simulator's body of a design: exactly the ``body`` object of docs/carsim.md, without its id.

Input: a Design (millimetres). Output: plain JSON in SI units, rounded to nine significant digits so that the
same car has the same bytes on every machine.
"""

import math
from typing import Any

from foldcar.design import Design
from foldcar.layout import layout
from foldcar.mass import MassProperties, assemble, box_properties
from foldcar.parts import catalogue

MM = 1e-3


def body_json(design: Design) -> dict[str, Any]:
    """The car as the simulator sees it: chassis, wheels with their servos, supply."""
    assembly, values = catalogue().assembly, design.values
    chassis = chassis_properties(design)
    # The body module stands on the floor as one box, its friction relative to that of the tyres.
    belly_grip = assembly.belly_friction.value / assembly.tyre_friction.value
    body = {
        "segments": [
            {
                "x_m": 0.0,
                "length_m": design.length_mm * MM,
                "width_m": values["width"] * MM,
                "height_m": values["height"] * MM,
                "center_z_m": 0.0,
                "mass_kg": chassis.mass_kg,
                "com_x_m": chassis.center_m[0],
                "com_y_m": chassis.center_m[1],
                "com_z_m": chassis.center_m[2],
                "roll_inertia_kg_m2": chassis.inertia_kg_m2[0, 0],
                "pitch_inertia_kg_m2": chassis.inertia_kg_m2[1, 1],
                "yaw_inertia_kg_m2": chassis.inertia_kg_m2[2, 2],
                "grip": belly_grip,
            }
        ],
        "hinges": [],
        "track_m": design.track_mm * MM,
        "wheels": _wheels(design),
        "supply_v": catalogue().battery.supply_v.value,
    }
    rounded: dict[str, Any] = _rounded(body)
    return rounded


def chassis_properties(design: Design) -> MassProperties:
    """Film, servos, boards and batteries as one rigid body; the origin is the middle of the body box."""
    return assemble(
        box_properties(box.mass_kg, _metres(box.size_mm), _metres(box.center_mm)) for box in layout(design)
    )


def wheel_mass_kg(radius_m: float, tyre_width_m: float) -> float:
    """Two film discs, the layers laminated around the hub, the rim strip and the servo's horn."""
    film, assembly = catalogue().film, catalogue().assembly
    hub_radius_m = assembly.hub_radius_share.value * radius_m
    discs_m2 = math.pi * (2 * radius_m**2 + assembly.hub_layers.value * hub_radius_m**2)
    rim_m2 = 2 * math.pi * radius_m * tyre_width_m
    areal_density_kg_m2 = film.thickness_mm.value * MM * film.density_kg_m3.value
    return (discs_m2 + rim_m2) * areal_density_kg_m2 + assembly.horn_mass_kg.value


def full_speed_m_s(design: Design) -> float:
    """No-load wheel speed at the supply voltage times the wheel radius."""
    line = catalogue().servo.at_voltage(catalogue().battery.supply_v.value)
    speed: float = _rounded(line.no_load_speed_rad_s * design.values["radius"] * MM)
    return speed


def _wheels(design: Design) -> list[dict[str, Any]]:
    """Front to back, left then right; channels count up in that order and right servos are mirrored."""
    servo, supply_v = catalogue().servo, catalogue().battery.supply_v.value
    line = servo.at_voltage(supply_v)
    radius_m, width_m = design.values["radius"] * MM, design.values["W.tire_thickness"] * MM
    places = [(x_mm, side) for x_mm in design.axles_mm for side in ("left", "right")]
    return [
        {
            "channel": channel,
            "segment": 0,
            "side": side,
            "x_m": x_mm * MM,
            "radius_m": radius_m,
            "width_m": width_m,
            "mass_kg": wheel_mass_kg(radius_m, width_m),
            "grip": catalogue().assembly.tyre_grip.value,
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
                "direction": 1 if side == "left" else -1,
            },
        }
        for channel, (x_mm, side) in enumerate(places)
    ]


def _metres(triple_mm: tuple[float, float, float]) -> tuple[float, float, float]:
    return (triple_mm[0] * MM, triple_mm[1] * MM, triple_mm[2] * MM)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        # Adding zero turns the -0.0 that cancelling terms may leave into 0.0.
        return float(f"{value:.9g}") + 0.0
    return value
