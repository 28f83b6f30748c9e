"""The worst case of the fits between bought parts and the film around them.

Input: a FoldedCar. Output: Fits, each with the clearance at nominal sizes, measured on the folded car, and the most that
tolerances of parts and cutter reduce it. A fit without clearance in the worst case is a finding.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from foldcar.car.folded.model import FoldedCar, Hole, Mount, Point
from foldcar.car.folded.placed import Finding, PlacedFace, place
from foldcar.car.folded.pose import compose
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity

ROUNDING_MM = 1e-6


@dataclass(frozen=True, slots=True)
class Fit:
    """The room of a part: ``nominal_mm``, and by how much the tolerances of parts and cutter reduce it at most."""

    name: str
    nominal_mm: float
    parts_mm: float
    cutter_mm: float

    @property
    def worst_mm(self) -> float:
        """The clearance in the worst case, negative if the parts do not fit then."""
        return self.nominal_mm - self.parts_mm - self.cutter_mm


def check_fits(car: FoldedCar) -> Iterator[Finding]:
    """Yield a finding for each fit without clearance in the worst case."""
    for fit in fits(car):
        if fit.worst_mm < -ROUNDING_MM:
            terms = f"of {fit.nominal_mm:.2f} mm parts take {fit.parts_mm:.2f} mm, the cutter {fit.cutter_mm:.2f} mm"
            yield Finding("fit", fit.name, f"lacks {-fit.worst_mm:.2f} mm in the worst case: {terms}")


def fits(car: FoldedCar) -> tuple[Fit, ...]:
    """Return the fits of a car. If several have the same name, the tightest one is returned."""
    parts, bodies = car.parts, place(car)
    holes = {hole.name: hole for piece in car.pieces for face in piece.faces for hole in face.holes}
    last_names = {name: name.rpartition(".")[2] for name in holes}
    candidates = [fit for name, hole in holes.items() for fit in _hole_fits(last_names[name], hole, parts)]
    for mount in car.mounts:
        own_holes = [holes[name] for name in mount.holes if name in holes]
        if mount.part == parts.servo.name:
            candidates += _servo_fits(own_holes[0], parts)
        elif mount.part == parts.feather.name:
            candidates += (_board_screw_fit(hole, parts) for hole in own_holes)
            candidates.append(_feather_pin_fit(parts))
        elif mount.part == parts.switch.name:
            candidates += _switch_fits(own_holes[0], car)
        elif mount.part == parts.lipo.name:
            candidates += _lipo_fits(mount, bodies[mount.body], parts)
        elif mount.part in (parts.battery.name, parts.featherwing.name):
            candidates += _fits_under_lid(mount, bodies[mount.body], parts)
    tightest: dict[str, Fit] = {}
    for fit in candidates:
        if fit.name not in tightest or fit.worst_mm < tightest[fit.name].worst_mm:
            tightest[fit.name] = fit
    return tuple(tightest.values())


def _fit_between_cuts(name: str, room_mm: float, part: Quantity, parts: Catalogue) -> Fit:
    """Return the fit of a part between two cuts that are nominally ``room_mm`` apart."""
    return Fit(name, room_mm - part.value, part.tolerance, 2 * parts.assembly.cut_mm.value)


def _hole_fits(name: str, hole: Hole, parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits that follow from the name of a hole: wheel screws in their slots, rods, the USB plug."""
    cut = parts.assembly.cut_mm.value
    if name.startswith("horn screw"):
        # The slot points to the axle, which is the face's origin.
        length, width = _size(hole, hole.center_mm or (1.0, 0.0))
        screw, holes = parts.horn_screw.diameter_mm, parts.horn.wheel_screws
        tolerance_mm = 2 * holes.tolerance + screw.tolerance
        yield Fit("wheel's screws along their slots", length - screw.value, tolerance_mm, cutter_mm=2 * cut)
        yield _fit_between_cuts("wheel's screws across their slots", width, screw, parts)
    elif name == "rod":
        yield _fit_between_cuts("rod in its holes", _size(hole)[0], parts.axle_rod.diameter_mm, parts)
    elif name == "USB":
        usb = parts.plugs.usb
        diagonal = math.hypot(usb.width_mm.value, usb.thickness_mm.value)
        # A deviation in height counts twice in a diameter. The hole and the bridge's legs are cut.
        tolerance_mm = math.hypot(usb.width_mm.max_value, usb.thickness_mm.max_value) - diagonal
        tolerance_mm += 2 * (parts.feather.usb.tolerance + parts.spacer.length_mm.tolerance)
        # A round hole is as long as it is wide.
        diameter_mm, _ = _size(hole)
        yield Fit("USB plug in its hole", diameter_mm - diagonal, tolerance_mm, cutter_mm=4 * cut)


def _servo_fits(opening: Hole, parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of a servo in its opening: length, width, screws."""
    servo, screw = parts.servo, parts.screw.diameter_mm
    # The notches for the screws reach beyond the body's ends, but not at its long sides.
    span, width = _size(opening)
    long_side_y = max(y for _, y in opening.outline_mm)
    length = float(np.ptp([x for x, y in opening.outline_mm if long_side_y - y < ROUNDING_MM]))
    yield _fit_between_cuts("servo's length in its opening", length, servo.length_mm, parts)
    yield _fit_between_cuts("servo's width in its opening", width, servo.width_mm, parts)
    # A servo with nearer holes needs no check: the slots of its ears are open outwards and take the screws all the same.
    outer_reach_mm = span / 2 + (servo.screw_hole_mm.value - screw.value) / 2
    clearance = outer_reach_mm - (servo.screw_spacing_mm.value + screw.value) / 2
    tolerance_mm = _tolerance_sum(servo.screw_spacing_mm, servo.screw_hole_mm) / 2 + screw.tolerance
    yield Fit("servo's screws, farther apart, in wall and ears", clearance, tolerance_mm, parts.assembly.cut_mm.value)


def _board_screw_fit(hole: Hole, parts: Catalogue) -> Fit:
    """Return the fit of the boards' screws."""
    screw, board_hole = parts.board_screw.diameter_mm, parts.feather.holes[0]
    hole_mm = (_size(hole)[0] + board_hole.diameter_mm) / 2 - screw.value
    tolerance_mm = 1.5 * board_hole.tolerance + screw.tolerance
    return Fit("boards' screws in bridge and Feather", hole_mm, tolerance_mm, 2 * parts.assembly.cut_mm.value)


def _feather_pin_fit(parts: Catalogue) -> Fit:
    """Return the fit of the Feather's soldered pins over the bridge's film, under which the LiPo lies."""
    spacer, leg, board = parts.spacer.length_mm, parts.headers.leg_mm, parts.feather.board_mm
    clearance_mm = spacer.value - leg.value + board.value
    return Fit("Feather's pins over the bridge", clearance_mm, _tolerance_sum(spacer, leg, board), 0.0)


def _switch_fits(opening: Hole, car: FoldedCar) -> Iterator[Fit]:
    """Yield the fits of the switch: its body in the slot, and its barbs behind the film and tape of panel and layers."""
    switch, film, tape = car.parts.switch, car.parts.film.thickness_mm, car.parts.assembly.tape_mm
    slot = _size(opening)
    for slot_mm, part in zip(slot, (switch.body_length_mm, switch.body_width_mm), strict=True):
        yield _fit_between_cuts("switch's body in its slot", slot_mm, part, car.parts)
    holes = [(piece, hole) for piece in car.pieces for face in piece.faces for hole in face.holes]
    # The panel and every layer have an opening for each switch.
    openings = sum(piece.count for piece, hole in holes if math.dist(_size(hole), slot) < ROUNDING_MM)
    count = openings / sum(mount.part == switch.name for mount in car.mounts)
    thickness_mm = count * film.value + (count - 1) * tape.value
    tolerance_mm = count * film.tolerance + (count - 1) * tape.tolerance + switch.panel_least_mm.tolerance
    # Nothing is cut: the thickness does not depend on the cutter.
    clearance_mm = thickness_mm - switch.panel_least_mm.value
    yield Fit("switch's barbs behind layers of film", clearance_mm, tolerance_mm, cutter_mm=0.0)


def _lipo_fits(mount: Mount, faces: list[PlacedFace], parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of the LiPo, which lies in its outline below the bridge, between the flange and the feet."""
    lipo, film = parts.lipo, parts.film_mm
    placement, cut = parts.assembly.placement_mm.value, parts.assembly.cut_mm.value
    bridge = {face.face.name: face.corners_mm for face in faces if face.piece.name == "bridge"}

    def gap(face: str, axis: int) -> float:
        """Return the gap (mm) between a face of the bridge and the LiPo, along x (0), y (1) or z (2)."""
        return float(np.abs(bridge[face][:, axis] - mount.pose[axis][3]).min()) - mount.half_mm(axis)

    # The feet's edges face the LiPo, whereas shelf and flange face it with a side, half a film nearer.
    yield Fit("LiPo below the bridge", gap("shelf", 2) - film / 2, lipo.height_mm.tolerance, cut)
    tolerance_mm = lipo.width_mm.tolerance / 2 + placement
    yield Fit("LiPo beside the bridge's flange", gap("flange", 0) - film / 2, tolerance_mm, cut)
    feet = min(gap(f"{side} foot", 1) for side in ("left", "right"))
    yield Fit("LiPo between the bridge's feet", feet, lipo.length_mm.tolerance / 2 + placement, 2 * cut)


def _fits_under_lid(mount: Mount, faces: list[PlacedFace], parts: Catalogue) -> Iterator[Fit]:
    """Yield the fit of the FeatherWing below the lid, or of the battery below the lid and between the walls."""
    wing, battery, film, cuts = parts.featherwing, parts.battery, parts.film_mm, 2 * parts.assembly.cut_mm.value
    walls = np.concatenate([face.corners_mm for face in faces if face.face.role == "panel"])
    # The latches' levers, parts of the flap, stand higher than the lid.
    lid_mm = max(float(face.corners_mm[:, 2].max()) for face in faces if face.face.name == "lid")
    # Row 2, column 3 of a pose is the height of its origin. The solids' own axes z point up or down, so half of
    # size_mm[2] lies above their middles.
    top_mm = max(compose(mount.pose, solid.pose)[2][3] + solid.size_mm[2] / 2 for solid in mount.shape)
    gap_mm = lid_mm - film / 2 - top_mm
    if mount.part == wing.name:
        stack = (wing.gap_mm, wing.plug_top_mm, parts.feather.board_mm, wing.board_mm, parts.spacer.length_mm)
        yield Fit("servo leads' bend under the lid", gap_mm + wing.plug_bend_mm.value, _tolerance_sum(*stack), cuts)
    elif gap_mm > 0:
        across = battery.length_mm if mount.size_mm[1] == battery.length_mm.value else battery.width_mm
        side_gap_mm = float(np.ptp(walls[:, 1])) - film - 2 * mount.half_mm(1)
        yield Fit(f"{battery.name} between the walls", side_gap_mm, across.tolerance, cuts)
        yield Fit(f"{battery.name} under the lid", gap_mm, _tolerance_sum(battery.height_mm, parts.pad.height_mm), cuts)


def _tolerance_sum(*quantities: Quantity) -> float:
    return sum(quantity.tolerance for quantity in quantities)


def _size(hole: Hole, along: Point = (1.0, 0.0)) -> Point:
    """Return the extent (mm) of a hole along a direction of its face and across it."""
    direction = np.array(along) / math.hypot(*along)
    x, y = np.ptp(np.array(hole.outline_mm) @ np.array([direction, (-direction[1], direction[0])]).T, axis=0)
    return float(x), float(y)
