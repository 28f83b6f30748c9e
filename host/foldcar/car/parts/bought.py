"""The film, screws, servos, wheels' parts, boards, batteries, switch and plugs, as their data files describe them.

A board's frame: the middle of its outline on its underside; x away from the Feather's USB socket, y towards its shorter
row of pins, z up.
"""

import math
from typing import Literal

from foldcar.car.parts.quantity import Bought, Box, BoxPart, Data, Holes, PartData, Places, Quantity


class Cutting(Data):
    """How each machine cuts a film, and who says so; None for a machine that does not."""

    silhouette: str | None
    cricut: str | None
    laser: str | None
    scissors: str | None


class Film(PartData):
    """A film of one thickness; films of one material have the same ``name``.

    Bent below ``least_bend_radius_mm`` it keeps a crease or cracks. ``friction`` is that of bare film on the ground.
    ``tape`` is what holds it, ``folding`` how its folds are made, ``hinge`` how it stands being bent in use.
    """

    sold_as: str
    cost_usd_m2: Quantity
    thickness_mm: Quantity
    density_kg_m3: Quantity
    youngs_modulus_pa: Quantity
    least_bend_radius_mm: Quantity
    friction: Quantity
    loss_factor: Quantity
    loss_frequency_hz: Quantity
    cutting: Cutting
    folding: str
    tape: str
    hinge: str

    @property
    def title(self) -> str:
        """Material and thickness."""
        return f"{self.name} {self.thickness_mm.value:g} mm"


class Assembly(PartData):
    """Clearances, laminations and contact properties of a folded car."""

    lap_flap_mm: Quantity
    fold_distance_mm: Quantity
    cut_mm: Quantity
    placement_mm: Quantity
    opening_clearance_mm: Quantity
    wheel_distance_mm: Quantity
    belly_clearance_mm: Quantity
    screw_hole_mm: Quantity
    doubler_margin_mm: Quantity
    switch_margin_mm: Quantity
    cap_tab_mm: Quantity
    cable_slit_mm: Quantity
    cable_slit_length_mm: Quantity
    shelf_clearance_mm: Quantity
    tongue_mm: Quantity
    slot_clearance_mm: Quantity
    flap_mm: Quantity
    flap_gap_mm: Quantity
    lock_mm: Quantity
    lock_reach_mm: Quantity
    lock_distance_mm: Quantity
    grip_mm: Quantity
    grip_gap_mm: Quantity
    cap_clearance_mm: Quantity
    tape_mm: Quantity
    bridge_foot_mm: Quantity
    bridge_gap_mm: Quantity
    floor_tongue_reach_mm: Quantity
    usb_inside_mm: Quantity
    part_gap_mm: Quantity
    lead_hole_mm: Quantity
    hinge_glue_mm: Quantity


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


class Feather(BoxPart):
    """The processor's board with female headers on it; ``joints`` are their pins below it, ``small`` parts at holes."""

    board_mm: Quantity
    joints: tuple[Box, Box]
    small: tuple[Box, ...]
    headers: tuple[Box, Box]
    holes: tuple[Holes, Holes]
    usb: Box
    battery_socket: Box
    reset: Box
    antenna: Box

    def free_holes(self, screw: Screw) -> list[tuple[float, float]]:
        """The holes beside which a screw's nut can be turned: nothing stands on the board there."""
        nut = screw.nut_width_mm.value / math.sqrt(3) if screw.nut_width_mm else screw.diameter_mm.value / 2
        standing = (*self.headers, *self.small, self.usb, self.battery_socket, self.reset, self.antenna)
        return [at for several in self.holes for at in several.at_mm if all(_apart(box, at) > nut for box in standing)]


def _apart(box: Box, at: tuple[float, float]) -> float:
    """Distance of a point of the board from a box on it (mm), seen from above."""
    return math.hypot(*(max(0.0, abs(at[i] - box.at_mm[i]) - box.size_mm[i] / 2) for i in (0, 1)))


class FeatherWing(BoxPart):
    """The servo driver, plugged onto the Feather: ``gap_mm`` is between the two boards, ``headers`` are below it.

    ``plug_top_mm`` is the height of an upright servo plug's top over this board's underside, ``plug_bend_mm`` what its
    leads need above it. ``outputs`` are the middles of the outputs' pins, from output 0 on.
    """

    board_mm: Quantity
    gap_mm: Quantity
    plug_top_mm: Quantity
    plug_bend_mm: Quantity
    headers: tuple[Box, Box]
    holes: tuple[Holes]
    servo_headers: tuple[Box, Box]
    outputs: Places
    terminal_block: Box
    reset: Box


class LeadedBattery(BoxPart):
    """A battery whose leads leave the middle of an end of its length."""

    lead_length_mm: Quantity


class Battery(LeadedBattery):
    """The servos' supply and its voltage under light load."""

    supply_v: Quantity


class Switch(BoxPart):
    """A rocker switch that snaps into a slot of a panel at least ``panel_least_mm`` thick."""

    bezel_height_mm: Quantity
    rocker_height_mm: Quantity
    slot_length_mm: Quantity
    slot_width_mm: Quantity
    body_length_mm: Quantity
    body_width_mm: Quantity
    body_depth_mm: Quantity
    terminal_depth_mm: Quantity
    panel_least_mm: Quantity
    current_a: Quantity


class Plug(Data):
    """A plug with its housing; ``inserted_mm`` of its way is in the socket."""

    name: str
    width_mm: Quantity
    thickness_mm: Quantity
    length_mm: Quantity
    inserted_mm: Quantity


class Plugs(PartData):
    """The plugs that must pass: the computer's, the servos' and the LiPo's."""

    usb: Plug
    servo: Plug
    battery: Plug


class Wiring(BoxPart):
    """Wire with what is soldered; ``wire_mm`` of it are in its mass and cost. The slack that leads need on their ways."""

    wire_mm: Quantity
    wire_kg_m: Quantity
    wire_usd_m: Quantity
    joint_mm: Quantity
    slack_mm: Quantity
    slack_share: Quantity
    hinge_slack_mm: Quantity


class Extension(Bought):
    """A lead with a socket at one end and a plug at the other."""

    mass_kg: Quantity
    length_mm: Quantity


class Extensions(PartData):
    """Servo extensions as they are sold, the shortest first; ``joint`` is a plug in an extension's socket."""

    joint_length_mm: Quantity
    joint_width_mm: Quantity
    joint_height_mm: Quantity
    sold: tuple[Extension, ...]
