"""How long every lead of a car must be along its way, how long it is, and the servo extensions that make up for it.

Input: a FoldedCar. Output: Leads; the car with its extensions. A lead is laid along floor and walls, so that
a stretch of its way is as long as its parts along x, y and z together; from segment to segment it passes the slits of
the caps, with the hinge where these are farthest apart. Lengths are in mm, in the car's frame.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from foldcar.car.design import DesignError
from foldcar.car.folded.model import FoldedCar, Mount, Wire
from foldcar.car.folded.placed import PlacedFace, place
from foldcar.car.folded.pose import apply, folded_back, translation
from foldcar.car.parts.quantity import Bought, BoxPart, PartData

Points = NDArray[np.float64]
# A direction's component along an axis of the car from which on it counts as that axis.
ALONG = 0.9
# Between an extension's joint and the layers of a wall (mm).
JOINT_GAP_MM = 1.0
SIDES = (("rear", "front"), ("right", "left"))


@dataclass(frozen=True, slots=True)
class Lead:
    """``way_mm`` from ``start`` to ``end``, ``needed_mm`` with slack and joints, ``there_mm`` at least by its data.

    ``kind`` tells what is done if it is too short: "plug" leads take an extension, if they are servos', "solder" leads
    are lengthened; a "wire" is cut from stock and has no length of its own. ``leaves`` is the side of a battery at
    which its leads lie.
    """

    start: str
    end: str
    kind: Literal["plug", "solder", "wire"]
    way_mm: float
    needed_mm: float
    there_mm: float
    extension: str = ""
    leaves: str = ""

    @property
    def missing_mm(self) -> float:
        """How much is missing, 0 if it is long enough."""
        return max(0.0, self.needed_mm - self.there_mm)


def leads(car: FoldedCar) -> tuple[Lead, ...]:
    """The leads of all servos and batteries and the wires of the switch; none of a car without a servo driver."""
    if not any(mount.part == car.parts.featherwing.name for mount in car.mounts):
        return ()
    ways = _Ways(car)
    return (*ways.servos(), ways.lipo(), *ways.supply())


def wire_mm(several: Iterable[Lead]) -> float:
    """The length of wire (mm) that is cut from stock: the switch's wire and what lengthens the battery's leads."""
    return sum(lead.missing_mm for lead in several if lead.kind != "plug")


def more_wire_m(several: Iterable[Lead], wiring: PartData) -> float:
    """The length of wire (m) beyond that which the wiring's mass and cost include."""
    return max(0.0, wire_mm(several) - wiring.wire_mm.value) / 1000


def with_leads(car: FoldedCar) -> FoldedCar:
    """The car with an extension for each servo whose lead is too short, and with the mass of all its wire.

    DesignError if none is long enough.
    """
    sold, mounts = car.parts.extensions.sold, {mount.name: mount for mount in car.mounts}
    servos, found = {axle.servo for axle in car.axles if axle.driven}, leads(car)
    added: dict[str, Mount] = {}
    for lead in (one for one in found if one.start in servos and one.missing_mm > 0):
        extension = next((one for one in sold if _with(car, lead.there_mm, one) >= lead.needed_mm), None)
        if extension is None:
            longest = f"{_with(car, lead.there_mm, sold[-1]):.0f} mm with the longest extension, {sold[-1].name}"
            told = f"the lead of the {lead.start} must be {lead.needed_mm:.0f} mm long, but is {longest}"
            raise DesignError(None, f"{told}: make the car shorter")
        added[lead.start] = _joint(car, mounts[lead.start], extension)
    wires: list[Wire] = []
    for wire in car.wires:
        if wire.carries == "signal" and wire.b in added:
            name = added[wire.b].name
            wires += [replace(wire, b=name), Wire(name, wire.b, "signal", wire.note)]
        else:
            wires.append(wire)
    wiring = car.parts.wiring
    more_kg = more_wire_m(found, wiring) * wiring.wire_kg_m.value
    heavier = (replace(m, mass_kg=m.mass_kg + more_kg) if m.part == wiring.name else m for m in car.mounts)
    return replace(car, mounts=(*heavier, *added.values()), wires=tuple(wires))


def _with(car: FoldedCar, lead_mm: float, extension: Bought) -> float:
    """The least length (mm) of a lead that is plugged into an extension."""
    return lead_mm + extension.length_mm.least - car.parts.plugs.servo.inserted_mm.value


def _joint(car: FoldedCar, servo: Mount, extension: Bought) -> Mount:
    """An extension's socket with the servo's plug in it, on the floor under the servo, beside its wall."""
    parts, film, sold = car.parts, car.parts.film_mm, car.parts.extensions
    size = (sold.joint_length_mm.value, sold.joint_width_mm.value, sold.joint_height_mm.value)
    # z of the servo's frame points inwards; its ears lie on the wall's outside.
    wall = parts.servo.depth_mm.value / 2 - parts.servo.ear_underside_mm.value + 2 * film
    x, y, _ = apply(servo.pose, 0.0, 0.0, wall + JOINT_GAP_MM + size[1] / 2)
    up = _height_mm(_segments(car)[servo.body], "floor") + film / 2 + size[2] / 2
    name = f"extension of {servo.name}"
    return Mount(extension.name, name, servo.body, translation(x, y, up), size, extension.mass_kg.value)


def _segments(car: FoldedCar) -> dict[str, list[PlacedFace]]:
    """The faces of the segments, by body."""
    return place(car, {one.body for one in car.placed if one.body.startswith("segment")})


def _height_mm(faces: Iterable[PlacedFace], name: str) -> float:
    """The greatest height of a beam's face of that name (mm)."""
    return max(float(face.corners_mm[:, 2].max()) for face in faces if face.face.name == name)


def _ends(mount: Mount, battery: BoxPart) -> Iterator[tuple[str, Points]]:
    """The middles of both ends of a battery's length, with their side of the car."""
    axis = min((0, 1), key=lambda i: abs(mount.size_mm[i] - battery.length_mm.value))
    pose = np.array(mount.pose)
    for off in (-pose[:3, axis] * mount.size_mm[axis] / 2, pose[:3, axis] * mount.size_mm[axis] / 2):
        along = int(np.argmax(np.abs(off[:2])))
        yield SIDES[along][int(off[along] > 0)], pose[:3, 3] + off


class _Ways:
    """Where the leads of one car start and end, and the ways between."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.parts, self.wing = car, car.parts, car.parts.featherwing.name
        self.bodies = _segments(car)
        self.mounts = {mount.name: mount for mount in car.mounts}
        self.of_part = {mount.part: mount for mount in car.mounts}

    def servos(self) -> Iterator[Lead]:
        """The leads of the servos, to their outputs."""
        parts, servo, wing = self.parts, self.parts.servo, self.parts.featherwing
        leaves = (-servo.length_mm.value / 2, 0.0, servo.depth_mm.value / 2 - servo.lead_height_mm.value)
        # Where leads bend over the plugs, in the frame of the driver's box.
        up = wing.plug_top_mm.value + wing.plug_bend_mm.value - wing.height_mm.value / 2
        ends = parts.wiring.slack_mm.value + parts.plugs.servo.length_mm.value
        for axle in (axle for axle in self.car.axles if axle.driven):
            start = np.array(apply(self.mounts[axle.servo].pose, *leaves))
            way = self.way(start, self._at(self.wing, (*wing.outputs.at_mm[axle.channel], up)), axle.body, self.wing)
            there, extension = servo.lead_length_mm.least, ""
            chained = [self.mounts[w.a].part for w in self.car.wires if w.b == axle.servo and w.a in self.mounts]
            for one in (one for one in parts.extensions.sold if one.name in chained):
                there, extension = _with(self.car, there, one), one.name
            length, needed = self._needed(way, ends)
            yield Lead(axle.servo, f"{self.wing} {axle.channel}", "plug", length, needed, there, extension)

    def lipo(self) -> Lead:
        """The LiPo's lead, to its socket on the Feather."""
        feather, lipo = self.parts.feather, self.of_part[self.parts.lipo.name]
        (x, y, z), (_, wide, _) = feather.battery_socket.at_mm, feather.battery_socket.size_mm
        mouth = self._at(feather.name, (x, y + wide / 2, z - feather.height_mm.value / 2))
        ends = _ends(lipo, self.parts.lipo)
        way, side = min((self.way(end, mouth, lipo.body, feather.name), side) for side, end in ends)
        ends_mm = self.parts.wiring.slack_mm.value + self.parts.plugs.battery.inserted_mm.value
        there = self.parts.lipo.lead_length_mm.least
        return Lead(lipo.name, f"{feather.name} JST", "plug", *self._needed(way, ends_mm), there, leaves=side)

    def supply(self) -> Iterator[Lead]:
        """The battery's leads, + over the switch, and the wire from switch to terminal block."""
        parts, wing = self.parts, self.parts.featherwing
        battery, switch = self.of_part[parts.battery.name], self.of_part[parts.switch.name]
        joint, there = parts.wiring.joint_mm.value, parts.battery.lead_length_mm.least
        (x, y, z), (_, wide, _) = wing.terminal_block.at_mm, wing.terminal_block.size_mm
        block = self._at(wing.name, (x, y + wide / 2, z - wing.height_mm.value / 2))
        tails = self._at(switch.name, (0.0, 0.0, -switch.size_mm[2] / 2))
        targets = (("+", f"{switch.name} 1", tails, switch.name), ("-", f"{wing.name} terminal -", block, wing.name))
        # It is taken out for its cells with its leads on: lifted above the walls, but on the roof.
        walls = _height_mm(self.bodies[battery.body], "left")
        lift = np.array((0.0, 0.0, max(0.0, walls - (battery.pose[2][3] - battery.size_mm[2] / 2))))
        found: list[list[Lead]] = []
        for side, end in _ends(battery, parts.battery):
            found.append([])
            for sign, name, target, at in targets:
                way = max(self.way(one, target, battery.body, at) for one in (end, end + lift))
                needed = self._needed(way, joint)
                found[-1].append(Lead(f"{battery.name} {sign}", name, "solder", *needed, there, leaves=side))
        yield from min(found, key=lambda several: sum(lead.needed_mm for lead in several))
        needed = self._needed(self.way(tails, block, switch.body, wing.name), 2 * joint)
        yield Lead(f"{switch.name} 2", f"{wing.name} terminal +", "wire", *needed, 0.0)

    def _needed(self, way: tuple[float, int], ends_mm: float) -> tuple[float, float]:
        """The length of a way, and that of its lead with slack and what its ends take."""
        wiring, (length, hinges) = self.parts.wiring, way
        slack = length * (1 + wiring.slack_share.value) + hinges * wiring.hinge_slack_mm.value
        return length, slack + ends_mm

    def _at(self, part: str, point: tuple[float, float, float]) -> Points:
        return np.array(apply(self.of_part[part].pose, *point))

    def way(self, start: Points, end: Points, body: str, at: str) -> tuple[float, int]:
        """Length (mm) of the way from a point in ``body`` to one at the part ``at``, and how many hinges it crosses."""
        first, last = (int(one.removeprefix("segment")) for one in (body, self.of_part[at].body))
        here = self._inside(start, body)
        length = float(np.abs(start - here).sum())
        for i in range(first, last) if first < last else range(first - 1, last - 1, -1):
            # The slits at the rear of the segment before the hinge and at the front of the one behind it.
            slits = [min(self._holes(f"segment{i}", 0), key=lambda point: float(point[0])),
                     max(self._holes(f"segment{i + 1}", 0), key=lambda point: float(point[0]))]  # fmt: skip
            hinge = self.car.hinges[i]
            turns = (folded_back(hinge, angle) for angle in (hinge.min_rad, 0.0, hinge.max_rad))
            gap = max(float(np.linalg.norm(slits[0] - np.array(apply(turn, *slits[1])))) for turn in turns)
            near, far = slits if first < last else slits[::-1]
            length += float(np.abs(near - here).sum()) + gap
            here = far
        return length + float(np.abs(end - here).sum()), abs(last - first)

    def _inside(self, start: Points, body: str) -> Points:
        """The point where a lead enters the body: the lead's hole in the lid for a battery on the roof."""
        if self.parts.battery_place != "roof" or start[2] < _height_mm(self.bodies[body], "left"):
            return start
        return next(self._holes(body, 2))

    def _holes(self, body: str, axis: int) -> Iterator[Points]:
        """The middles of ways for cables in faces across an axis."""
        for face in self.bodies[body]:
            slits = [hole for hole in face.face.holes if hole.kind == "slit"]
            if slits and abs(face.normal[axis]) > ALONG:
                yield from face.in_car([tuple(np.mean(slit.outline_mm, axis=0)) for slit in slits])
