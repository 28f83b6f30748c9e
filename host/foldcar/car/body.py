"""A design as simulator and firmware read it: its body, car.json (docs/firmware.md), firmware parameters.

Input: a Design, compiled to its folded car (millimetres). Output: the ``body`` object of docs/carsim.md without its id,
in SI units, rounded to nine significant digits so that the same car has the same bytes on every machine; the content of
car.json with a hash that identifies the design; values of firmware parameters. The firmware declares the table of its
parameters, which `carsim params` prints; here values are only checked against it.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.car.design import Design
from foldcar.car.folded.model import Axle, FoldedCar, HingeJoint
from foldcar.car.folded.weight import body_properties
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.bought import Film
from foldcar.car.parts.catalogue import Catalogue, catalogue
from foldcar.car.supply import stall_current_a
from foldcar.errors import FoldcarError

MM = 1e-3
# The fraction of the supply's voltage that may drop at its resistance; the simulator's limit is one half.
MAX_VOLTAGE_DROP = 0.499


def body_json(design: Design) -> dict[str, Any]:
    """Return the simulator's body of the design: segments, hinges, wheels with servos, supply voltage (SI units).

    Raises DesignError if the design cannot be compiled.
    """
    car = folded_car(design)
    # A unit is something that is built several times, such as a wheel. So one wheel of each unit is weighed.
    wheel_mass_by_unit: dict[str, float] = {}
    for axle in car.axles:
        if axle.unit not in wheel_mass_by_unit:
            wheel_mass_by_unit[axle.unit] = body_properties(car, axle.wheel).mass_kg
    # The first two axles are those of the front left and the front right wheel.
    left_axle, right_axle = car.axles[:2]
    body = {
        "segments": [_segment_json(design, car, index) for index in range(len(design.segments))],
        "hinges": [_hinge_json(hinge, car.parts.film) for hinge in car.hinges],
        "track_m": (left_axle.center_mm[1] - right_axle.center_mm[1]) * MM,
        "wheels": [_wheel_json(axle, wheel_mass_by_unit[axle.unit], car.parts) for axle in car.axles],
        "supply_v": car.parts.cells.supply_v.value,
    }
    resistance_ohm = car.parts.cells.supply_resistance_ohm.value
    if resistance_ohm > 0:
        body["supply_resistance_ohm"] = min(resistance_ohm, _max_resistance_ohm(car))
    # Every number is rounded when it is read back from JSON.
    rounded_body: dict[str, Any] = json.loads(json.dumps(body), parse_float=lambda digits: _rounded(float(digits)))
    return rounded_body


def _max_resistance_ohm(car: FoldedCar) -> float:
    """Return the largest resistance of the supply that the simulator accepts (ohm).

    If all servos stall, such a supply has little more than half of its voltage.
    """
    return _rounded(MAX_VOLTAGE_DROP * car.parts.cells.supply_v.value / stall_current_a(car))


def full_speed_m_s(design: Design) -> float:
    """Return the speed of the design without load (m/s): the servo speed times the smallest radius of a driven wheel."""
    line = design.parts.servo.at_voltage(design.parts.cells.supply_v.value)
    min_radius_mm = min(design.of(module, "radius") for module in design.driven_modules)
    return _rounded(line.no_load_speed_rad_s * min_radius_mm * MM)


def _segment_json(design: Design, car: FoldedCar, index: int) -> dict[str, Any]:
    """Return a segment, a rigid part of the car, as the JSON object that the simulator reads.

    ``index`` counts the segments from the front, from 0. Lengths are in the car's frame.
    """
    box = design.segments[index]
    properties = body_properties(car, f"segment{index}")
    return {
        "x_m": box.center_mm * MM,
        "length_m": box.length_mm * MM,
        "width_m": design.width_mm * MM,
        "height_m": design.height_mm * MM,
        # The middle of all segments has the height 0 in the car's frame.
        "center_z_m": 0.0,
        "mass_kg": properties.mass_kg,
        "com_x_m": properties.center_m[0],
        "com_y_m": properties.center_m[1],
        "com_z_m": properties.center_m[2],
        "roll_inertia_kg_m2": properties.inertia_kg_m2[0, 0],
        "pitch_inertia_kg_m2": properties.inertia_kg_m2[1, 1],
        "yaw_inertia_kg_m2": properties.inertia_kg_m2[2, 2],
        # The grip is the friction of the film divided by the friction of the default tyre.
        "grip": car.parts.film.friction.value / catalogue().tyre_friction.value,
    }


def _hinge_json(hinge: HingeJoint, film: Film) -> dict[str, Any]:
    """Return a hinge as carsim's input."""
    # The loss factor of the film is (damping × angular frequency / stiffness) at the frequency at which it was measured.
    damping = film.loss_factor.value * hinge.stiffness_n_m_rad / (2 * math.pi * film.loss_frequency_hz.value)
    return {
        "x_m": hinge.center_mm[0] * MM,
        "z_m": hinge.center_mm[2] * MM,
        "stiffness_n_m_rad": hinge.stiffness_n_m_rad,
        "damping_n_m_s_rad": damping,
        "min_rad": hinge.min_rad,
        "max_rad": hinge.max_rad,
    }


def _wheel_json(axle: Axle, mass_kg: float, parts: Catalogue) -> dict[str, Any]:
    """Return a wheel as input for the simulator, with its servo if it is driven.

    ``grip`` is the friction of the tyre relative to that of the standard tyre.
    """
    servo, supply_v = parts.servo, parts.cells.supply_v.value
    line = servo.at_voltage(supply_v)
    wheel: dict[str, Any] = {
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
    }
    if axle.driven:
        wheel["servo"] = {
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
        }
    return wheel


def driven_wheels(body: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the wheels of a body that have a servo."""
    return [wheel for wheel in body["wheels"] if "servo" in wheel]


def _rounded(value: float) -> float:
    """Round to nine significant digits."""
    # Terms that cancel may leave -0.0. Adding zero turns it into 0.0.
    return float(f"{value:.9g}") + 0.0


FORMAT = 1
HASH_DIGITS = 16
MAX_NAME_BYTES = 32
# The firmware derives these from wheels, wheel_radius_m and track_m of the file.
FIXED = ("WHEEL_RADIUS_M", "TRACK_M")
FIXED_ENDINGS = ("_SIDE", "_DIRECTION")


def car_json(design: Design) -> dict[str, Any]:
    """Return the content of car.json: lengths in m, masses in kg, servo channels counted from 1."""
    body = body_json(design)
    masses_kg = [part["mass_kg"] for part in (*body["segments"], *body["wheels"])]
    parameters = {
        name: value
        for name, value in firmware_parameters(design, body).items()
        if name not in FIXED and not name.endswith(FIXED_ENDINGS)
    }
    return {
        "format": FORMAT,
        "name": design_name(design),
        "hash": _hash(design, body),
        **_firmware_geometry(body),
        "length_m": design.length_mm / 1000,
        "width_m": design.width_mm / 1000,
        "mass_kg": round(sum(masses_kg), 4),
        "parameters": parameters,
    }


def design_name(design: Design) -> str:
    """Return a name for people: modules, width × length and wheel radii in mm, at most 32 bytes of UTF-8.

    Example: "W_B_W 95x200 r60"
    """
    radii = ",".join(dict.fromkeys(f"{radius:g}" for radius in design.radii_mm))
    text = f"{design.composition} {design.width_mm:g}x{design.length_mm:g} r{radii}"
    return text.encode()[:MAX_NAME_BYTES].decode(errors="ignore")


def design_hash(design: Design) -> str:
    """Return the 16 hexadecimal digits that identify a design: a hash of its type, parameters and wiring (SHA-256)."""
    return _hash(design, body_json(design))


def _hash(design: Design, body: Mapping[str, Any]) -> str:
    content = [design.type, dict(sorted(design.values.items())), _firmware_geometry(body)]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:HASH_DIGITS]


def _firmware_geometry(body: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the firmware needs to know about the body: the track, and the driven wheels with their positions."""
    wheels = [
        {
            "channel": wheel["channel"] + 1,
            "side": wheel["side"],
            "direction": wheel["servo"]["direction"],
            "x_m": wheel["x_m"],
        }
        for wheel in driven_wheels(body)
    ]
    return {"wheel_radius_m": _min_radius_m(body), "track_m": body["track_m"], "wheels": wheels}


def _min_radius_m(body: Mapping[str, Any]) -> float:
    """Return the radius of the smallest driven wheel (m).

    The firmware computes wheel speeds with it, so that no wheel has to turn faster than its servo can.
    """
    return min(float(wheel["radius_m"]) for wheel in driven_wheels(body))


# For each option of a car: the firmware's parameter that says that the car has it, and the parameter's value. The
# voltage divider has 20 kΩ and 10 kΩ, so the battery has three times the measured voltage.
OPTION_PARAMETERS = (("button", "BUTTON_WIRED", 1.0), ("divider", "SERVO_DIVIDER", 3.0), ("oe_wire", "OE_WIRED", 1.0))

# Values of CHn_SIDE.
SIDES = {"unused": 0, "left": 1, "right": 2}
CHANNELS = 8


@dataclass(frozen=True, slots=True)
class TableRow:
    """One row of the firmware's parameter table; limits and default are in ``unit``."""

    name: str
    unit: str
    minimum: float
    maximum: float
    default: float


def firmware_parameters(design: Design, body: Mapping[str, Any] | None = None) -> dict[str, float]:
    """Return the values of the firmware's parameters for this car.

    ``body`` is the design's body_json; it is computed if it is None. Each servo has a channel, which drives it with
    pulses. Channels count from 1 in the names of parameters, and from 0 in the body. A servo stands still at the
    neutral pulse width, and within the dead band around it. From there, its speed grows with the pulse width by the
    gain.
    """
    body = body_json(design) if body is None else body
    wheel_by_channel = {wheel["channel"]: wheel for wheel in driven_wheels(body)}
    radius_m = _min_radius_m(body)
    values: dict[str, float] = {
        "WHEEL_RADIUS_M": radius_m,
        "TRACK_M": body["track_m"],
        "WHEEL_MAX_RAD_S": driven_wheels(body)[0]["servo"]["no_load_speed_rad_s"],
        **{name: value for option, name, value in OPTION_PARAMETERS if getattr(design.parts, option) == "fitted"},
    }
    for channel in range(CHANNELS):
        prefix = f"CH{channel + 1}"
        wheel = wheel_by_channel.get(channel)
        if wheel is None:
            values[f"{prefix}_SIDE"] = SIDES["unused"]
            continue
        servo = wheel["servo"]
        span_us = servo["saturation_us"] - servo["deadband_us"]
        values[f"{prefix}_SIDE"] = SIDES[wheel["side"]]
        values[f"{prefix}_DIRECTION"] = servo["direction"]
        values[f"{prefix}_NEUTRAL_US"] = servo["neutral_us"]
        values[f"{prefix}_DEADBAND_US"] = servo["deadband_us"]
        # A larger wheel turns more slowly, so that all wheels roll at the same speed.
        speed_ratio = radius_m / wheel["radius_m"]
        values[f"{prefix}_GAIN_US"] = _rounded(speed_ratio * span_us / servo["no_load_speed_rad_s"])
    return values


def check_parameters(values: Mapping[str, float], table: Mapping[str, TableRow]) -> None:
    """Raise FoldcarError if a parameter is not in the firmware's table, or its value is outside the limits there."""
    for name, value in values.items():
        row = table.get(name)
        if row is None:
            raise FoldcarError(f"firmware parameter {name}: the firmware of this carsim has no such parameter")
        if not row.minimum <= value <= row.maximum:
            limits = f"{row.minimum:g} to {row.maximum:g} {row.unit}".rstrip()
            raise FoldcarError(f"firmware parameter {name}: {value:g} is outside the firmware's limits {limits}")
