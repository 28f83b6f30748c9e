"""How long every lead of a car must be along its way, how long it is, and the servo extensions that make up for it.

Input: a FoldedCar. Output: Leads; the car with its extensions; findings. A lead is laid along floor and walls, so that
a stretch of its way is as long as its parts along x, y and z together; from segment to segment it passes the slits of
the caps, with the hinge where these are farthest apart. Lengths are in mm, in the car's frame.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from foldcar.car.design import DesignError
from foldcar.car.folded.model import FoldedCar, Mount, Wire
from foldcar.car.folded.placed import Finding, PlacedFace, place
from foldcar.car.folded.pose import apply, translation
from foldcar.car.parts.quantity import Bought, BoxPart, PartData
from foldcar.car.proof.check_film import folded_back
from foldcar.car.proof.roles import lid_of

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
    return tuple(_Ways(car).leads()) if any(m.part == car.parts.featherwing.name for m in car.mounts) else ()


def check_leads(car: FoldedCar) -> Iterator[Finding]:
    """A finding for each lead with a plug that does not reach its socket."""
    for lead in leads(car):
        if lead.kind == "plug" and lead.missing_mm > 0:
            told = f"needs a lead of {lead.needed_mm:.0f} mm to {lead.end}, has at least {lead.there_mm:.0f} mm"
            yield Finding("leads", lead.start, told)


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
    servos, found = {axle.servo for axle in car.axles}, leads(car)
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
    parts, film, sold = car.parts, car.parts.film.thickness_mm.value, car.parts.extensions
    size = (sold.joint_length_mm.value, sold.joint_width_mm.value, sold.joint_height_mm.value)
    # z of the servo's frame points inwards; its ears lie on the wall's outside.
    wall = parts.servo.depth_mm.value / 2 - parts.servo.ear_underside_mm.value + 2 * film
    x, y, _ = apply(servo.pose, 0.0, 0.0, wall + JOINT_GAP_MM + size[1] / 2)
    faces = _segments(car)[servo.body]
    beam = next(face.piece for face in faces if face.face.name == servo.face)
    low = min(float(face.corners_mm[:, 2].min()) for face in faces if face.piece is beam and abs(face.normal[2]) > ALONG)
    pose, name = translation(x, y, low + film / 2 + size[2] / 2), f"extension of {servo.name}"
    return Mount(extension.name, name, servo.body, pose, size, extension.mass_kg.value)


def _segments(car: FoldedCar) -> dict[str, list[PlacedFace]]:
    """The faces of the segments, by body."""
    return place(replace(car, placed=tuple(one for one in car.placed if one.body.startswith("segment"))))


class _Ways:
    """Where the leads of one car start and end, and the ways between."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.parts, self.wing = car, car.parts, car.parts.featherwing.name
        self.bodies = _segments(car)
        self.mounts = {mount.name: mount for mount in car.mounts}
        self.of_part = {mount.part: mount for mount in car.mounts}
        self.order = sorted(self.bodies, key=lambda body: int(body.removeprefix("segment")))

    def leads(self) -> Iterator[Lead]:
        """All leads, servos first."""
        parts, servo, wing = self.parts, self.parts.servo, self.parts.featherwing
        plug, slack = parts.plugs.servo, parts.wiring.slack_mm.value
        leaves = (-servo.length_mm.value / 2, 0.0, servo.depth_mm.value / 2 - servo.lead_height_mm.value)
        # Where leads bend over the plugs, and the mouth of the terminal block, in the frame of the driver's box.
        up = wing.plug_top_mm.value + wing.plug_bend_mm.value - wing.height_mm.value / 2
        (x, y, z), (_, wide, _) = wing.terminal_block.at_mm, wing.terminal_block.size_mm
        block = self._at(self.wing, (x, y + wide / 2, z - wing.height_mm.value / 2))
        for axle in self.car.axles:
            start = np.array(apply(self.mounts[axle.servo].pose, *leaves))
            way, hinges = self.way(start, self._at(self.wing, (*wing.outputs.at_mm[axle.channel], up)), axle.body)
            there = servo.lead_length_mm.least
            chain = next((w.a for w in self.car.wires if w.b == axle.servo and w.a in self.mounts), "")
            extension = self.mounts[chain].part if chain else ""
            for one in (one for one in parts.extensions.sold if one.name == extension):
                there = _with(self.car, there, one)
            needed = self._with_slack(way, hinges) + slack + plug.length_mm.value
            yield Lead(axle.servo, f"{self.wing} {axle.channel}", "plug", way, needed, there, extension)
        yield from self._lipo(slack)
        yield from self._supply(block)

    def _lipo(self, slack: float) -> Iterator[Lead]:
        feather, lipo = self.parts.feather, self.of_part.get(self.parts.lipo.name)
        if lipo is None or feather.name not in self.of_part:
            return
        (x, y, z), (_, wide, _) = feather.battery_socket.at_mm, feather.battery_socket.size_mm
        mouth = self._at(feather.name, (x, y + wide / 2, z - feather.height_mm.value / 2))
        ends = self._ends(lipo, self.parts.lipo)
        (way, hinges), side = min((self.way(end, mouth, lipo.body, feather.name), side) for side, end in ends.items())
        needed = self._with_slack(way, hinges) + slack + self.parts.plugs.battery.inserted_mm.value
        there = self.parts.lipo.lead_length_mm.least
        yield Lead(lipo.name, f"{feather.name} JST", "plug", way, needed, there, leaves=side)

    def _supply(self, block: Points) -> Iterator[Lead]:
        """The battery's leads, + over the switch, and the wire from switch to terminal block."""
        parts, wing = self.parts, self.wing
        battery, switch = self.of_part.get(parts.battery.name), self.of_part.get(parts.switch.name)
        if battery is None:
            return
        joint, there = parts.wiring.joint_mm.value, parts.battery.lead_length_mm.least
        plus = (f"{wing} terminal +", block, wing)
        tails = block
        if switch is not None:
            tails = self._at(switch.name, (0.0, 0.0, -switch.size_mm[2] / 2))
            plus = (f"{switch.name} 1", tails, switch.name)
        # It is taken out for its cells with its leads on: lifted above the walls, but on the roof.
        lift = max(0.0, self._walls_mm(battery.body) - (battery.pose[2][3] - battery.size_mm[2] / 2))
        found: list[list[Lead]] = []
        for side, end in self._ends(battery, parts.battery).items():
            found.append([])
            for sign, (name, target, at) in (("+", plus), ("-", (f"{wing} terminal -", block, wing))):
                places = [end, end + np.array((0.0, 0.0, lift))]
                way, hinges = max(self.way(one, target, battery.body, at) for one in places)
                needed = self._with_slack(way, hinges) + joint
                found[-1].append(Lead(f"{battery.name} {sign}", name, "solder", way, needed, there, leaves=side))
        yield from min(found, key=lambda several: sum(lead.needed_mm for lead in several))
        if switch is not None:
            way, hinges = self.way(tails, block, switch.body, wing)
            needed = self._with_slack(way, hinges) + 2 * joint
            yield Lead(f"{switch.name} 2", f"{wing} terminal +", "wire", way, needed, 0.0)

    def _with_slack(self, way: float, hinges: int) -> float:
        wiring = self.parts.wiring
        return way * (1 + wiring.slack_share.value) + hinges * wiring.hinge_slack_mm.value

    def _at(self, part: str, point: tuple[float, float, float]) -> Points:
        return np.array(apply(self.of_part[part].pose, *point))

    @staticmethod
    def _ends(mount: Mount, battery: BoxPart) -> dict[str, Points]:
        """The middles of both ends of a battery's length, by their side of the car."""
        found, length = {}, battery.length_mm.value
        axis = min((0, 1), key=lambda i: abs(mount.size_mm[i] - length))
        for sign in (-1, 1):
            local = [0.0, 0.0, 0.0]
            local[axis] = sign * mount.size_mm[axis] / 2
            point = np.array(apply(mount.pose, *local))
            off = point - np.array([row[3] for row in mount.pose[:3]])
            along = int(np.argmax(np.abs(off[:2])))
            found[SIDES[along][int(off[along] > 0)]] = point
        return found

    def way(self, start: Points, end: Points, body: str, at: str = "") -> tuple[float, int]:
        """Length (mm) of the way from a point in ``body`` to one at the part ``at``, and how many hinges it crosses."""
        there = self.of_part[at or self.wing].body
        first, last = self.order.index(body), self.order.index(there)
        step = 1 if last > first else -1
        here = self._inside(start, body)
        length = float(np.abs(start - here).sum())
        for i in range(first, last, step):
            front, rear = self.order[min(i, i + step)], self.order[max(i, i + step)]
            slits = self._slit(front, -1), self._slit(rear, 1)
            near, far = slits if step > 0 else slits[::-1]
            hinge = next(one for one in self.car.hinges if (one.front, one.rear) == (front, rear))
            turns = (folded_back(hinge, angle) for angle in (hinge.min_rad, 0.0, hinge.max_rad))
            gap = max(float(np.linalg.norm(slits[0] - np.array(apply(turn, *slits[1])))) for turn in turns)
            length += float(np.abs(near - here).sum()) + gap
            here = far
        return length + float(np.abs(end - here).sum()), abs(last - first)

    def _inside(self, start: Points, body: str) -> Points:
        """The point where a lead enters the body: the lead's hole in the lid for a battery on the roof."""
        holes = list(self._holes(body, 2))
        if self.parts.battery_place != "roof" or start[2] < self._walls_mm(body) or not holes:
            return start
        return holes[0]

    @cached_property
    def _lids(self) -> set[tuple[str, str]]:
        """The faces of all lids, by piece and name."""
        return {(piece.name, face) for piece in self.car.pieces for face in lid_of(self.car, piece).faces}

    def _walls_mm(self, body: str) -> float:
        """The upper edge of a body's walls, over which latches of its lid stand."""
        panels = (one for one in self.bodies[body] if one.face.role == "panel")
        walls = (one for one in panels if (one.piece.name, one.face.name) not in self._lids)
        return max(float(one.corners_mm[:, 2].max()) for one in walls)

    def _slit(self, body: str, end: int) -> Points:
        """The slit of the cap at the front (1) or rear (-1) of a body; ``DesignError`` if it has none."""
        found = list(self._holes(body, 0))
        if not found:
            raise DesignError(None, f"{body} has no slit in its caps for the leads that pass it")
        return max(found, key=lambda point: end * float(point[0]))

    def _holes(self, body: str, axis: int) -> Iterator[Points]:
        """The middles of ways for cables in faces across an axis."""
        for face in self.bodies[body]:
            slits = [hole for hole in face.face.holes if hole.kind == "slit"]
            if slits and abs(face.normal[axis]) > ALONG:
                yield from face.in_car([tuple(np.mean(slit.outline_mm, axis=0)) for slit in slits])
