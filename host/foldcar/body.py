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
    """The car as the simulator sees it: segments and their hinges, wheels with their servos, supply."""
    body = {
        "segments": [_segment(design, index) for index in range(len(design.segments))],
        "hinges": [_hinge(design, x_mm) for x_mm in design.hinges_mm],
        "track_m": design.track_mm * MM,
        "wheels": _wheels(design),
        "supply_v": catalogue().battery.supply_v.value,
    }
    rounded: dict[str, Any] = _rounded(body)
    return rounded


def segment_properties(design: Design, segment: int) -> MassProperties:
    """Film, servos, boards and batteries of one segment as a rigid body, in the car's frame, hinges flat."""
    return assemble(
        box_properties(box.mass_kg, _metres(box.size_mm), _metres(box.center_mm))
        for box in layout(design)
        if box.segment == segment
    )


def hinge_stiffness_n_m_rad(design: Design) -> float:
    """A hinge's strip as a beam bent to a circular arc: E w t³ / 12 l."""
    values = design.values
    second_moment_m4 = values["width"] * MM * (values["H.thickness"] * MM) ** 3 / 12
    return catalogue().film.youngs_modulus_pa.value * second_moment_m4 / (values["H.length"] * MM)


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


def _segment(design: Design, index: int) -> dict[str, Any]:
    assembly, box = catalogue().assembly, design.segments[index]
    properties = segment_properties(design, index)
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
        # The belly's friction relative to that of the tyres.
        "grip": assembly.belly_friction.value / assembly.tyre_friction.value,
    }


def _hinge(design: Design, x_mm: float) -> dict[str, Any]:
    film, values = catalogue().film, design.values
    stiffness = hinge_stiffness_n_m_rad(design)
    # A loss factor is the damping's share of the stiffness at the frequency it was taken at.
    damping = film.loss_factor.value * stiffness / (2 * math.pi * film.loss_frequency_hz.value)
    return {
        "x_m": x_mm * MM,
        "z_m": 0.0,
        "stiffness_n_m_rad": stiffness,
        "damping_n_m_s_rad": damping,
        "min_rad": -math.radians(values["H.fold_down"]),
        "max_rad": math.radians(values["H.fold_up"]),
    }


def _wheels(design: Design) -> list[dict[str, Any]]:
    """Front to back, left then right; channels count up in that order and right servos are mirrored."""
    servo, supply_v = catalogue().servo, catalogue().battery.supply_v.value
    line = servo.at_voltage(supply_v)
    radius_m, width_m = design.values["radius"] * MM, design.values["W.tire_thickness"] * MM
    axles = zip(design.axles_mm, design.axle_segments, strict=True)
    places = [(x_mm, segment, side) for x_mm, segment in axles for side in ("left", "right")]
    return [
        {
            "channel": channel,
            "segment": segment,
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
        for channel, (x_mm, segment, side) in enumerate(places)
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
