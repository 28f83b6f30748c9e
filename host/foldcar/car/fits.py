"""The worst case of every fit between a bought part and the film around it, or another part.

Input: a FoldedCar. Output: Fits: the room at nominal sizes, measured on the folded car or taken from the parts' data,
and what the tolerances of the parts and of the cutter take of it at most. Findings where none is left.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import FoldedCar, Hole, Mount, Point
from foldcar.car.folded.placed import Finding, place
from foldcar.car.folded.pose import compose
from foldcar.car.parts.bought import Screw
from foldcar.car.parts.quantity import PartData, Quantity

Points = NDArray[np.float64]
ROUNDING_MM = 1e-6


@dataclass(frozen=True, slots=True)
class Fit:
    """``nominal_mm`` is the room at nominal sizes; ``parts_mm`` and ``cutter_mm`` the most that tolerances take of it."""

    name: str
    nominal_mm: float
    parts_mm: float
    cutter_mm: float

    @property
    def worst_mm(self) -> float:
        """The room that is left in the worst case, negative if the parts do not fit then."""
        return self.nominal_mm - self.parts_mm - self.cutter_mm


def check_fits(car: FoldedCar) -> Iterator[Finding]:
    """A finding for each fit without room in the worst case."""
    for fit in fits(car):
        if fit.worst_mm < -ROUNDING_MM:
            took = f"of {fit.nominal_mm:.2f} mm parts take {fit.parts_mm:.2f} mm, the cutter {fit.cutter_mm:.2f} mm"
            yield Finding("fit", fit.name, f"lacks {-fit.worst_mm:.2f} mm in the worst case: {took}")


def fits(car: FoldedCar) -> tuple[Fit, ...]:
    """The fits of a car, of each kind the tightest one."""
    least: dict[str, Fit] = {}
    measured = _Measured(car)
    for some in (_servos, _wheels, _boards, _switch, _lipo, _under_lid, _tongues):
        for fit in some(measured):
            if fit.name not in least or fit.worst_mm < least[fit.name].worst_mm:
                least[fit.name] = fit
    return tuple(least.values())


class _Measured:
    """A car's holes and faces, and how far a cut may be off."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.parts, self.bodies = car, car.parts, place(car)
        self.cut = car.parts.assembly.cut_mm.value
        self.holes = {hole.name: hole for piece in car.pieces for face in piece.faces for hole in face.holes}

    def mounts(self, part: PartData) -> list[Mount]:
        """The mounts of a part."""
        return [mount for mount in self.car.mounts if mount.part == part.name]

    def called(self, name: str) -> list[Hole]:
        """The holes of that name in their component."""
        return [hole for path, hole in self.holes.items() if path.rpartition(".")[2].startswith(name)]

    def inside(self, name: str, room: float, part: Quantity) -> Fit:
        """A part between two cuts."""
        return Fit(name, room - part.value, part.tolerance, 2 * self.cut)

    def thread(self, name: str, screw: Screw, films: int, between: Sequence[Quantity]) -> Fit:
        """A screw that passes films and other things and a nut."""
        nut = [screw.nut_height_mm] if screw.nut_height_mm else []
        held = [*between, *nut, *[self.parts.film.thickness_mm] * films]
        return Fit(name, screw.length_mm.value - sum(one.value for one in held), _sum(screw.length_mm, *held), 0.0)


def _servos(car: _Measured) -> Iterator[Fit]:
    servo, screw = car.parts.servo, car.parts.screw
    for mount in car.mounts(servo):
        opening = car.holes[mount.holes[0]]
        # The notches for the screws reach beyond the body's ends, but not at its long sides.
        span, width = _size(opening)
        far = max(y for _, y in opening.outline_mm)
        length = float(np.ptp([x for x, y in opening.outline_mm if far - y < ROUNDING_MM]))
        yield car.inside("servo's length in its opening", length, servo.length_mm)
        yield car.inside("servo's width in its opening", width, servo.width_mm)
        reach = span / 2 + (servo.screw_hole_mm.value - screw.diameter_mm.value) / 2
        taken = _sum(servo.screw_spacing_mm, servo.screw_hole_mm) / 2 + screw.diameter_mm.tolerance
        # If the holes are nearer to each other, the ears' own slots, which are open outwards, take the screws.
        room = reach - (servo.screw_spacing_mm.value + screw.diameter_mm.value) / 2
        yield Fit("servo's screws, farther apart, in wall and ears", room, taken, car.cut)
    yield _less("screws in the servo's ears", servo.screw_hole_mm, screw.diameter_mm)
    yield car.thread("servo's screws, as long as nuts ask for", screw, 2, (servo.ear_thickness_mm,))


def _wheels(car: _Measured) -> Iterator[Fit]:
    horn, screw = car.parts.horn, car.parts.horn_screw.diameter_mm
    for hole in car.called("horn screw"):
        # The slots lie towards the axle, the disc's origin.
        long, wide = _size(hole, hole.center_mm or (1.0, 0.0))
        taken = 2 * horn.wheel_screws.tolerance + screw.tolerance
        yield Fit("wheel's screws along their slots", long - screw.value, taken, 2 * car.cut)
        yield car.inside("wheel's screws across their slots", wide, screw)
    for hole in car.called("hub"):
        yield car.inside("centre screw's head in the disc", _size(hole)[0], car.parts.centre_screw.head_diameter_mm)


def _boards(car: _Measured) -> Iterator[Fit]:
    parts, screw = car.parts, car.parts.board_screw
    feather, spacer, pad, usb = parts.feather, parts.spacer, parts.board_pad, parts.plugs.usb
    drilled = feather.holes[0]
    for name in (name for mount in car.mounts(feather) for name in mount.holes):
        room = (_size(car.holes[name])[0] + drilled.diameter_mm) / 2 - screw.diameter_mm.value
        taken = 1.5 * drilled.tolerance + screw.diameter_mm.tolerance
        yield Fit("boards' screws in bridge and Feather", room, taken, 2 * car.cut)
    yield _less("boards' screws in their spacers", spacer.hole_mm, screw.diameter_mm)
    yield car.thread("boards' screws, as long as nuts ask for", screw, 1, (spacer.length_mm, feather.board_mm))
    yield _less("foam pad pressed under the Feather", pad.height_mm, spacer.length_mm)
    diagonal = math.hypot(usb.width_mm.value, usb.thickness_mm.value)
    # What is off by some height counts twice in a diameter; the hole and the bridge's legs are cut.
    taken = math.hypot(usb.width_mm.most, usb.thickness_mm.most) - diagonal
    taken += 2 * (feather.usb.tolerance + spacer.length_mm.tolerance)
    for hole in car.called("USB"):
        yield Fit("USB plug in its hole", _size(hole)[0] - diagonal, taken, 4 * car.cut)


def _switch(car: _Measured) -> Iterator[Fit]:
    switch, film = car.parts.switch, car.parts.film.thickness_mm
    for mount in car.mounts(switch):
        slot = _size(car.holes[mount.holes[0]])
        body, bezel = (switch.body_length_mm, switch.body_width_mm), (switch.length_mm, switch.width_mm)
        for room, part, over in zip(slot, body, bezel, strict=True):
            yield car.inside("switch's body in its slot", room, part)
            yield Fit("switch's bezel over its slot", over.value - room, over.tolerance, 2 * car.cut)
        holes = [(piece, hole) for piece in car.car.pieces for face in piece.faces for hole in face.holes]
        count = sum(piece.count for piece, hole in holes if math.dist(_size(hole), slot) < ROUNDING_MM)
        least, tape = switch.panel_least_mm, car.parts.assembly.tape_mm
        thick = count * film.value + (count - 1) * tape.value
        taken = count * film.tolerance + (count - 1) * tape.tolerance + least.tolerance
        yield Fit("switch's barbs behind layers of film", thick - least.value, taken, 0.0)


def _lipo(car: _Measured) -> Iterator[Fit]:
    """The LiPo is laid into its outline, below the bridge, with the bridge's flange and feet beside it."""
    lipo, film, laid = car.parts.lipo, car.parts.film_mm, car.parts.assembly.placement_mm.value
    for mount in car.mounts(lipo):
        bridge = {face.face.name: face.corners_mm for face in car.bodies[mount.body] if face.piece.name == "bridge"}

        def gap(face: str, axis: int, mount: Mount = mount, bridge: dict[str, Points] = bridge) -> float:
            return float(np.abs(bridge[face][:, axis] - mount.pose[axis][3]).min()) - mount.half_mm(axis)

        # The feet lie beside it, with their edges towards it; of shelf and flange it meets a side.
        yield Fit("LiPo below the bridge", gap("shelf", 2) - film / 2, lipo.height_mm.tolerance, car.cut)
        beside, taken = gap("flange", 0) - film / 2, lipo.width_mm.tolerance / 2 + laid
        yield Fit("LiPo beside the bridge's flange", beside, taken, car.cut)
        feet = min(gap(f"{side} foot", 1) for side in ("left", "right"))
        yield Fit("LiPo between the bridge's feet", feet, lipo.length_mm.tolerance / 2 + laid, 2 * car.cut)


def _under_lid(car: _Measured) -> Iterator[Fit]:
    """The battery between the walls, and what is as high as the lid."""
    parts, wing, battery, film = car.parts, car.parts.featherwing, car.parts.battery, car.parts.film_mm
    for mount in (*car.mounts(battery), *car.mounts(wing)):
        walls = np.concatenate([one.corners_mm for one in car.bodies[mount.body] if one.face.role == "panel"])
        # The height of the highest of its upright solids.
        top = max(compose(mount.pose, one.pose)[2][3] + one.size_mm[2] / 2 for one in mount.shape)
        up = float(walls[:, 2].max()) - film / 2 - top
        if mount.part == wing.name:
            taken = _sum(wing.gap_mm, wing.plug_top_mm, parts.feather.board_mm, wing.board_mm, parts.spacer.length_mm)
            yield Fit("servo leads' bend under the lid", up + wing.plug_bend_mm.value, taken, 2 * car.cut)
        elif up > 0:
            across = battery.length_mm if mount.size_mm[1] == battery.length_mm.value else battery.width_mm
            room = float(np.ptp(walls[:, 1])) - film - 2 * mount.half_mm(1)
            yield Fit(f"{battery.name} between the walls", room, across.tolerance, 2 * car.cut)
            yield Fit(f"{battery.name} under the lid", up, _sum(battery.height_mm, parts.pad.height_mm), 2 * car.cut)


def _tongues(car: _Measured) -> Iterator[Fit]:
    """The beam's and the bridge's tongues; those of wheels turn in their slots."""
    turning = {one.piece for one in car.car.placed if one.body.startswith("wheel")}
    joins = (join for join in car.car.joins if join.kind in ("lock", "tab_slot") and join.piece_a not in turning)
    for join in (join for join in joins if join.slot in car.holes):
        wide, long = sorted(_size(car.holes[join.slot or ""]))
        yield Fit("tongues along their slots", long - join.length_mm, 0.0, 4 * car.cut)
        yield car.inside("tongues' film across their slots", wide, car.parts.film.thickness_mm)


def _less(name: str, outer: Quantity, inner: Quantity) -> Fit:
    return Fit(name, outer.value - inner.value, outer.tolerance + inner.tolerance, 0.0)


def _sum(*several: Quantity) -> float:
    return sum(one.tolerance for one in several)


def _size(hole: Hole, along: Point = (1.0, 0.0)) -> Point:
    """The extent of a hole along a direction of its face and across it (mm)."""
    way = np.array(along) / math.hypot(*along)
    x, y = np.ptp(np.array(hole.outline_mm) @ np.array([way, (-way[1], way[0])]).T, axis=0)
    return float(x), float(y)
