"""A wheel servo: its shape, its data-sheet values and the torque-speed line between them."""

import math

from pydantic import ConfigDict

from foldcar.car.parts.quantity import Bought, Data, Quantity

STANDARD_GRAVITY_M_S2 = 9.80665


class OperatingPoint(Data):
    """A servo's data-sheet values at one voltage."""

    voltage_v: float
    no_load_speed_rpm: Quantity
    stall_torque_kgf_cm: Quantity
    no_load_current_a: Quantity
    stall_current_a: Quantity


class ServoLine(Data):
    """A servo's torque-speed line and currents at one voltage, in SI units."""

    model_config = ConfigDict(frozen=True)

    no_load_speed_rad_s: float
    stall_torque_n_m: float
    no_load_current_a: float
    stall_current_a: float


class Servo(Bought):
    """A wheel servo: length along the car, width up, depth across, its shaft outwards.

    Heights (``ear_underside_mm``, ``turret_top_mm``, ``spline_top_mm``, ``lead_height_mm``) are above its bottom, the end
    of its depth that lies inside the car. The turret is the round around the axis, the idler the smaller one beside it.
    """

    mass_kg: Quantity
    length_mm: Quantity
    width_mm: Quantity
    depth_mm: Quantity
    axis_from_end_mm: Quantity
    ear_underside_mm: Quantity
    ear_span_mm: Quantity
    ear_thickness_mm: Quantity
    screw_spacing_mm: Quantity
    screw_hole_mm: Quantity
    turret_diameter_mm: Quantity
    turret_top_mm: Quantity
    idler_diameter_mm: Quantity
    idler_from_axis_mm: Quantity
    spline_diameter_mm: Quantity
    spline_top_mm: Quantity
    spline_teeth: Quantity
    lead_length_mm: Quantity
    lead_height_mm: Quantity
    operating_points: tuple[OperatingPoint, OperatingPoint]
    rotor_inertia_kg_m2: Quantity
    neutral_us: Quantity
    deadband_us: Quantity
    saturation_us: Quantity

    def at_voltage(self, voltage_v: float) -> ServoLine:
        """Linear interpolation (or extrapolation) of the two data-sheet points at ``voltage_v``, in SI units."""
        low, high = self.operating_points
        share = (voltage_v - low.voltage_v) / (high.voltage_v - low.voltage_v)

        def between(quantity: str) -> float:
            low_value: float = getattr(low, quantity).value
            high_value: float = getattr(high, quantity).value
            return low_value + share * (high_value - low_value)

        return ServoLine(
            no_load_speed_rad_s=between("no_load_speed_rpm") * 2 * math.pi / 60,
            stall_torque_n_m=between("stall_torque_kgf_cm") * STANDARD_GRAVITY_M_S2 / 100,
            no_load_current_a=between("no_load_current_a"),
            stall_current_a=between("stall_current_a"),
        )
