"""Boards, batteries, switch and plugs.

A board's frame: the middle of its outline on its underside; x away from the Feather's USB socket, y towards its shorter
row of pins, z up.
"""

import math

from foldcar.car.parts.mechanics import Screw
from foldcar.car.parts.quantity import Bought, Box, BoxPart, Data, Holes, PartData, Places, Quantity


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
