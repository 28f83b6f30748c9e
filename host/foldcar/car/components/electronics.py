"""The body module that carries the electronics, the first B of a car.

The boards stand on a bridge over the LiPo, USB behind a hole of the left wall. The servos' battery stands on the floor
behind or before them, or on the roof; both may reach into the free floor of the neighbouring modules.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from foldcar.car.components.box_beam import latch_notch, wall_distance_mm
from foldcar.car.components.bridge import (
    half_length_mm,
    middle_mm,
    mouth_mm,
    plug_room_mm,
    put_bridge,
    usb_height_mm,
)
from foldcar.car.components.component import ROUNDING, ComponentError
from foldcar.car.components.module import BrainModule
from foldcar.car.components.mounts import cylinder
from foldcar.car.components.shape import Shape, rectangle_around
from foldcar.car.components.wires import power_wires
from foldcar.car.folded.model import IDENTITY, Point, Solid
from foldcar.car.folded.pose import translation
from foldcar.car.parts.quantity import BoxPart

# The layer below a battery on the floor is longer than the battery by this at both ends: so its outline is printed on
# film, and the slot of the bridge's tongue, which is 0.8 mm from the battery, stays free.
DOUBLER_EDGE_MM = 0.55


class Layout(NamedTuple):
    """An arrangement along x (mm) of boards, LiPo and battery on the floor, or with the battery on the roof.

    The boards' middle may be anywhere from ``low`` to ``high``; the layout does not fit if ``low`` exceeds ``high``.
    ``boards_x``, ``lipo_x`` and ``battery_x`` are the middles. ``side`` is the bridge's edge with the flange, at the
    battery: 1 is the front, -1 the rear. ``turned``: the battery's length lies across the car.
    """

    low: float
    high: float
    side: int
    turned: bool
    boards_x: float
    lipo_x: float
    battery_x: float

    @property
    def missing_mm(self) -> float:
        """By how much (mm) the module is too short for this layout; 0 or less if it fits."""
        return self.low - self.high


class Doubler(NamedTuple):
    """The second layer of film on the floor: x of its middle (mm), its length along the car and its width across."""

    middle_x: float
    length_mm: float
    width_mm: float


class ElectronicsModule(BrainModule):
    """The body module that carries boards and batteries.

    The car sets ``floor_front`` and ``floor_rear``, the free floor (mm) of the neighbours, negative at an end cap's tab.
    It also sets ``usb_low`` and ``usb_high`` (mm from the rear), between which USB is clear of the tyres.
    """

    def build(self, shape: Shape) -> None:
        """Place the parts in the frame of the floor.

        Its origin is the rear right corner of the floor, in the middle of the film's thickness: x points forward, y to
        the left wall and z up.
        """
        parts, assembly, layout = self.parts, self.parts.assembly, self.layout
        film, across = parts.film_mm, wall_distance_mm(self["width"], parts)
        # The mouth of the USB socket, into which the plug goes, is just inside the left wall. The boards, which lie on a
        # bridge over the LiPo battery, are to the right of it.
        socket_mouth_y = across - film / 2 - assembly.usb_inside_mm.value
        boards_y = socket_mouth_y - mouth_mm(parts)
        put_bridge(shape, "beam.floor", layout.boards_x, boards_y, layout.side)
        lipo_center = (layout.lipo_x, middle_mm(parts, boards_y), film / 2 + parts.lipo.height_mm.value / 2)
        shape.part(parts.lipo, "beam.floor", lipo_center, turned=True, marked=True)
        self._cut_usb_opening(shape, layout.boards_x)
        self._place_battery(shape, layout, boards_y)
        # For the mass of the car, all wires are one part in the module's middle.
        wires_center = (self["length"] / 2, across / 2, wall_distance_mm(self["height"], parts) / 2)
        shape.part(parts.wiring, "beam.floor", wires_center)
        shape.graph.wires += power_wires(parts)

    def _cut_usb_opening(self, shape: Shape, x: float) -> None:
        """Cut three openings into the left wall: for the USB plug, for the board's light, and for the USB cable's tie.

        In the wall's frame x points forward and y up. ``x`` is the middle of the boards. The light is beside the socket,
        so a plug would hide it from straight ahead. Its window is in front of the plug. You see the light through it when
        you look backwards at an angle.
        """
        parts, assembly, usb_y = self.parts, self.parts.assembly, usb_height_mm(self.parts)
        hole = plug_room_mm(parts.plugs.usb) + 2 * (parts.feather.usb.tolerance + assembly.slot_clearance_mm.value)
        shape.round_hole("beam.left", "USB", "opening", (x, usb_y), hole)
        window = assembly.light_window_mm.value
        window_x = x + (hole + window) / 2 + assembly.grip_gap_mm.value
        shape.round_hole("beam.left", "light", "opening", (window_x, usb_y), window)
        # The tie goes through two slots above the plug, which are half as wide as they are high. Between their upper ends
        # and the fold of the lid remain the minimum distance of a hole from a fold, and one height of a slot. Half a slot
        # farther down is their middle.
        slot_height = assembly.tie_slot_mm.value
        slots_y = wall_distance_mm(self["height"], parts) - assembly.fold_distance_mm.value - 1.5 * slot_height
        slot_offset = (assembly.tie_apart_mm.value + slot_height) / 2
        for name, slot_x in (("tie 1", x - slot_offset), ("tie 2", x + slot_offset)):
            shape.rectangular_hole("beam.left", name, "slit", (slot_x, slots_y), slot_height / 2, slot_height)

    def _place_battery(self, shape: Shape, layout: Layout, boards_y: float) -> None:
        """Add the battery, and the pad that holds it, on the floor or on the roof, opposite to the boards across the car.

        The battery is as far from the middle of the car as it must be to balance the boards, or as far as the walls
        allow. ``boards_y`` is y of the boards' middle in the frame of the floor, whose y points to the left.
        """
        parts, across = self.parts, wall_distance_mm(self["width"], self.parts)
        battery, middle_y = parts.battery, across / 2
        boards_kg = sum(part.mass_kg.value for part in (parts.feather, parts.featherwing, parts.lipo))
        # How far to the right of the car's middle the battery balances the boards; negative means to the left.
        to_right_mm = (boards_y - middle_y) * boards_kg / battery.mass_kg.value
        if parts.battery_place == "roof":
            # In the lid's frame, y points to the right, so the distance is added. In the floor's frame it is subtracted.
            self._place_on_roof(shape, layout.battery_x, middle_y + to_right_mm)
            return
        battery_across_mm = (battery.length_mm if layout.turned else battery.width_mm).value
        max_distance_mm = (across - parts.film_mm - battery_across_mm) / 2
        y = middle_y - _clamped(to_right_mm, max_distance_mm)
        self._place_on_floor(shape, layout, y)

    def _place_on_floor(self, shape: Shape, layout: Layout, y: float) -> None:
        """Add pad and battery on the floor, with their middle at ``y``, and a second layer of film below them.

        The layer, the *floor doubler*, stiffens the floor. In a car of 95 mm, of 0.25 mm PET, the battery (1.2 N, 31.5
        mm wide) would hang by two strips of film, L = 18 mm long. They would sag by F L³ / (12 E I) = 1.6 mm if they
        were clamped at both ends, and four times as much if the folds turned freely. Two layers are two to eight times
        as stiff as one.
        """
        parts, x = self.parts, layout.battery_x
        layer = self._floor_doubler(layout)
        layer_mm = (layer.length_mm, layer.width_mm)
        layer_middle = (layer.middle_x, wall_distance_mm(self["width"], parts) / 2)
        # A printed outline on the floor shows where the layer lies.
        shape.mark("beam.floor", "floor doubler", rectangle_around(layer_middle, *layer_mm))
        shape.layer("floor doubler", "beam.floor", rectangle_around((0.0, 0.0), *layer_mm), layer_middle, "floor doubler")
        # The pad lies on the layer, and the battery on the pad. Their outlines on the layer are beside its middle, which
        # shows how to turn the layer.
        middle_on_layer = (x - layer_middle[0], y - layer_middle[1])
        bottom_z = parts.film_mm / 2 + parts.film_mm
        for part in (parts.pad, parts.battery):
            height = part.height_mm.value
            shape.mark("floor doubler", part.name, rectangle_around(middle_on_layer, *_extent_mm(part, layout.turned)))
            shape.part(part, "beam.floor", (x, y, bottom_z + height / 2), turned=layout.turned)
            bottom_z += height

    def _floor_doubler(self, layout: Layout) -> Doubler:
        """Return the place and the size of the layer of film below a battery on the floor.

        Along the car it is a little longer than the battery, but ends where the free floor ends. Across the car it ends
        before the folds of the walls, unless the battery is wider.
        """
        battery_x_mm, battery_y_mm = _extent_mm(self.parts.battery, layout.turned)
        rear_x = max(layout.battery_x - battery_x_mm / 2 - DOUBLER_EDGE_MM, -self["floor_rear"])
        front_x = min(layout.battery_x + battery_x_mm / 2 + DOUBLER_EDGE_MM, self["length"] + self["floor_front"])
        between_folds_mm = wall_distance_mm(self["width"], self.parts) - 2 * self.parts.assembly.fold_distance_mm.value
        width_mm = max(between_folds_mm, battery_y_mm + 2 * DOUBLER_EDGE_MM)
        return Doubler((rear_x + front_x) / 2, length_mm=front_x - rear_x, width_mm=width_mm)

    def _place_on_roof(self, shape: Shape, x: float, wanted_y: float) -> None:
        """Add pad and battery on the roof, with their middle at ``x``, and as near to ``wanted_y`` as the folds allow.

        The origin of the lid's frame is the rear end of its left edge. x points forward, y to the right and z down into
        the car. The roof is the lid's outer side, on which nothing is printed. So holes at the corners of pad and battery
        show where to lay them. The battery's length lies across the car.
        """
        parts, film = self.parts, self.parts.film_mm
        battery, pad, hole_mm = parts.battery, parts.pad, parts.assembly.corner_hole_mm.value
        # The holes at the battery's corners must keep a distance from the lid's folds.
        min_fold_distance = parts.assembly.fold_distance_mm.value + hole_mm / 2
        _, lid_width = shape.face_size_mm("beam.lid")
        middle_y = lid_width / 2
        max_distance = middle_y - min_fold_distance - battery.length_mm.value / 2
        y = middle_y + _clamped(wanted_y - middle_y, max(max_distance, 0.0))
        # The pad lies on the lid, and the battery on the pad.
        shape.part(pad, "beam.lid", (x, y, -(film + pad.height_mm.value) / 2), turned=True)
        hole_x, hole_y = self._cut_lead_hole(shape, x + battery.width_mm.value / 2)
        battery_height = film / 2 + pad.height_mm.value + battery.height_mm.value / 2
        size = (battery.width_mm.value, battery.length_mm.value, battery.height_mm.value)
        solids = (Solid("box", size, IDENTITY), self._leads_through_lid((hole_x - x, hole_y - y), battery_height))
        pose = translation(x, y, -battery_height)
        shape.box(battery.name, battery.name, "beam.lid", pose, size, battery.mass_kg.value, solids=solids)
        # The holes at the corners, for each part whose corners are not too near to a fold.
        for part in (pad, battery):
            distance_to_fold = middle_y - abs(y - middle_y) - part.length_mm.value / 2
            if distance_to_fold >= min_fold_distance - ROUNDING:
                # From the rear to the front, and there from the left to the right.
                half_length, half_width = part.length_mm.value / 2, part.width_mm.value / 2
                corners = itertools.product((x - half_width, x + half_width), (y - half_length, y + half_length))
                for number, corner in enumerate(corners, 1):
                    shape.round_hole("beam.lid", f"{part.name} corner {number}", "mark", corner, hole_mm)

    def _leads_through_lid(self, hole: Point, height: float) -> Solid:
        """Return the leads of a battery on the roof where they pass the lid, as one cylinder that is two wires wide.

        It belongs to the battery's mount and is given in its frame: the origin is the middle of the battery, ``height``
        above the middle of the lid's film, and z points down. ``hole`` is the point where the leads pass.
        """
        wire_mm, film = self.parts.wiring.wire_diameter_mm.value, self.parts.film_mm
        # Larger z is lower. The cylinder reaches from above the lid to below it.
        lid_top_z = height - film / 2
        lid_underside_z = lid_top_z + film
        leads = cylinder(2 * wire_mm, lid_top_z - 2 * wire_mm, lid_underside_z + wire_mm, *hole)
        return replace(leads, weightless=True)

    def _cut_lead_hole(self, shape: Shape, battery_front_x: float) -> Point:
        """Cut a hole for the leads of a battery on the roof into the lid, and return the hole's middle.

        The hole is in front of the battery, near the lid's left edge. ``battery_front_x`` is the front end of the
        battery, which lies in the middle of the module. Raises ComponentError if the module is too short for it.
        """
        assembly = self.parts.assembly
        hole, fold_distance = assembly.lead_hole_mm.value, assembly.fold_distance_mm.value
        min_length = self._min_length_with_roof_mm()
        if self["length"] < min_length - ROUNDING:
            parts_text = f"the {self.parts.battery.name} on the roof beside its lead and the lid's latch"
            raise self.parameter_error("length", _too_small(self["length"], min_length, parts_text))
        center = (battery_front_x + fold_distance + hole / 2, fold_distance + hole)
        shape.round_hole("beam.lid", "lead", "slit", center, hole)
        return center

    def _min_length_with_roof_mm(self) -> float:
        """Return the minimum length of a module with a battery on its roof (mm).

        The lid must have room in front of the battery for the hole through which the battery's leads go in, and at each
        latch for the fingers that open it. The battery lies in the middle of the module, so the room at one end is
        counted twice.
        """
        battery_width, assembly = self.parts.battery.width_mm, self.parts.assembly
        # The hole keeps a distance from the battery, and the same distance from the end of the lid.
        room_for_hole = 2 * assembly.fold_distance_mm.value + assembly.lead_hole_mm.value
        min_length = battery_width.value + 2 * room_for_hole
        # Fingers press in the middle of the latch's notch, and may be wider than the notch.
        notch = latch_notch(self.parts).length_mm
        finger, _ = self.parts.tools.finger_mm
        latch_and_finger = notch / 2 + max(notch, finger) / 2
        for end in ("front", "rear"):
            if self[f"latch_{end}"]:
                # The latch is beside the tab of the cap. The battery is laid by eye, so its place has a tolerance.
                room_for_latch = assembly.placement_mm.value + (self[f"flap_{end}"] + latch_and_finger)
                min_length = max(min_length, battery_width.max_value + 2 * room_for_latch)
        return min_length

    def _layouts(self) -> Iterator[Layout]:
        """Yield the possible layouts, also those for which the module is too short."""
        if self.parts.battery_place == "roof":
            # A battery on the roof needs no length of the floor. It lies across the car, in the middle of the module.
            yield self._layout(battery_mm=0.0, side=-1, turned=True)
            return
        battery = self.parts.battery
        floor_mm = self["width"] - 2 * self.parts.film_mm
        for turned in (True, False):
            along, across = (battery.width_mm, battery.length_mm) if turned else (battery.length_mm, battery.width_mm)
            needed_mm = across.max_value + 2 * self.parts.assembly.cut_mm.value
            if needed_mm <= floor_mm + ROUNDING:
                # The battery is behind the boards, or in front of them.
                yield self._layout(along.value, side=-1, turned=turned)
                yield self._layout(along.value, side=1, turned=turned)

    def _layout(self, battery_mm: float, side: int, turned: bool) -> Layout:
        """Return a layout of the parts along x, with the boards as near to the middle of the module as possible.

        ``battery_mm`` is the battery's extent along x; it is 0 if the battery is on the roof. If ``side`` is 1, the LiPo
        is behind the boards and the battery in front of them. If ``side`` is -1, the order is the reverse one. If the
        battery is ``turned``, its length lies across the car.
        """
        length = self["length"]
        # The distances from the boards' middle to the far ends of what is on its two sides.
        battery_end_mm, lipo_end_mm = self._battery_end_mm(battery_mm, side), self._lipo_end_mm()
        if side > 0:
            rear_mm, front_mm = lipo_end_mm, battery_end_mm
        else:
            rear_mm, front_mm = battery_end_mm, lipo_end_mm
        # The limits of the boards' middle, from the module's rear. Parts may reach into the neighbours' free floor.
        low = max(rear_mm - self["floor_rear"], self["usb_low"])
        high = min(length + self["floor_front"] - front_mm, self["usb_high"])
        boards_x = min(max(length / 2, low), high)
        lipo_x = boards_x - side * (lipo_end_mm - self.parts.lipo.width_mm.value / 2)
        # A battery on the roof lies in the middle of the module.
        battery_x = length / 2
        if battery_mm:
            battery_x = boards_x + side * battery_end_mm - side * battery_mm / 2
        return Layout(low, high, side, turned, boards_x=boards_x, lipo_x=lipo_x, battery_x=battery_x)

    def _battery_end_mm(self, battery_mm: float, side: int) -> float:
        """Return the distance along x from the middle of the boards to the far end of the battery beside them (mm).

        ``battery_mm`` is the battery's extent along x. If it is 0, there is no battery on the floor, and the result is
        the distance to the end of the bridge, the piece that carries the boards. ``side`` is 1 for a battery in front
        of the boards, and -1 for one behind them.
        """
        bridge_end_mm = half_length_mm(self.parts) + self.parts.film_mm
        if not battery_mm:
            return bridge_end_mm
        # The LiPo's lead leaves the Feather at the front, so its plug is between the boards and a battery there.
        gap_mm = self.parts.plugs.battery.length_mm.value if side > 0 else self.parts.assembly.part_gap_mm.value
        return bridge_end_mm + (gap_mm + battery_mm)

    def _lipo_end_mm(self) -> float:
        """Return the distance along x from the middle of the boards to the end of the LiPo that is away from the battery.

        The LiPo lies under the bridge, the folded piece that carries the boards. On the side of the battery, the
        *flange* of the bridge hangs down. The LiPo reaches from there to beyond the middle of the boards. It is laid
        into a printed outline by eye, so there is a gap between flange and LiPo. The distance is in mm.
        """
        assembly, lipo = self.parts.assembly, self.parts.lipo.width_mm
        gap_mm = assembly.placement_mm.value + lipo.tolerance / 2 + assembly.slot_clearance_mm.value
        # Both distances are measured from the middle of the flange's film.
        flange_to_lipo_end_mm = self.parts.film_mm / 2 + gap_mm + lipo.value
        flange_to_boards_middle_mm = half_length_mm(self.parts)
        return flange_to_lipo_end_mm - flange_to_boards_middle_mm

    @property
    def layout(self) -> Layout:
        """The layout that fits, with the boards nearest to the middle of the module.

        A layout fits if it is not longer than the module: ``missing_mm`` is the length that the module lacks for it.
        Raises ComponentError if none fits.
        """
        layouts = list(self._layouts())
        if not layouts:
            raise self._too_narrow()
        fitting = [layout for layout in layouts if layout.missing_mm <= ROUNDING]
        if not fitting:
            raise self._too_short(layouts)
        return min(fitting, key=lambda layout: abs(layout.boards_x - self["length"] / 2))

    def _too_narrow(self) -> ComponentError:
        """Return the error of a body in which the battery fits on the floor neither along nor across the car."""
        battery = self.parts.battery
        battery_mm = min(battery.length_mm.max_value, battery.width_mm.max_value)
        min_width = battery_mm + 2 * (self.parts.assembly.cut_mm.value + self.parts.film_mm)
        return self.parameter_error("width", _too_small(self["width"], min_width, battery.name))

    def _too_short(self, layouts: Sequence[Layout]) -> ComponentError:
        """Return the error of a module that is too short for all layouts; it names the least length that would do.

        A layout is an arrangement of the boards and the battery along the module. The middle of the boards must be
        between its ``low`` and its ``high``, but here ``low`` is above ``high``. ``turned`` is whether the battery lies
        across the car.
        """
        length = self["length"]
        nearest = min(layouts, key=lambda layout: layout.missing_mm)
        on_roof = self.parts.battery_place == "roof"
        parts_text = "the boards" if on_roof else f"the boards and the {self.parts.battery.name}"
        if not any(layout.turned for layout in layouts):
            parts_text += f" lengthwise at width {self['width']:g}"
        # Between usb_low and usb_high a USB plug is clear of the tyres beside the module.
        is_limited_by_tyres = nearest.low == self["usb_low"] or nearest.high == self["usb_high"]
        if is_limited_by_tyres:
            parts_text += ", with a USB plug clear of the tyres"
        return self.parameter_error("length", _too_small(length, length + nearest.missing_mm, parts_text))


def _extent_mm(part: BoxPart, turned: bool) -> Point:
    """Return the extent of a part along x and y (mm). The length of a ``turned`` part lies along y."""
    length, width, _ = part.size_mm
    return (width, length) if turned else (length, width)


def _clamped(value: float, limit: float) -> float:
    """Return the number nearest to ``value`` between ``-limit`` and ``limit``."""
    return min(max(value, -limit), limit)


def _too_small(value: float, needed: float, what: str) -> str:
    """Return the message for a size that is smaller than ``what`` needs (mm); the need is rounded up to 0.1 mm."""
    return f"{value:g} is below the minimum {math.ceil((needed - ROUNDING) * 10) / 10:g} ({what})"
