"""The worst case of every fit between a bought part and the film around it, or another part.

Input: a FoldedCar. Output: Fits: the room at nominal sizes, measured on the folded car or taken from the parts' data,
and what the tolerances of the parts and of the cutter take of it at most. Findings where none is left.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from foldcar.car.folded.model import FoldedCar, Hole, Mount, Point
from foldcar.car.folded.placed import Finding, PlacedFace, place
from foldcar.car.folded.pose import compose
from foldcar.car.parts.bought import Screw
from foldcar.car.parts.quantity import Quantity

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
    for some in (_servos, _wheels, _boards, _switch, _inside, _tongues):
        for fit in some(measured):
            if fit.name not in least or fit.worst_mm < least[fit.name].worst_mm:
                least[fit.name] = fit
    return tuple(least.values())


class _Measured:
    """A car's holes and mounts by name, and how far a cut may be off."""

    def __init__(self, car: FoldedCar) -> None:
        self.car, self.parts = car, car.parts
        self.cut = car.parts.assembly.cut_mm.value
        self.holes = {hole.name: hole for piece in car.pieces for face in piece.faces for hole in face.holes}

    def mounts(self, part: str) -> list[Mount]:
        """The mounts of a part."""
        return [mount for mount in self.car.mounts if mount.part == part]

    def called(self, name: str) -> list[Hole]:
        """The holes of that name in their component."""
        return [hole for path, hole in self.holes.items() if path.rpartition(".")[2].startswith(name)]


def _servos(car: _Measured) -> Iterator[Fit]:
    servo, screw = car.parts.servo, car.parts.screw
    for mount in car.mounts(servo.name):
        opening = car.holes[mount.holes[0]]
        # The notches for the screws reach beyond the body's ends, but not at its long sides.
        span, width = _size(opening)
        far = max(y for _, y in opening.outline_mm)
        length = float(np.ptp([x for x, y in opening.outline_mm if far - y < ROUNDING_MM]))
        for size, part, way in zip((length, width), (servo.length_mm, servo.width_mm), ("length", "width"), strict=True):
            yield Fit(f"servo's {way} in its opening", size - part.value, part.tolerance, 2 * car.cut)
        reach = span / 2 + (servo.screw_hole_mm.value - screw.diameter_mm.value) / 2
        taken = (servo.screw_spacing_mm.tolerance + servo.screw_hole_mm.tolerance) / 2 + screw.diameter_mm.tolerance
        # If the holes are nearer to each other, the ears' own slots, which are open outwards, take the screws.
        room = reach - (servo.screw_spacing_mm.value + screw.diameter_mm.value) / 2
        yield Fit("servo's screws, farther apart, in wall and ears", room, taken, car.cut)
    yield _less("screws in the servo's ears", servo.screw_hole_mm, screw.diameter_mm)
    yield _thread(car, "servo's screws, as long as nuts ask for", screw, 2, (servo.ear_thickness_mm,))


def _wheels(car: _Measured) -> Iterator[Fit]:
    horn, screw, head = car.parts.horn, car.parts.horn_screw.diameter_mm, car.parts.centre_screw.head_diameter_mm
    for hole in car.called("horn screw"):
        # The slots lie towards the axle, the disc's origin.
        long, wide = _size(hole, hole.center_mm or (1.0, 0.0))
        taken = 2 * horn.wheel_screws.tolerance + screw.tolerance
        yield Fit("wheel's screws along their slots", long - screw.value, taken, 2 * car.cut)
        yield Fit("wheel's screws across their slots", wide - screw.value, screw.tolerance, 2 * car.cut)
    for hole in car.called("hub"):
        yield Fit("centre screw's head in the disc", _size(hole)[0] - head.value, head.tolerance, 2 * car.cut)


def _boards(car: _Measured) -> Iterator[Fit]:
    parts, screw = car.parts, car.parts.board_screw
    feather, spacer, pad, usb = parts.feather, parts.spacer, parts.board_pad, parts.plugs.usb
    drilled = feather.holes[0]
    for name in (name for mount in car.mounts(feather.name) for name in mount.holes):
        room = (_size(car.holes[name])[0] + drilled.diameter_mm) / 2 - screw.diameter_mm.value
        taken = 1.5 * drilled.tolerance + screw.diameter_mm.tolerance
        yield Fit("boards' screws in bridge and Feather", room, taken, 2 * car.cut)
    yield _less("boards' screws in their spacers", spacer.hole_mm, screw.diameter_mm)
    yield _thread(car, "boards' screws, as long as nuts ask for", screw, 1, (spacer.length_mm, feather.board_mm))
    yield _less("foam pad pressed under the Feather", pad.height_mm, spacer.length_mm)
    sizes = (usb.width_mm, usb.thickness_mm)
    diagonal, largest = (math.hypot(*(size.value + i * size.tolerance for size in sizes)) for i in (0, 1))
    # What is off by some height counts twice in a diameter; the hole and the bridge's legs are cut.
    off = 2 * (feather.usb.tolerance + spacer.length_mm.tolerance)
    for hole in car.called("USB"):
        yield Fit("USB plug in its hole", _size(hole)[0] - diagonal, largest - diagonal + off, 4 * car.cut)


def _switch(car: _Measured) -> Iterator[Fit]:
    switch, film = car.parts.switch, car.parts.film.thickness_mm
    for mount in car.mounts(switch.name):
        slot = _size(car.holes[mount.holes[0]])
        body, bezel = (switch.body_length_mm, switch.body_width_mm), (switch.length_mm, switch.width_mm)
        for room, part, over in zip(slot, body, bezel, strict=True):
            yield Fit("switch's body in its slot", room - part.value, part.tolerance, 2 * car.cut)
            yield Fit("switch's bezel over its slot", over.value - room, over.tolerance, 2 * car.cut)
        holes = [(piece, hole) for piece in car.car.pieces for face in piece.faces for hole in face.holes]
        count = sum(piece.count for piece, hole in holes if math.dist(_size(hole), slot) < ROUNDING_MM)
        least, tape = switch.panel_least_mm, car.parts.assembly.tape_mm
        thick = count * film.value + (count - 1) * tape.value
        taken = count * film.tolerance + (count - 1) * tape.tolerance + least.tolerance
        yield Fit("switch's barbs behind layers of film", thick - least.value, taken, 0.0)


def _inside(car: _Measured) -> Iterator[Fit]:
    """What is laid into its outline: the LiPo below the bridge, its flange and feet beside it, the battery; the leads."""
    parts, film, laid = car.parts, car.parts.film_mm, car.parts.assembly.placement_mm.value
    bodies, wing = place(car.car), parts.featherwing
    for mount in car.mounts(parts.lipo.name):
        bridge = {face.face.name: face for face in bodies[mount.body] if face.piece.name == "bridge"}

        def gap(face: str, axis: int, mount: Mount = mount, bridge: dict[str, PlacedFace] = bridge) -> float:
            off = np.abs(bridge[face].corners_mm[:, axis] - mount.pose[axis][3]).min()
            return float(off) - mount.half_mm(axis)

        # The feet lie beside it, with their edges towards it; of shelf and flange it meets a side.
        feet = min(gap(f"{side} foot", 1) for side in ("left", "right"))
        yield Fit("LiPo below the bridge", gap("shelf", 2) - film / 2, parts.lipo.height_mm.tolerance, car.cut)
        beside = gap("flange", 0) - film / 2
        yield Fit("LiPo beside the bridge's flange", beside, parts.lipo.width_mm.tolerance / 2 + laid, car.cut)
        yield Fit("LiPo between the bridge's feet", feet, parts.lipo.length_mm.tolerance / 2 + laid, 2 * car.cut)
    for mount in (*car.mounts(parts.battery.name), *car.mounts(wing.name)):
        walls = np.concatenate([face.corners_mm for face in bodies[mount.body] if face.face.role == "panel"])
        room = float(np.ptp(walls[:, 1])) - film - 2 * mount.half_mm(1)
        up, name = float(walls[:, 2].max()) - film / 2 - _top(mount), mount.part
        if mount.part == wing.name:
            taken = [wing.gap_mm, wing.plug_top_mm, parts.feather.board_mm, wing.board_mm, parts.spacer.length_mm]
            yield Fit("servo leads' bend under the lid", up + wing.plug_bend_mm.value, _sum(taken), 2 * car.cut)
        elif up > 0:
            turned = mount.size_mm[1] == parts.battery.length_mm.value
            across = parts.battery.length_mm if turned else parts.battery.width_mm
            yield Fit(f"{name} between the walls", room, across.tolerance, 2 * car.cut)
            yield Fit(f"{name} under the lid", up, _sum([parts.battery.height_mm, parts.pad.height_mm]), 2 * car.cut)


def _tongues(car: _Measured) -> Iterator[Fit]:
    """The beam's and the bridge's tongues; those of wheels turn in their slots."""
    film, tongue = car.parts.film.thickness_mm, ("lock", "tab_slot")
    turning = {one.piece for one in car.car.placed if one.body.startswith("wheel")}
    for join in (j for j in car.car.joins if j.slot in car.holes and j.kind in tongue and j.piece_a not in turning):
        wide, long = sorted(_size(car.holes[join.slot or ""]))
        yield Fit("tongues along their slots", long - join.length_mm, 0.0, 4 * car.cut)
        yield Fit("tongues' film across their slots", wide - film.value, film.tolerance, 2 * car.cut)


def _less(name: str, outer: Quantity, inner: Quantity) -> Fit:
    return Fit(name, outer.value - inner.value, outer.tolerance + inner.tolerance, 0.0)


def _thread(car: _Measured, name: str, screw: Screw, films: int, between: Sequence[Quantity]) -> Fit:
    """A screw that passes films and other things and a nut."""
    nut = [screw.nut_height_mm] if screw.nut_height_mm else []
    held = [*between, *nut, *[car.parts.film.thickness_mm] * films]
    return Fit(name, screw.length_mm.value - sum(one.value for one in held), _sum([screw.length_mm, *held]), 0.0)


def _sum(several: Iterable[Quantity]) -> float:
    return sum(one.tolerance for one in several)


def _size(hole: Hole, along: Point = (1.0, 0.0)) -> Point:
    """The extent of a hole along a direction of its face and across it (mm)."""
    way = np.array(along) / math.hypot(*along)
    points = np.array(hole.outline_mm) @ np.array([way, (-way[1], way[0])]).T
    x, y = np.ptp(points, axis=0)
    return float(x), float(y)


def _top(mount: Mount) -> float:
    """The height of the highest of a part's upright solids in the car."""
    return max(compose(mount.pose, one.pose)[2][3] + one.size_mm[2] / 2 for one in mount.shape)
