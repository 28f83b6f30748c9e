"""Lengths of a car's leads: needed along their ways and available.

Input: a FoldedCar. Output: Leads. A lead is laid along floor and walls, so the length of a
stretch is the sum of its parts along x, y and z. From segment to segment it passes through the slits of the caps, whose
distance counts at the hinge angle where it is largest. Lengths are in mm, in the car's frame.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from foldcar.car.components.bridge import option_resistors
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.folded.placed import PlacedFace, placed_faces
from foldcar.car.folded.pose import apply, hinge_motion
from foldcar.car.parts.quantity import Bought, Box, BoxPart, PartData

Points = NDArray[np.float64]
LeadKind = Literal["plug", "solder", "wire"]
# A direction counts as an axis of the car if its component along this axis is larger.
ALONG = 0.9
# The sides of the car in the directions -x and +x, -y and +y.
SIDES = (("rear", "front"), ("right", "left"))


@dataclass(frozen=True, slots=True)
class Lead:
    """A lead from ``start`` to ``end``. Its way is ``way_mm`` long; with slack and joints it needs ``needed_mm``.

    ``available_mm`` is the least length that the part's data promise. ``kind`` says what is done if this is too
    short: a "plug" lead of a servo gets an extension, and a "solder" lead is lengthened. A "wire" is cut from stock
    and has no length of its own. ``leaves`` is the side of a battery at which its leads lie.
    """

    start: str
    end: str
    kind: LeadKind
    way_mm: float
    needed_mm: float
    available_mm: float
    extension: str = ""
    leaves: str = ""

    @property
    def missing_mm(self) -> float:
        """The missing length (mm), 0 if the lead is long enough."""
        return max(0.0, self.needed_mm - self.available_mm)


def leads(car: FoldedCar) -> tuple[Lead, ...]:
    """Return the leads of servos and batteries and the wires of the switches; none for a car without a servo driver."""
    if not any(mount.part == car.parts.featherwing.name for mount in car.mounts):
        return ()
    ways = _Ways(car)
    return (*ways.servos(), ways.lipo(), *ways.supply(), *ways.controls())


def stock_wire_mm(leads_of_car: Iterable[Lead]) -> float:
    """Return the length of wire (mm) that is cut from stock.

    This is the wire of the switches, and the wire that lengthens the leads of the battery.
    """
    return sum(lead.missing_mm for lead in leads_of_car if lead.kind != "plug")


def extra_wire_m(leads_of_car: Iterable[Lead], wiring: PartData) -> float:
    """Return the length of wire (m) beyond the length that is included in the wiring's mass and cost."""
    return max(0.0, stock_wire_mm(leads_of_car) - wiring.wire_mm.value) / 1000


def extended_mm(car: FoldedCar, lead_mm: float, extension: Bought) -> float:
    """Return the minimum length (mm) of a lead that is plugged into an extension."""
    return lead_mm + extension.length_mm.min_value - car.parts.plugs.servo.inserted_mm.value


def segment_faces(car: FoldedCar) -> dict[str, list[PlacedFace]]:
    """Return the faces of the segments, by body."""
    return placed_faces(car, {placed.body for placed in car.placed if placed.body.startswith("segment")})


def height_mm(faces: Iterable[PlacedFace], name: str) -> float:
    """Return the greatest height of a beam's face of that name (mm)."""
    return max(float(face.corners_mm[:, 2].max()) for face in faces if face.face.name == name)


class BatteryEnd(NamedTuple):
    """An end of a battery's length: its side in the car (front, rear, left or right) and its middle (3,), in mm."""

    side: str
    middle: Points


class Way(NamedTuple):
    """The way of a lead: its length (mm), and the number of hinges that it passes. Ways compare by their lengths."""

    length_mm: float
    hinges: int


class WireStart(NamedTuple):
    """Where a wire starts: the point (3,) in mm, the body, and how much wire (mm) must be free to lift the boards."""

    point: Points
    body: str
    free_mm: float


def _ends(mount: Mount, battery: BoxPart) -> Iterator[BatteryEnd]:
    """Yield the two ends of a battery, along its length. The leads leave the battery at one of them."""
    # The axis of the mount along which the battery's length lies: x (0), or y (1) if the battery is turned.
    x_mm, y_mm, _ = mount.size_mm
    length_mm = battery.length_mm.value
    is_turned = abs(x_mm - length_mm) > abs(y_mm - length_mm)
    axis = 1 if is_turned else 0
    # In the car's frame, the middle of the battery and the vector from there to one of the ends.
    pose = np.array(mount.pose)
    middle = pose[:3, 3]
    half_length = pose[:3, axis] * mount.size_mm[axis] / 2
    for to_end in (-half_length, half_length):
        # The axis of the car along which the vector mainly points: x (0) or y (1).
        car_axis = int(np.argmax(np.abs(to_end[:2])))
        negative_side, positive_side = SIDES[car_axis]
        side = positive_side if to_end[car_axis] > 0 else negative_side
        yield BatteryEnd(side, middle + to_end)


def _segment_number(body: str) -> int:
    return int(body.removeprefix("segment"))


def _along_axes_mm(start: Points, end: Points) -> float:
    """Return the length of a way between two points that runs along the axes of the car (mm)."""
    return float(np.abs(end - start).sum())


class _Ways:
    """The starts and ends of one car's leads, and the ways between them."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.parts, self.wing = car, car.parts, car.parts.featherwing.name
        self.bodies = segment_faces(car)
        self.mounts = {mount.name: mount for mount in car.mounts}
        self.of_part = {mount.part: mount for mount in car.mounts}

    def servos(self) -> Iterator[Lead]:
        """Yield the leads from the servos to their outputs on the servo driver, the FeatherWing."""
        parts, servo, wing = self.parts, self.parts.servo, self.parts.featherwing
        # Where the lead leaves a servo, in the servo's frame: at its short end, at a height over its bottom. The frame's
        # origin is the middle of the servo, and z points to its bottom.
        lead_exit_mm = (-servo.length_mm.value / 2, 0.0, servo.depth_mm.value / 2 - servo.lead_height_mm.value)
        # Where a lead bends over its plug, in the driver's frame, whose origin is the middle of its height.
        bend_z_mm = wing.plug_top_mm.value + wing.plug_bend_mm.value - wing.height_mm.value / 2
        # The lead also needs some slack, and the length that is in its plug.
        additional_mm = parts.wiring.slack_mm.value + parts.plugs.servo.length_mm.value
        for axle in self.car.axles:
            if not axle.driven:
                continue
            start = np.array(apply(self.mounts[axle.servo].pose, *lead_exit_mm))
            end = self._at(self.wing, (*wing.outputs.at_mm[axle.channel], bend_z_mm))
            way = self.way(start, end, axle.body, self.wing)
            available_mm, extension_name = servo.lead_length_mm.min_value, ""
            extension = self._extension_of(axle.servo)
            if extension is not None:
                available_mm = extended_mm(self.car, available_mm, extension)
                extension_name = extension.name
            output = f"{self.wing} {axle.channel}"
            lead = self._lead(axle.servo, output, "plug", way, additional_mm, available_mm)
            yield replace(lead, extension=extension_name)

    def _extension_of(self, servo: str) -> Bought | None:
        """Return the extension that is plugged onto a servo's lead, or None if there is none."""
        wired = {self.mounts[wire.a].part for wire in self.car.wires if wire.b == servo and wire.a in self.mounts}
        return next((extension for extension in self.parts.extensions.sold if extension.name in wired), None)

    def lipo(self) -> Lead:
        """Return the LiPo's lead to its socket on the Feather."""
        feather, lipo = self.parts.feather, self.of_part[self.parts.lipo.name]
        socket_mouth = self._mouth(feather, feather.battery_socket)
        # The way of the lead from each end of the LiPo. The lead leaves it at the end from which the way is shorter.
        ways_with_sides = []
        for end in _ends(lipo, self.parts.lipo):
            way = self.way(end.middle, socket_mouth, lipo.body, feather.name)
            ways_with_sides.append((way, end.side))
        shortest_way, side = min(ways_with_sides)
        # The lead also needs some slack, and the length that is in its plug.
        additional_mm = self.parts.wiring.slack_mm.value + self.parts.plugs.battery.inserted_mm.value
        available_mm = self.parts.lipo.lead_length_mm.min_value
        lead = self._lead(lipo.name, f"{feather.name} JST", "plug", shortest_way, additional_mm, available_mm)
        return replace(lead, leaves=side)

    def supply(self) -> Iterator[Lead]:
        """Yield the three leads of the servos' supply.

        The battery has a lead + to the switch and a lead - to the terminal block of the servo driver. A wire leads from
        the switch to the terminal block. The battery's leads leave it at the end from which they are shorter.
        """
        wing, switch = self.parts.featherwing, self.mounts[SERVO_SWITCH]
        battery = self.of_part[self.parts.battery.name]
        pairs = [self._battery_leads(end) for end in _ends(battery, self.parts.battery)]
        yield from min(pairs, key=lambda pair: sum(lead.needed_mm for lead in pair))
        # The wire has a soldered joint at each end.
        way = self.way(self._terminals(switch), self._mouth(wing, wing.terminal_block), switch.body, wing.name)
        joints_mm = 2 * self.parts.wiring.joint_mm.value
        yield self._lead(f"{SERVO_SWITCH} 2", f"{wing.name} terminal +", "wire", way, joints_mm)

    def _battery_leads(self, end: BatteryEnd) -> tuple[Lead, Lead]:
        """Return the leads + and - of the servos' battery if they leave it at this end."""
        parts, wing, name = self.parts, self.parts.featherwing, self.parts.battery.name
        body = self.of_part[name].body
        switch_terminals = self._terminals(self.mounts[SERVO_SWITCH])
        terminal_block = self._mouth(wing, wing.terminal_block)
        # The battery is lifted out, with its leads on, when its cells are changed. So the leads must be long enough for
        # the battery in its place and for the lifted battery.
        starts = (end.middle, end.middle + np.array((0.0, 0.0, self._battery_lift_mm())))
        plus_way = max(self.way(start, switch_terminals, body, parts.switch.name) for start in starts)
        minus_way = max(self.way(start, terminal_block, body, wing.name) for start in starts)
        joint_mm, available_mm = parts.wiring.joint_mm.value, parts.battery.lead_length_mm.min_value
        plus = self._lead(f"{name} +", f"{SERVO_SWITCH} 1", "solder", plus_way, joint_mm, available_mm)
        minus = self._lead(f"{name} -", f"{wing.name} terminal -", "solder", minus_way, joint_mm, available_mm)
        return replace(plus, leaves=end.side), replace(minus, leaves=end.side)

    def _battery_lift_mm(self) -> float:
        """Return how far (mm) the battery is lifted, with its leads on, when its cells are changed.

        It is lifted above the walls. A battery on the roof is turned over beside its place, so it is lifted by its
        height.
        """
        battery = self.of_part[self.parts.battery.name]
        bottom = battery.center_mm[2] - battery.size_mm[2] / 2
        above_walls_mm = height_mm(self.bodies[battery.body], "left") - bottom
        return max(battery.size_mm[2] if self.parts.battery_place == "roof" else 0.0, above_walls_mm)

    def controls(self) -> Iterator[Lead]:
        """Yield the wires of the board switch and of the options, such as the button.

        They are soldered beside the open car, while the boards are lifted out. So a wire needs, in addition to its way
        in the car, a length for its two joints and a length that lets the boards be lifted.
        """
        for wire in self.car.wires:
            if wire.carries == "control":
                start = self._control_start(wire.a)
                end_point = self._control_end(wire.b)
                way = self.way(start.point, end_point, start.body, self.parts.feather.name)
                joints_mm = 2 * self.parts.wiring.joint_mm.value
                yield self._lead(wire.a, wire.b, "wire", way, joints_mm + start.free_mm)

    def _control_start(self, terminal: str) -> WireStart:
        """Return where the wire at a terminal starts.

        A terminal is a contact of a switch, such as ``button 1``, a resistor, such as ``20 kΩ resistor``, or a pin of
        the Feather, such as ``Feather 27``. ``free_mm`` of the result is the additional length that is needed while the
        car is assembled.
        """
        part, _, pin = terminal.rpartition(" ")
        feather = self.of_part[self.parts.feather.name]
        if part in (BOARD_SWITCH, BUTTON):
            switch = self.mounts[part]
            # The wire stays on the boards while they are lifted, until the Feather's underside is above the walls.
            wall_top = height_mm(self.bodies[feather.body], "left")
            lift_mm = max(0.0, wall_top - feather.center_mm[2] + feather.size_mm[2] / 2)
            return WireStart(self._terminals(switch), switch.body, free_mm=lift_mm)
        # All other wires lead from the Feather, the lower board, to the wing, the upper one. The wire stays on both while
        # the Feather is screwed on and the wing is laid beside it. So it is longer by the width of the wing.
        resistors = option_resistors(self.parts)
        x, y = resistors[terminal] if terminal in resistors else self.parts.feather.pin_mm(pin)
        wing_width_mm = self.parts.featherwing.width_mm.value
        return WireStart(self._below_feather(x, y), feather.body, free_mm=wing_width_mm)

    def _control_end(self, terminal: str) -> Points:
        """Return the point where a wire ends, in the car.

        ``terminal`` is a pin of the Feather, such as ``Feather GND``, or a terminal of the wing: the + of its terminal
        block, or the net ``#OE``, for which the board has pads.
        """
        wing, feather = self.parts.featherwing, self.parts.feather
        part, _, last_word = terminal.rpartition(" ")
        if part == feather.name:
            return self._below_feather(*feather.pin_mm(last_word))
        if last_word == "+":
            x, y, z = wing.terminal_block.at_mm
        else:
            # The first of the pads is large enough to be soldered to.
            x, y = wing.output_enable.at_mm[0]
            z = wing.board_mm.value
        # Boxes are given over the board's underside. The frame of the mount is half its height above.
        return self._at(wing.name, (x, y, z - wing.height_mm.value / 2))

    def _below_feather(self, x: float, y: float) -> Points:
        """Return a point at the underside of the Feather."""
        return self._at(self.parts.feather.name, (x, y, -self.parts.feather.height_mm.value / 2))

    def _terminals(self, switch: Mount) -> Points:
        """Return the inner end of a switch, where its terminals are."""
        return np.array(apply(switch.pose, 0.0, 0.0, -switch.size_mm[2] / 2))

    def _mouth(self, board: BoxPart, box: Box) -> Points:
        """Return the middle of that side of a socket or block on a board where leads come in, at its +y."""
        x, y, z = box.at_mm
        # Boxes are given over the board's underside. The frame of the mount is half its height above.
        return self._at(board.name, (x, y + box.size_mm[1] / 2, z - board.height_mm.value / 2))

    def _at(self, part: str, point: tuple[float, float, float]) -> Points:
        """Return a point of a mount's frame in the car; ``part`` is the name of the mount's part."""
        return np.array(apply(self.of_part[part].pose, *point))

    def _lead(self, start: str, end: str, kind: LeadKind, way: Way, ends_mm: float, available_mm: float = 0.0) -> Lead:
        """Return the lead along a way. It needs slack, slack at hinges, and ``ends_mm`` for its ends.

        A wire is cut from stock, so no length of it is available.
        """
        wiring = self.parts.wiring
        with_slack = way.length_mm * (1 + wiring.slack_share.value) + way.hinges * wiring.hinge_slack_mm.value
        return Lead(start, end, kind, way.length_mm, needed_mm=with_slack + ends_mm, available_mm=available_mm)

    def way(self, start: Points, end: Points, body: str, part: str) -> Way:
        """Return the way of a lead from the point ``start`` in the segment ``body`` to the point ``end`` at a part.

        The lead runs along the axes of the car, so the differences of x, y and z add up. From segment to segment it
        passes the hinge between them, through the slits of the two caps there.
        """
        first, last = _segment_number(body), _segment_number(self.of_part[part].body)
        # Hinge i joins segment i and, behind it, segment i + 1.
        goes_rearwards = first < last
        hinges = range(first, last) if goes_rearwards else reversed(range(last, first))
        # A lead of a battery on the roof first goes to the hole in the lid.
        position = self._inside(start, body)
        length_mm = _along_axes_mm(start, position)
        for hinge in hinges:
            front_slit, rear_slit = self._slits_at(hinge)
            near_slit, far_slit = (front_slit, rear_slit) if goes_rearwards else (rear_slit, front_slit)
            length_mm += _along_axes_mm(position, near_slit) + self._max_gap_mm(hinge, front_slit, rear_slit)
            position = far_slit
        return Way(length_mm + _along_axes_mm(position, end), hinges=abs(last - first))

    def _slits_at(self, hinge: int) -> tuple[Points, Points]:
        """Return the middles of the slits in the caps before and behind a hinge."""
        front_slit = min(self._holes(f"segment{hinge}", 0), key=lambda point: float(point[0]))
        rear_slit = max(self._holes(f"segment{hinge + 1}", 0), key=lambda point: float(point[0]))
        return front_slit, rear_slit

    def _max_gap_mm(self, hinge: int, front_slit: Points, rear_slit: Points) -> float:
        """Return the largest distance of two slits beside a hinge: at the limits of the hinge, or when it is straight.

        A slit is given by its middle, an array (x, y, z) in mm.
        """
        joint = self.car.hinges[hinge]
        gaps = []
        for angle in (joint.min_rad, 0.0, joint.max_rad):
            moved_slit = np.array(apply(hinge_motion(joint, angle), *rear_slit))
            gaps.append(float(np.linalg.norm(front_slit - moved_slit)))
        return max(gaps)

    def _inside(self, start: Points, body: str) -> Points:
        """Return the point where a lead enters the body: the hole in the lid for a battery on the roof."""
        if self.parts.battery_place != "roof" or start[2] < height_mm(self.bodies[body], "left"):
            return start
        return next(self._holes(body, 2))

    def _holes(self, body: str, axis: int) -> Iterator[Points]:
        """Yield the middles of cable slits in faces across an axis."""
        for face in self.bodies[body]:
            slits = [hole for hole in face.face.holes if hole.kind == "slit"]
            if slits and abs(face.normal[axis]) > ALONG:
                yield from face.in_car([tuple(np.mean(slit.outline_mm, axis=0)) for slit in slits])
