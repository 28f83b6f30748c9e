"""Lengths of a car's leads: needed along their ways and available; servo extensions where a lead is too short.

Input: a FoldedCar. Output: Leads; the car with its extensions. A lead is laid along floor and walls, so the length of a
stretch is the sum of its parts along x, y and z. From segment to segment it passes through the slits of the caps, whose
distance counts at the hinge angle where it is largest. Lengths are in mm, in the car's frame.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from foldcar.car.components.bridge import option_resistors
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH
from foldcar.car.design import DesignError
from foldcar.car.folded.model import FoldedCar, Mount, Wire
from foldcar.car.folded.placed import PlacedFace, place
from foldcar.car.folded.pose import apply, hinge_motion, translation
from foldcar.car.parts.quantity import Bought, BoxPart, PartData

Points = NDArray[np.float64]
# A direction counts as an axis of the car if its component along this axis is larger.
ALONG = 0.9
# Between an extension's joint and the layers of a wall (mm).
JOINT_GAP_MM = 1.0
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
    kind: Literal["plug", "solder", "wire"]
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


def with_extensions(car: FoldedCar) -> FoldedCar:
    """Return the car with an extension for each servo whose lead is too short, and with the mass of all its wire.

    Each extension is the shortest that is long enough. Raises DesignError if even the longest one is too short.
    """
    extensions, mounts = car.parts.extensions.sold, {mount.name: mount for mount in car.mounts}
    servos, car_leads = {axle.servo for axle in car.axles if axle.driven}, leads(car)
    joints: dict[str, Mount] = {}
    for lead in (lead for lead in car_leads if lead.start in servos and lead.missing_mm > 0):
        lengths = ((extension, _extended_mm(car, lead.available_mm, extension)) for extension in extensions)
        extension = next((extension for extension, length in lengths if length >= lead.needed_mm), None)
        if extension is None:
            longest_mm = _extended_mm(car, lead.available_mm, extensions[-1])
            longest = f"{longest_mm:.0f} mm with the longest extension, {extensions[-1].name}"
            message = f"the lead of the {lead.start} must be {lead.needed_mm:.0f} mm long, but is {longest}"
            raise DesignError(None, f"{message}: make the car shorter")
        joints[lead.start] = _joint(car, mounts[lead.start], extension)
    wires: list[Wire] = []
    for wire in car.wires:
        if wire.carries == "signal" and wire.b in joints:
            joint_name = joints[wire.b].name
            wires += [replace(wire, b=joint_name), Wire(joint_name, wire.b, "signal", wire.note)]
        else:
            wires.append(wire)
    wiring = car.parts.wiring
    extra_kg = extra_wire_m(car_leads, wiring) * wiring.wire_kg_m.value
    own_mounts = (replace(m, mass_kg=m.mass_kg + extra_kg) if m.part == wiring.name else m for m in car.mounts)
    return replace(car, mounts=(*own_mounts, *joints.values()), wires=tuple(wires))


def _extended_mm(car: FoldedCar, lead_mm: float, extension: Bought) -> float:
    """Return the minimum length (mm) of a lead that is plugged into an extension."""
    return lead_mm + extension.length_mm.min_value - car.parts.plugs.servo.inserted_mm.value


def _joint(car: FoldedCar, servo: Mount, extension: Bought) -> Mount:
    """Return the socket of an extension with the plug of the servo in it.

    It lies on the floor, below the servo and beside the wall of the servo.
    """
    parts, film, extensions = car.parts, car.parts.film_mm, car.parts.extensions
    size = (extensions.joint_length_mm.value, extensions.joint_width_mm.value, extensions.joint_height_mm.value)
    # z of the servo's frame points inwards; its ears lie on the wall's outside.
    wall_z = parts.servo.depth_mm.value / 2 - parts.servo.ear_underside_mm.value + 2 * film
    x, y, _ = apply(servo.pose, 0.0, 0.0, wall_z + JOINT_GAP_MM + size[1] / 2)
    z = _height_mm(_segments(car)[servo.body], "floor") + film / 2 + size[2] / 2
    name = f"extension of {servo.name}"
    return Mount(extension.name, name, servo.body, translation(x, y, z), size, extension.mass_kg.value)


def _segments(car: FoldedCar) -> dict[str, list[PlacedFace]]:
    """Return the faces of the segments, by body."""
    return place(car, {placed.body for placed in car.placed if placed.body.startswith("segment")})


def _height_mm(faces: Iterable[PlacedFace], name: str) -> float:
    """Return the greatest height of a beam's face of that name (mm)."""
    return max(float(face.corners_mm[:, 2].max()) for face in faces if face.face.name == name)


def _ends(mount: Mount, battery: BoxPart) -> Iterator[tuple[str, Points]]:
    """Yield (side, point) of both ends of a battery: "front", "rear", "left" or "right", and the end's middle (3,)."""
    axis = min((0, 1), key=lambda i: abs(mount.size_mm[i] - battery.length_mm.value))
    pose = np.array(mount.pose)
    for offset in (-pose[:3, axis] * mount.size_mm[axis] / 2, pose[:3, axis] * mount.size_mm[axis] / 2):
        along = int(np.argmax(np.abs(offset[:2])))
        yield SIDES[along][int(offset[along] > 0)], pose[:3, 3] + offset


class _Ways:
    """The starts and ends of one car's leads, and the ways between them."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.parts, self.wing = car, car.parts, car.parts.featherwing.name
        self.bodies = _segments(car)
        self.mounts = {mount.name: mount for mount in car.mounts}
        self.of_part = {mount.part: mount for mount in car.mounts}

    def servos(self) -> Iterator[Lead]:
        """Yield the servos' leads to their outputs."""
        parts, servo, wing = self.parts, self.parts.servo, self.parts.featherwing
        lead_exit_mm = (-servo.length_mm.value / 2, 0.0, servo.depth_mm.value / 2 - servo.lead_height_mm.value)
        # Where leads bend over the plugs, in the frame of the driver's box.
        bend_z_mm = wing.plug_top_mm.value + wing.plug_bend_mm.value - wing.height_mm.value / 2
        allowance_mm = parts.wiring.slack_mm.value + parts.plugs.servo.length_mm.value
        for axle in (axle for axle in self.car.axles if axle.driven):
            start = np.array(apply(self.mounts[axle.servo].pose, *lead_exit_mm))
            way = self.way(
                start, self._at(self.wing, (*wing.outputs.at_mm[axle.channel], bend_z_mm)), axle.body, self.wing
            )
            available, extension_name = servo.lead_length_mm.min_value, ""
            extension_names = [self.mounts[w.a].part for w in self.car.wires if w.b == axle.servo and w.a in self.mounts]
            for extension in (extension for extension in parts.extensions.sold if extension.name in extension_names):
                available, extension_name = _extended_mm(self.car, available, extension), extension.name
            length, needed = self._lengths_mm(way, allowance_mm)
            output = f"{self.wing} {axle.channel}"
            yield Lead(axle.servo, output, "plug", length, needed, available, extension=extension_name)

    def lipo(self) -> Lead:
        """Return the LiPo's lead to its socket on the Feather."""
        feather, lipo = self.parts.feather, self.of_part[self.parts.lipo.name]
        (x, y, z), (_, width, _) = feather.battery_socket.at_mm, feather.battery_socket.size_mm
        socket_mouth = self._at(feather.name, (x, y + width / 2, z - feather.height_mm.value / 2))
        ends = _ends(lipo, self.parts.lipo)
        way, side = min((self.way(end, socket_mouth, lipo.body, feather.name), side) for side, end in ends)
        allowance_mm = self.parts.wiring.slack_mm.value + self.parts.plugs.battery.inserted_mm.value
        available = self.parts.lipo.lead_length_mm.min_value
        lengths_mm = self._lengths_mm(way, allowance_mm)
        return Lead(lipo.name, f"{feather.name} JST", "plug", *lengths_mm, available, leaves=side)

    def supply(self) -> Iterator[Lead]:
        """Yield the leads of the battery, + to the switch and - to the terminal block, and the wire between these two."""
        parts, wing = self.parts, self.parts.featherwing
        battery, switch = self.of_part[parts.battery.name], self.mounts[SERVO_SWITCH]
        joint, available = parts.wiring.joint_mm.value, parts.battery.lead_length_mm.min_value
        (x, y, z), (_, width, _) = wing.terminal_block.at_mm, wing.terminal_block.size_mm
        block = self._at(wing.name, (x, y + width / 2, z - wing.height_mm.value / 2))
        tails = self._terminals(switch)
        connections = (
            ("+", f"{SERVO_SWITCH} 1", tails, parts.switch.name),
            ("-", f"{wing.name} terminal -", block, wing.name),
        )
        # To change cells, the battery is lifted above the walls with its leads on, so these reach both places. One on the
        # roof is turned over.
        wall_top = _height_mm(self.bodies[battery.body], "left")
        min_lift = battery.size_mm[2] if parts.battery_place == "roof" else 0.0
        lift = np.array((0.0, 0.0, max(min_lift, wall_top - (battery.pose[2][3] - battery.size_mm[2] / 2))))
        by_side: list[list[Lead]] = []
        for side, end in _ends(battery, parts.battery):
            by_side.append([])
            for sign, name, target, part in connections:
                # The longer one of the ways from the battery in its place and from the lifted battery.
                way = max(self.way(start, target, battery.body, part) for start in (end, end + lift))
                lengths_mm = self._lengths_mm(way, joint)
                by_side[-1].append(Lead(f"{battery.name} {sign}", name, "solder", *lengths_mm, available, leaves=side))
        # The leads leave the battery on the side from which they are shorter.
        yield from min(by_side, key=lambda pair: sum(lead.needed_mm for lead in pair))
        lengths_mm = self._lengths_mm(self.way(tails, block, switch.body, wing.name), 2 * joint)
        # A wire is cut from stock: it has no length of its own.
        yield Lead(f"{SERVO_SWITCH} 2", f"{wing.name} terminal +", "wire", *lengths_mm, available_mm=0.0)

    def controls(self) -> Iterator[Lead]:
        """Yield the wires of the board switch and of the options.

        They are soldered beside the open car, while the boards are lifted out.
        """
        feather, wing = self.parts.feather.name, self.parts.featherwing
        for wire in (wire for wire in self.car.wires if wire.carries == "control"):
            name = wire.a.rpartition(" ")[0]
            if name in (BOARD_SWITCH, BUTTON):
                start, body, lift_mm = self._terminals(self.mounts[name]), self.mounts[name].body, self._lift_mm(feather)
            else:
                # Between the boards: the wing can be laid beside the Feather while that is screwed on.
                x, y = option_resistors(self.parts).get(wire.a) or self.parts.feather.pin_mm(wire.a.rpartition(" ")[2])
                start, body, lift_mm = self._below_feather(x, y), self.of_part[feather].body, wing.width_mm.value
            if wire.b.startswith(feather):
                end = self._below_feather(*self.parts.feather.pin_mm(wire.b.rpartition(" ")[2]))
            else:
                # The terminal block, or the pad of #OE that is large enough to be soldered to.
                enable = (*wing.output_enable.at_mm[0], wing.board_mm.value)
                at = wing.terminal_block.at_mm if wire.b.endswith("+") else enable
                end = self._at(wing.name, (*at[:2], at[2] - wing.height_mm.value / 2))
            way = self.way(start, end, body, feather)
            lengths_mm = self._lengths_mm(way, 2 * self.parts.wiring.joint_mm.value + lift_mm)
            yield Lead(wire.a, wire.b, "wire", *lengths_mm, available_mm=0.0)

    def _below_feather(self, x: float, y: float) -> Points:
        """Return a point at the underside of the Feather."""
        return self._at(self.parts.feather.name, (x, y, -self.parts.feather.height_mm.value / 2))

    def _terminals(self, switch: Mount) -> Points:
        """Return the inner end of a switch, where its terminals are."""
        return np.array(apply(switch.pose, 0.0, 0.0, -switch.size_mm[2] / 2))

    def _lift_mm(self, part: str) -> float:
        """Return the height (mm) by which a part is lifted out of the car, above its walls."""
        mount = self.of_part[part]
        return max(0.0, _height_mm(self.bodies[mount.body], "left") - mount.pose[2][3] + mount.size_mm[2] / 2)

    def _lengths_mm(self, way: tuple[float, int], ends_mm: float) -> tuple[float, float]:
        """Return the length of a way (mm), and that of the lead along it, with slack and ``ends_mm`` for its ends.

        ``way`` is the length of the way (mm) and its number of hinges.
        """
        wiring, (length, hinges) = self.parts.wiring, way
        with_slack = length * (1 + wiring.slack_share.value) + hinges * wiring.hinge_slack_mm.value
        return length, with_slack + ends_mm

    def _at(self, part: str, point: tuple[float, float, float]) -> Points:
        return np.array(apply(self.of_part[part].pose, *point))

    def way(self, start: Points, end: Points, body: str, part: str) -> tuple[float, int]:
        """Return the length (mm) of the way of a lead, and the number of hinges that it passes.

        The lead goes from a point in ``body`` to a point at ``part``. At a hinge it goes through the slits of the
        caps. Within a segment it runs along the axes of the car, so the differences of x, y and z add up.
        """
        first, last = (int(name.removeprefix("segment")) for name in (body, self.of_part[part].body))
        position = self._inside(start, body)
        length = float(np.abs(start - position).sum())
        for i in range(first, last) if first < last else range(first - 1, last - 1, -1):
            # The slits in the caps before and behind the hinge: the rearmost hole of the front segment, the foremost of
            # the rear segment.
            slits = [min(self._holes(f"segment{i}", 0), key=lambda point: float(point[0])),
                     max(self._holes(f"segment{i + 1}", 0), key=lambda point: float(point[0]))]  # fmt: skip
            hinge = self.car.hinges[i]
            # The largest gap between the slits counts, at the hinge's limits and when it is straight.
            motions = (hinge_motion(hinge, angle) for angle in (hinge.min_rad, 0.0, hinge.max_rad))
            gap = max(float(np.linalg.norm(slits[0] - np.array(apply(turn, *slits[1])))) for turn in motions)
            own_slit, other_slit = slits if first < last else slits[::-1]
            length += float(np.abs(own_slit - position).sum()) + gap
            position = other_slit
        return length + float(np.abs(end - position).sum()), abs(last - first)

    def _inside(self, start: Points, body: str) -> Points:
        """Return the point where a lead enters the body: the hole in the lid for a battery on the roof."""
        if self.parts.battery_place != "roof" or start[2] < _height_mm(self.bodies[body], "left"):
            return start
        return next(self._holes(body, 2))

    def _holes(self, body: str, axis: int) -> Iterator[Points]:
        """Yield the middles of cable slits in faces across an axis."""
        for face in self.bodies[body]:
            slits = [hole for hole in face.face.holes if hole.kind == "slit"]
            if slits and abs(face.normal[axis]) > ALONG:
                yield from face.in_car([tuple(np.mean(slit.outline_mm, axis=0)) for slit in slits])
