"""The worst case of the fits between bought parts and the film around them.

Input: a FoldedCar. Output: Fits, each with the clearance at nominal sizes, measured on the folded car, and the most that
tolerances of parts and cutter reduce it. A fit without clearance in the worst case is a finding.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from foldcar.car.folded.model import FoldedCar, Hole, Mount, Point
from foldcar.car.folded.placed import Finding, PlacedFace, placed_faces
from foldcar.car.folded.pose import apply, compose
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
    for fit in fits_of(car):
        if fit.worst_mm < -ROUNDING_MM:
            terms = f"of {fit.nominal_mm:.2f} mm parts take {fit.parts_mm:.2f} mm, the cutter {fit.cutter_mm:.2f} mm"
            yield Finding("fit", fit.name, f"lacks {-fit.worst_mm:.2f} mm in the worst case: {terms}")


def fits_of(car: FoldedCar) -> tuple[Fit, ...]:
    """Return the fits of a car. If several have the same name, the tightest one is returned."""
    parts, faces_of_bodies = car.parts, placed_faces(car)
    holes = {hole.name: hole for piece in car.pieces for face in piece.faces for hole in face.holes}
    candidates: list[Fit] = []
    for path, hole in holes.items():
        candidates += _hole_fits(path.rpartition(".")[2], hole, parts)
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
            candidates += _lipo_fits(mount, faces_of_bodies[mount.body], parts)
        elif mount.part in (parts.battery.name, parts.featherwing.name):
            candidates += _fits_under_lid(mount, faces_of_bodies[mount.body], parts)
    tightest: dict[str, Fit] = {}
    for fit in candidates:
        if fit.name not in tightest or fit.worst_mm < tightest[fit.name].worst_mm:
            tightest[fit.name] = fit
    return tuple(tightest.values())


def _fit_between_cuts(name: str, room_mm: float, part: Quantity, parts: Catalogue) -> Fit:
    """Return the fit of a part between two cuts that are nominally ``room_mm`` apart.

    The cutter may be off by ``cut_mm`` at each of them.
    """
    return Fit(name, room_mm - part.value, part.tolerance, 2 * parts.assembly.cut_mm.value)


def _hole_fits(name: str, hole: Hole, parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of the part that goes through a hole of film with this name.

    The part is a screw that holds a wheel on the servo's horn, a rod or the USB plug. Other holes have no fits.
    """
    if name.startswith("horn screw"):
        yield from _horn_screw_fits(hole, parts)
    elif name == "rod":
        # A round hole is as long as it is wide.
        diameter_mm, _ = _size(hole)
        yield _fit_between_cuts("rod in its holes", diameter_mm, parts.axle_rod.diameter_mm, parts)
    elif name == "USB":
        yield _usb_fit(hole, parts)


def _horn_screw_fits(slot: Hole, parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of a screw in its slot in a wheel, along and across the slot.

    The screw holds the wheel on its *horn*, the part that sits on the servo's shaft. The slot lies along the radius of
    the wheel, because a hole of the horn may be nearer to the axle or farther from it than in the horn's data. The axle
    is the origin of the face's frame.
    """
    radius_direction = (1.0, 0.0) if slot.center_mm is None else slot.center_mm
    length, width = _size(slot, radius_direction)
    screw, horn_holes = parts.horn_screw.diameter_mm, parts.horn.wheel_screws
    tolerance_mm = 2 * horn_holes.tolerance + screw.tolerance
    cutter_mm = 2 * parts.assembly.cut_mm.value
    yield Fit("wheel's screws along their slots", length - screw.value, tolerance_mm, cutter_mm)
    yield _fit_between_cuts("wheel's screws across their slots", width, screw, parts)


def _usb_fit(hole: Hole, parts: Catalogue) -> Fit:
    """Return the fit of the USB plug in its round hole.

    The plug may be too high or too low. Its height depends on the socket, on the spacers, and on the legs of the
    bridge, the folded piece that carries the boards. The hole lets it pass in both cases if it is larger by twice the
    error of the height.
    """
    usb, diameter_mm = parts.plugs.usb, _size(hole)[0]
    diagonal = math.hypot(usb.width_mm.value, usb.thickness_mm.value)
    max_diagonal = math.hypot(usb.width_mm.max_value, usb.thickness_mm.max_value)
    height_tolerance_mm = parts.feather.usb.tolerance + parts.spacer.length_mm.tolerance
    tolerance_mm = max_diagonal - diagonal + 2 * height_tolerance_mm
    # The cutting machine may be off by this at both edges of the hole. It may also be off at the end of a leg. That is an
    # error of the height, which counts twice.
    cut = parts.assembly.cut_mm.value
    cuts_of_hole_mm, cuts_of_legs_mm = 2 * cut, 2 * cut
    return Fit("USB plug in its hole", diameter_mm - diagonal, tolerance_mm, cutter_mm=cuts_of_hole_mm + cuts_of_legs_mm)


def _servo_fits(opening: Hole, parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of a servo in its opening: its length, its width, and its two screws.

    The screws go through holes in the servo's ears and through notches in the wall. The distance of the ears' holes from
    each other has a tolerance. Only holes that are farther apart than usual are checked: if they are nearer, the screws
    still fit, because the ears' slots are open outwards.
    """
    servo, screw = parts.servo, parts.screw.diameter_mm
    # The outline of the opening is longer than the room for the servo's body, because a notch for a screw is in the
    # middle of each short side. The body fits between the ends of the long sides.
    length_with_notches, width = _size(opening)
    long_side_y = max(y for _, y in opening.outline_mm)
    xs_on_long_side = [x for x, y in opening.outline_mm if long_side_y - y < ROUNDING_MM]
    length = float(np.ptp(xs_on_long_side))
    yield _fit_between_cuts("servo's length in its opening", length, servo.length_mm, parts)
    yield _fit_between_cuts("servo's width in its opening", width, servo.width_mm, parts)
    # Distances from the servo's middle. The outer side of a screw must not be beyond the end of its notch. The screw can
    # give way inwards in the ear's hole, by half of the difference of their diameters.
    play_in_ear_mm = (servo.screw_hole_mm.value - screw.value) / 2
    max_outer_side_mm = length_with_notches / 2 + play_in_ear_mm
    outer_side_mm = (servo.screw_spacing_mm.value + screw.value) / 2
    clearance = max_outer_side_mm - outer_side_mm
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


def _switch_fits(slot: Hole, car: FoldedCar) -> Iterator[Fit]:
    """Yield the fits of a switch: its body in the slot, and its barbs, which hold behind the panel.

    The *film* is the plastic sheet of which the car is folded. One film is too thin for the barbs, so layers of film are
    stuck behind the panel with tape.
    """
    switch, film, tape = car.parts.switch, car.parts.film.thickness_mm, car.parts.assembly.tape_mm
    slot_length, slot_width = _size(slot)
    yield _fit_between_cuts("switch's body in its slot", slot_length, switch.body_length_mm, car.parts)
    yield _fit_between_cuts("switch's body in its slot", slot_width, switch.body_width_mm, car.parts)
    # A switch goes through one slot of this size in the panel and in every layer. So the number of films behind each
    # other is the number of such slots in the car, divided by the number of switches.
    slot_count = 0
    for piece in car.pieces:
        for face in piece.faces:
            equal_holes = [hole for hole in face.holes if math.dist(_size(hole), _size(slot)) < ROUNDING_MM]
            slot_count += piece.count * len(equal_holes)
    switch_count = sum(mount.part == switch.name for mount in car.mounts)
    film_count = slot_count / switch_count
    tape_count = film_count - 1
    thickness_mm = film_count * film.value + tape_count * tape.value
    tolerance_mm = film_count * film.tolerance + tape_count * tape.tolerance + switch.panel_least_mm.tolerance
    clearance_mm = thickness_mm - switch.panel_least_mm.value
    # The error of the machine that cuts the film does not change the thickness, so it is 0.
    yield Fit("switch's barbs behind layers of film", clearance_mm, tolerance_mm, cutter_mm=0.0)


def _lipo_fits(mount: Mount, faces: list[PlacedFace], parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of the LiPo, which lies on the floor below the bridge, between its flange and its feet.

    It is laid by eye into its printed outline, so its place has a tolerance, too. ``faces`` are those of the segment.
    """
    lipo, half_film = parts.lipo, parts.film_mm / 2
    placement, cut = parts.assembly.placement_mm.value, parts.assembly.cut_mm.value
    bridge = {face.face.name: face.corners_mm for face in faces if face.piece.name == "bridge"}

    def gap(face: str, axis: int) -> float:
        """Return the gap (mm) between a face of the bridge and the LiPo, along x (0), y (1) or z (2) of the car."""
        distances = np.abs(bridge[face][:, axis] - mount.center_mm[axis])
        return float(distances.min()) - mount.half_mm(axis)

    # The shelf is above the LiPo and the flange beside it. Faces are the middles of their films, and the surface that is
    # towards the LiPo is half a film nearer. The height of the shelf and the place of the flange depend on one cut.
    yield Fit("LiPo below the bridge", gap("shelf", 2) - half_film, lipo.height_mm.tolerance, cutter_mm=cut)
    tolerance_mm = lipo.width_mm.tolerance / 2 + placement
    yield Fit("LiPo beside the bridge's flange", gap("flange", 0) - half_film, tolerance_mm, cutter_mm=cut)
    # The feet end with their edges before the LiPo. The place of an edge depends on two cuts: its own and that of the
    # leg.
    gap_to_feet = min(gap("left foot", 1), gap("right foot", 1))
    tolerance_mm = lipo.length_mm.tolerance / 2 + placement
    yield Fit("LiPo between the bridge's feet", gap_to_feet, tolerance_mm, cutter_mm=2 * cut)


def _fits_under_lid(mount: Mount, faces: list[PlacedFace], parts: Catalogue) -> Iterator[Fit]:
    """Yield the fits of the FeatherWing or the battery under the lid, and of a battery between the walls.

    A battery on the roof has no such fit. ``faces`` are those of the segment.
    """
    gap_mm = _gap_to_lid_mm(mount, faces, parts)
    if mount.part == parts.featherwing.name:
        yield _wing_fit(gap_mm, parts)
        return
    is_on_roof = gap_mm <= 0
    if not is_on_roof:
        battery, cutter_mm = parts.battery, 2 * parts.assembly.cut_mm.value
        # The gaps to both walls together. The panels of a car extend along y from the middle of one wall's film to that
        # of the other.
        panels = np.concatenate([face.corners_mm for face in faces if face.face.role == "panel"])
        between_walls_mm = float(np.ptp(panels[:, 1])) - parts.film_mm
        side_gap_mm = between_walls_mm - 2 * mount.half_mm(1)
        lies_across = mount.size_mm[1] == battery.length_mm.value
        size_across = battery.length_mm if lies_across else battery.width_mm
        height_tolerance_mm = _tolerance_sum(battery.height_mm, parts.pad.height_mm)
        yield Fit(f"{battery.name} between the walls", side_gap_mm, size_across.tolerance, cutter_mm)
        yield Fit(f"{battery.name} under the lid", gap_mm, height_tolerance_mm, cutter_mm)


def _gap_to_lid_mm(mount: Mount, faces: list[PlacedFace], parts: Catalogue) -> float:
    """Return the distance (mm) from the highest point of a part up to the inner surface of the lid.

    It is negative for a part on the lid.
    """
    lid_z = max(float(face.corners_mm[:, 2].max()) for face in faces if face.face.name == "lid")
    tops = []
    for solid in mount.shape:
        _, _, middle_z = apply(compose(mount.pose, solid.pose), 0.0, 0.0)
        # z of the solid's own frame points up or down, so half of its size along z lies above its middle.
        tops.append(middle_z + solid.size_mm[2] / 2)
    return lid_z - parts.film_mm / 2 - max(tops)


def _wing_fit(gap_mm: float, parts: Catalogue) -> Fit:
    """Return the fit of the FeatherWing, with the servos' plugs on it, under the lid.

    The FeatherWing is the upper board. The leads of the servos bend over their plugs. With these bends the wing ends
    ``gap_mm`` below the lid. The bends may touch the lid, because they give way, so only the plugs must fit below it.
    """
    wing = parts.featherwing
    gap_over_plugs_mm = gap_mm + wing.plug_bend_mm.value
    # All that adds up to the height of the plugs over the bridge.
    stack = (wing.gap_mm, wing.plug_top_mm, parts.feather.board_mm, wing.board_mm, parts.spacer.length_mm)
    cutter_mm = 2 * parts.assembly.cut_mm.value
    return Fit("servo leads' bend under the lid", gap_over_plugs_mm, _tolerance_sum(*stack), cutter_mm)


def _tolerance_sum(*quantities: Quantity) -> float:
    return sum(quantity.tolerance for quantity in quantities)


def _size(hole: Hole, along: Point = (1.0, 0.0)) -> Point:
    """Return the extent (mm) of a hole along a direction of its face and across it."""
    direction = np.array(along) / math.hypot(*along)
    x, y = np.ptp(np.array(hole.outline_mm) @ np.array([direction, (-direction[1], direction[0])]).T, axis=0)
    return float(x), float(y)
