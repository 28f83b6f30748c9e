"""A wheel's servo and its horn, as their data files describe them."""

import math
from typing import NamedTuple

from foldcar.car.parts.quantity import Bought, Data, Holes, Quantity

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

    no_load_speed_rad_s: float
    stall_torque_n_m: float
    no_load_current_a: float
    stall_current_a: float


class Servo(Bought):
    """A wheel servo: length along the car, width up, depth across, its shaft outwards.

    Heights (``ear_underside_mm``, ``turret_top_mm``, ``spline_top_mm``, ``lead_height_mm``) are above its bottom, the end
    of its depth that lies inside the car. The turret is the round around the axis, the idler the smaller one beside it.
    """

    operating_points: tuple[OperatingPoint, OperatingPoint]

    def at_voltage(self, voltage_v: float) -> ServoLine:
        """Return torque, speed and currents at ``voltage_v`` in SI units, linear in the two points of the data sheet."""
        low, high = self.operating_points
        fraction = (voltage_v - low.voltage_v) / (high.voltage_v - low.voltage_v)

        def interpolated(name: str) -> float:
            at_low, at_high = (float(getattr(point, name).value) for point in (low, high))
            return at_low + fraction * (at_high - at_low)

        return ServoLine(
            no_load_speed_rad_s=interpolated("no_load_speed_rpm") * 2 * math.pi / 60,
            stall_torque_n_m=interpolated("stall_torque_kgf_cm") * STANDARD_GRAVITY_M_S2 / 100,
            no_load_current_a=interpolated("no_load_current_a"),
            stall_current_a=interpolated("stall_current_a"),
        )


class Arms(Data):
    """A horn's arms: their directions, lengths from the axis to the tip, and the width at the tip."""

    at_deg: tuple[float, ...]
    reach_mm: tuple[float, ...]
    width_mm: float
    tolerance: float
    source: str


class Extent(NamedTuple):
    """The limits of a part in the x-y plane of its frame (mm)."""

    min_x: float
    min_y: float
    max_x: float
    max_y: float


class Horn(Bought):
    """A servo horn; it comes with the servo, and its mass counts to the wheel's.

    Its frame: the axis is z, arms in the plane of x and y, the first along x. Arms or disc are flush with the hub's
    outer face. ``holes`` are all its holes, ``wheel_screws`` those for the wheel's screws. Its cost tells its origin.
    """

    arms: Arms | None
    disc_diameter_mm: Quantity | None
    holes: Holes
    wheel_screws: Holes

    @property
    def extent_mm(self) -> Extent:
        """Return the extent of arms, disc and hub, seen along the axis (mm)."""
        diameters = [self.hub_diameter_mm.value]
        if self.disc_diameter_mm:
            diameters.append(self.disc_diameter_mm.value)
        radius = max(diameters) / 2
        xs, ys = [-radius, radius], [-radius, radius]
        if self.arms:
            for angle_deg, reach in zip(self.arms.at_deg, self.arms.reach_mm, strict=True):
                # Rounding makes the cosine of 90° exactly 0.
                xs.append(reach * round(math.cos(math.radians(angle_deg)), 9))
                ys.append(reach * round(math.sin(math.radians(angle_deg)), 9))
        return Extent(min_x=min(xs), min_y=min(ys), max_x=max(xs), max_y=max(ys))
