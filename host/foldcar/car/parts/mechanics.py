"""Screws, spacers, tools, the ball caster; servos, and what makes a wheel of folded discs: horns, tyres."""

import math
from typing import Literal

from foldcar.car.parts.quantity import Bought, BoxPart, Data, Holes, PartData, Quantity


class Screw(Bought):
    """A screw, ``length_mm`` below the head, with its nut, if it has one."""

    mass_kg: Quantity
    diameter_mm: Quantity
    length_mm: Quantity
    head_diameter_mm: Quantity
    head_height_mm: Quantity
    nut_width_mm: Quantity | None
    nut_height_mm: Quantity | None


class Spacer(Bought):
    """A round spacer around a screw."""

    mass_kg: Quantity
    length_mm: Quantity
    diameter_mm: Quantity
    hole_mm: Quantity


class Tools(PartData):
    """The room that a screwdriver, a finger, and a nut before its screw need."""

    driver_diameter_mm: Quantity
    driver_length_mm: Quantity
    finger_diameter_mm: Quantity
    finger_length_mm: Quantity
    nut_room_mm: Quantity

    @property
    def finger_mm(self) -> tuple[float, float]:
        """Diameter and length of the largest finger (mm)."""
        return self.finger_diameter_mm.most, self.finger_length_mm.most

    @property
    def driver_mm(self) -> tuple[float, float]:
        """Diameter and length of the largest screwdriver's shaft (mm)."""
        return self.driver_diameter_mm.most, self.driver_length_mm.most


class Caster(BoxPart):
    """A ball caster: a ball under a flange with two screws."""

    hole_spacing_mm: Quantity


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

        def between(name: str) -> float:
            first, last = (float(getattr(point, name).value) for point in (low, high))
            return first + share * (last - first)

        return ServoLine(
            no_load_speed_rad_s=between("no_load_speed_rpm") * 2 * math.pi / 60,
            stall_torque_n_m=between("stall_torque_kgf_cm") * STANDARD_GRAVITY_M_S2 / 100,
            no_load_current_a=between("no_load_current_a"),
            stall_current_a=between("stall_current_a"),
        )


class Arms(Data):
    """A horn's arms: their directions, lengths from the axis to the tip, and the width at the tip."""

    at_deg: tuple[float, ...]
    reach_mm: tuple[float, ...]
    width_mm: float
    tolerance: float
    source: str


class Horn(Bought):
    """A servo horn; it comes with the servo, and its mass counts to the wheel's.

    Its frame: the axis is z, arms in the plane of x and y, the first along x. Arms or disc are flush with the hub's
    outer face. ``holes`` are all, ``wheel_screws`` those of them that hold a wheel. Its cost says whence it comes.
    """

    mass_kg: Quantity
    arms: Arms | None
    disc_diameter_mm: Quantity | None
    hub_diameter_mm: Quantity
    height_mm: Quantity
    thickness_mm: Quantity
    spline_depth_mm: Quantity
    centre_hole_mm: Quantity
    recess_diameter_mm: Quantity
    recess_depth_mm: Quantity
    holes: Holes
    wheel_screws: Holes

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Least x and y, greatest x and y of arms, disc and hub (mm)."""
        half = max(self.hub_diameter_mm.value, self.disc_diameter_mm.value if self.disc_diameter_mm else 0.0) / 2
        xs, ys = [-half, half], [-half, half]
        if self.arms:
            for angle_deg, reach in zip(self.arms.at_deg, self.arms.reach_mm, strict=True):
                xs.append(reach * round(math.cos(math.radians(angle_deg)), 9))
                ys.append(reach * round(math.sin(math.radians(angle_deg)), 9))
        return min(xs), min(ys), max(xs), max(ys)


class Tyre(Bought):
    """A wheel's tyre; without a ``width_mm`` of its own it is cut to the rim's width. Its cost is a wheel's.

    It is cut from a strip, or from a tube that shrinks. Without a ``friction`` of its own it has the film's.
    """

    form: Literal["strip", "tube"]
    thickness_mm: Quantity
    width_mm: Quantity | None
    density_kg_m3: Quantity
    friction: Quantity | None
    note: str

    def running_width_mm(self, rim_width_mm: float) -> float:
        """The width that touches the ground (mm), on a rim of that width."""
        return rim_width_mm if self.width_mm is None else min(self.width_mm.value, rim_width_mm)

    def cut(self, radius_mm: float, rim_width_mm: float) -> str:
        """What to cut for a wheel of that outer radius: a strip as long as the tyre's middle, or a piece of tube."""
        wide, thick = self.running_width_mm(rim_width_mm), self.thickness_mm.value
        if self.form == "tube":
            least = 2 * (radius_mm - thick)
            flat = math.ceil(math.pi * least / 2)
            return f"{wide:g} mm of a tube that is wider than {least:g} mm before it shrinks ({flat} mm flat)"
        return f"a strip of {round(math.pi * (2 * radius_mm - thick))} x {wide:g} mm"

    def mass_kg(self, radius_mm: float, rim_width_mm: float) -> float:
        """The mass of a ring of that outer radius (kg)."""
        thickness = self.thickness_mm.value
        area_mm2 = math.pi * (radius_mm**2 - (radius_mm - thickness) ** 2)
        width_mm = rim_width_mm if self.width_mm is None else self.width_mm.value
        return area_mm2 * width_mm * 1e-9 * self.density_kg_m3.value
