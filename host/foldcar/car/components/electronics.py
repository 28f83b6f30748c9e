"""The body module that carries the electronics, the first B of a car.

The boards stand on a bridge over the LiPo, USB behind a hole of the left wall. The servos' battery stands on the floor
behind or before them, or on the roof; both may reach into the free floor of the neighbouring modules.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from foldcar.car.components.box_beam import latch_mm, wall_mm
from foldcar.car.components.bridge import (
    BUTTON_PIN,
    DIVIDER_UPPER,
    OE_PIN,
    half_width_mm,
    middle_mm,
    mouth_mm,
    plug_room_mm,
    put_bridge,
    usb_height_mm,
)
from foldcar.car.components.component import ROUNDING
from foldcar.car.components.module import BrainModule
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH, cylinder
from foldcar.car.components.shape import Shape, rectangle_around
from foldcar.car.folded.model import IDENTITY, Point, Solid, Wire
from foldcar.car.folded.pose import translation
from foldcar.car.parts.catalogue import Catalogue

# The layer below a battery on the floor is longer than the battery by this at both ends: so its outline is printed on
# film, and the slot of the bridge's tongue, which is 0.8 mm from the battery, stays free.
DOUBLER_EDGE_MM = 0.55


class Layout(NamedTuple):
    """An arrangement along x (mm) of boards, LiPo and battery on the floor, or with the battery on the roof.

    The boards' middle may be anywhere from ``low`` to ``high``; the layout does not fit if ``low`` exceeds ``high``.
    ``boards_mm``, ``lipo_mm`` and ``battery_mm`` are the middles. ``side`` is the bridge's edge with the flange, at the
    battery: 1 is the front, -1 the rear. ``turned``: the battery's length lies across the car.
    """

    low: float
    high: float
    side: int
    turned: bool
    boards_mm: float
    lipo_mm: float
    battery_mm: float

    @property
    def missing_mm(self) -> float:
        """By how much (mm) the module is too short for this layout; 0 or less if it fits."""
        return self.low - self.high


class ElectronicsModule(BrainModule):
    """The body module that carries boards and batteries.

    The car sets ``floor_front`` and ``floor_rear``, the free floor (mm) of the neighbours, negative at an end cap's tab.
    It also sets ``usb_low`` and ``usb_high`` (mm from the rear), between which USB is clear of the tyres.
    """

    def build(self, shape: Shape) -> None:
        """Place the parts in the floor's frame: x from the rear, y from the right wall, z from the middle surface."""
        parts, assembly, layout = self.parts, self.parts.assembly, self.layout
        x = layout.boards_mm
        film, across = parts.film_mm, wall_mm(self["width"], parts)
        y = across - film / 2 - assembly.usb_inside_mm.value - mouth_mm(parts)
        put_bridge(shape, "beam.floor", x, y, layout.side)
        lipo = (layout.lipo_mm, middle_mm(parts, y), film / 2 + parts.lipo.height_mm.value / 2)
        shape.part(parts.lipo, "beam.floor", lipo, turned=True, marked=True)
        self._cut_usb_opening(shape, x)
        self._place_battery(shape, layout, y)
        # All wires count as one part in the module's middle.
        wires = (self["length"] / 2, across / 2, wall_mm(self["height"], parts) / 2)
        shape.part(parts.wiring, "beam.floor", wires)
        shape.graph.wires += _power_wires(parts)

    def _cut_usb_opening(self, shape: Shape, x: float) -> None:
        """Cut the openings of the left wall: for the USB plug, for the light, and two slots for the cable's tie
        above them.

        ``x`` is the middle of the boards. The light is beside the socket, where a plug hides it from straight ahead.
        So its window lies beside the plug, and one sees the light aslant from the front.
        """
        parts, assembly, z = self.parts, self.parts.assembly, usb_height_mm(self.parts)
        hole = plug_room_mm(parts.plugs.usb) + 2 * (parts.feather.usb.tolerance + assembly.slot_clearance_mm.value)
        shape.round_hole("beam.left", "USB", "opening", (x, z), hole)
        window = assembly.light_window_mm.value
        beside = x + (hole + window) / 2 + assembly.grip_gap_mm.value
        shape.round_hole("beam.left", "light", "opening", (beside, z), window)
        tie = assembly.tie_slot_mm.value
        slots_z = wall_mm(self["height"], parts) - assembly.fold_distance_mm.value - 1.5 * tie
        for name, side in (("tie 1", -1), ("tie 2", 1)):
            middle = (x + side * (assembly.tie_apart_mm.value + tie) / 2, slots_z)
            shape.rectangular_hole("beam.left", name, "slit", middle, tie / 2, tie)

    def _place_battery(self, shape: Shape, layout: Layout, boards_y: float) -> None:
        """Add pad and battery on the floor or on the roof, so far to one side of the car that they balance the boards.

        ``boards_y`` is y of the middle of the boards. The walls limit y of the battery.
        """
        parts, film, across = self.parts, self.parts.film_mm, wall_mm(self["width"], self.parts)
        battery, pad = parts.battery, parts.pad
        boards_kg = sum(part.mass_kg.value for part in (parts.feather, parts.featherwing, parts.lipo))
        reach = (across - film - (battery.length_mm if layout.turned else battery.width_mm).value) / 2
        # How far from the middle, on the other side, the battery would balance the boards. The y of lid and floor run in
        # opposite directions.
        offset = (boards_y - across / 2) * boards_kg / battery.mass_kg.value
        if parts.battery_place == "roof":
            self._place_on_roof(shape, layout.battery_mm, across / 2 + offset)
            return
        x, y = layout.battery_mm, across / 2 - min(max(offset, -reach), reach)
        # A second layer of film from wall to wall stiffens the floor. In a car of 95 mm, of 0.25 mm PET, the battery
        # (1.2 N, 31.5 mm wide) hangs by two strips L = 18 mm long: clamped at both ends they sag by
        # F L³ / (12 E I) = 1.6 mm, four times as much if the folds turn freely. Two layers are two to eight times
        # as stiff.
        along_mm, wide_mm = battery.size_mm[1::-1] if layout.turned else battery.size_mm[:2]
        low = max(x - along_mm / 2 - DOUBLER_EDGE_MM, -self["floor_rear"])
        high = min(x + along_mm / 2 + DOUBLER_EDGE_MM, self["length"] + self["floor_front"])
        clear_of_folds_mm = across - 2 * self.parts.assembly.fold_distance_mm.value
        size_mm = (high - low, max(clear_of_folds_mm, wide_mm + 2 * DOUBLER_EDGE_MM))
        middle = (low + high) / 2
        # An outline on the beam shows where the layer lies; the longer part beside the battery tells which way round.
        shape.mark("beam.floor", "floor doubler", rectangle_around((middle, across / 2), *size_mm))
        outline = rectangle_around((0.0, 0.0), *size_mm)
        shape.layer("floor doubler", "beam.floor", outline, (middle, across / 2), "floor doubler")
        z = film / 2 + film
        for part in (pad, battery):
            height, part_size = part.height_mm.value, part.size_mm[1::-1] if layout.turned else part.size_mm[:2]
            shape.mark("floor doubler", part.name, rectangle_around((x - middle, y - across / 2), *part_size))
            shape.part(part, "beam.floor", (x, y, z + height / 2), turned=layout.turned)
            z += height

    def _place_on_roof(self, shape: Shape, x: float, y: float) -> None:
        """Add pad and battery on the unprinted side of the lid, their middle at ``x``, and as near to ``y`` as its
        folds allow.

        Holes at the corners show their place on both sides. The lid's y runs from the left wall, and its z points
        into the car.
        """
        parts, assembly, film = self.parts, self.parts.assembly, self.parts.film_mm
        battery, corner = parts.battery, assembly.corner_hole_mm.value
        edge = assembly.fold_distance_mm.value + corner / 2
        lid_mm = shape.face_size_mm("beam.lid")[1]
        reach = lid_mm / 2 - edge - battery.length_mm.value / 2
        y = lid_mm / 2 + (min(max(y - lid_mm / 2, -reach), reach) if reach > 0 else 0.0)
        shape.part(parts.pad, "beam.lid", (x, y, -(film + parts.pad.height_mm.value) / 2), turned=True)
        battery_z = film / 2 + parts.pad.height_mm.value + battery.height_mm.value / 2
        hole = self._cut_lead_hole(shape, x + battery.width_mm.value / 2)
        # The leads pass the hole as one round of two wires.
        wire_mm, lid_z = parts.wiring.wire_diameter_mm.value, battery_z - film / 2
        lead = cylinder(2 * wire_mm, lid_z - 2 * wire_mm, lid_z + film + wire_mm, hole[0] - x, hole[1] - y)
        size = (battery.width_mm.value, battery.length_mm.value, battery.height_mm.value)
        solids = (Solid("box", size, IDENTITY), replace(lead, weightless=True))
        pose = translation(x, y, -battery_z)
        shape.box(battery.name, battery.name, "beam.lid", pose, size, battery.mass_kg.value, solids=solids)
        for part in (parts.pad, battery):
            half_length, half_width = part.length_mm.value / 2, part.width_mm.value / 2
            if lid_mm / 2 - abs(y - lid_mm / 2) - half_length >= edge - ROUNDING:
                corners = itertools.product((-half_width, half_width), (-half_length, half_length))
                for i, (dx, dy) in enumerate(corners, 1):
                    shape.round_hole("beam.lid", f"{part.name} corner {i}", "mark", (x + dx, y + dy), corner)

    def _cut_lead_hole(self, shape: Shape, end_mm: float) -> Point:
        """Cut a hole into the lid for the battery's leads, in front of the battery and near the left wall; return
        its middle.

        Raises ComponentError if the module is too short for battery, hole, latch, and fingers at the pull tab.
        """
        battery, assembly = self.parts.battery, self.parts.assembly
        hole, edge = assembly.lead_hole_mm.value, assembly.fold_distance_mm.value
        minimum = battery.width_mm.value + 2 * (2 * edge + hole)
        (notch, _), (finger, _) = latch_mm(self.parts), self.parts.tools.finger_mm
        latch = notch / 2 + max(notch, finger) / 2
        latch_end_mm = max(self[f"latch_{end}"] * (self[f"flap_{end}"] + latch) for end in ("front", "rear"))
        if latch_end_mm:
            minimum = max(minimum, battery.width_mm.max_value + 2 * (assembly.placement_mm.value + latch_end_mm))
        if self["length"] < minimum - ROUNDING:
            parts_text = f"the {battery.name} on the roof beside its lead and the lid's latch"
            raise self.parameter_error("length", _too_small(self["length"], minimum, parts_text))
        center = (end_mm + edge + hole / 2, edge + hole)
        shape.round_hole("beam.lid", "lead", "slit", center, hole)
        return center

    def _layouts(self) -> Iterator[Layout]:
        """Yield the possible layouts, also those for which the module is too short.

        If ``side`` is 1, the order along x is LiPo, boards, battery; if it is -1, the order is reversed. A battery on
        the floor lies along or across the car, if the floor is wide enough for that.
        """
        parts, length = self.parts, self["length"]
        # The battery's length along x (0 on the roof), ``side`` and ``turned`` of each layout.
        variants = [(0.0, -1, True)] if parts.battery_place == "roof" else self._floor_variants()
        for battery_mm, side, turned in variants:
            # The distance from the boards' middle to the battery's far end, or to the bridge's end under a roof battery.
            battery_end_mm = half_width_mm(parts) + parts.film_mm
            if battery_mm:
                # The LiPo's lead leaves the Feather at the front, so its plug is between boards and battery there.
                gap_mm = parts.assembly.part_gap_mm.value if side < 0 else parts.plugs.battery.length_mm.value
                battery_end_mm += gap_mm + battery_mm
            lipo_end_mm = self._lipo_end_mm()
            rear_mm, front_mm = (battery_end_mm, lipo_end_mm) if side < 0 else (lipo_end_mm, battery_end_mm)
            # The limits of the boards' middle, from the module's rear. Parts may reach into the neighbours' free floor.
            low = max(rear_mm - self["floor_rear"], self["usb_low"])
            high = min(length + self["floor_front"] - front_mm, self["usb_high"])
            boards_middle = min(max(length / 2, low), high)
            lipo_middle = boards_middle - side * (lipo_end_mm - parts.lipo.width_mm.value / 2)
            battery_middle = boards_middle + side * battery_end_mm - side * battery_mm / 2 if battery_mm else length / 2
            yield Layout(low, high, side, turned, boards_middle, lipo_middle, battery_middle)

    def _floor_variants(self) -> list[tuple[float, int, bool]]:
        """Return the ways to lay a battery on the floor, each as (length along x in mm, ``side``, whether it is turned).

        If ``side`` is 1, the battery is in front of the boards; if it is -1, behind them.
        """
        battery, floor_mm = self.parts.battery, self["width"] - 2 * self.parts.film_mm
        orientations = ((battery.width_mm, battery.length_mm, True), (battery.length_mm, battery.width_mm, False))
        return [
            (along.value, side, turned)
            for along, across, turned in orientations
            for side in (-1, 1)
            if across.max_value + 2 * self.parts.assembly.cut_mm.value <= floor_mm + ROUNDING
        ]

    def _lipo_end_mm(self) -> float:
        """Return the distance along x from the middle of the boards to the far side of the LiPo (mm).

        The flange of the bridge comes down beside the LiPo, which may lie anywhere within its outline.
        """
        assembly, lipo = self.parts.assembly, self.parts.lipo.width_mm
        gap_mm = assembly.placement_mm.value + lipo.tolerance / 2 + assembly.slot_clearance_mm.value
        return self.parts.film_mm / 2 + gap_mm + lipo.value - half_width_mm(self.parts)

    @property
    def layout(self) -> Layout:
        """The layout that fits, with the boards nearest to the middle of the module.

        Raises ComponentError if none fits.
        """
        battery, length, layouts = self.parts.battery, self["length"], list(self._layouts())
        if not layouts:
            min_width_part = min(size.max_value for size in (battery.length_mm, battery.width_mm))
            min_width = min_width_part + 2 * (self.parts.assembly.cut_mm.value + self.parts.film_mm)
            raise self.parameter_error("width", _too_small(self["width"], min_width, battery.name))
        fitting = [layout for layout in layouts if layout.missing_mm <= ROUNDING]
        if fitting:
            return min(fitting, key=lambda layout: abs(layout.boards_mm - length / 2))
        nearest = min(layouts, key=lambda layout: layout.missing_mm)
        parts_text = "the boards" if self.parts.battery_place == "roof" else f"the boards and the {battery.name}"
        if all(not layout.turned for layout in layouts):
            parts_text += f" lengthwise at width {self['width']:g}"
        if nearest.low == self["usb_low"] or nearest.high == self["usb_high"]:
            parts_text += ", with a USB plug clear of the tyres"
        raise self.parameter_error("length", _too_small(length, length + nearest.missing_mm, parts_text))


def _power_wires(parts: Catalogue) -> list[Wire]:
    """Return the wires between batteries, switch and boards."""
    feather, wing = parts.feather.name, parts.featherwing.name
    return [
        Wire(f"{feather} headers", f"{wing} headers", "stack", "the wing sits on the Feather: I2C on SDA 23 and SCL 22"),
        Wire(f"{parts.lipo.name}", f"{feather} JST", "supply", "3.7 V for the processor"),
        Wire(
            f"{parts.battery.name} +", f"{SERVO_SWITCH} 1", "supply", f"{parts.cells.supply_v.value:g} V for the servos"
        ),
        Wire(f"{SERVO_SWITCH} 2", f"{wing} terminal +", "supply", "switched"),
        Wire(f"{parts.battery.name} -", f"{wing} terminal -", "supply", "ground"),
        Wire(f"{BOARD_SWITCH} 1", f"{feather} EN", "control", "closed, it turns the board off"),
        Wire(f"{BOARD_SWITCH} 2", f"{feather} GND", "control", "ground"),
        *_option_wires(parts),
        Wire(f"{feather} USB", "computer", "usb", "to flash, and for trials by cable"),
    ]


def _option_wires(parts: Catalogue) -> list[Wire]:
    """Return the wires of the options that a car has."""
    feather, wing, wires = parts.feather.name, parts.featherwing.name, []
    if parts.button == "fitted":
        wires += [
            Wire(f"{BUTTON} 1", f"{feather} {BUTTON_PIN}", "control", "starts and stops a trial"),
            Wire(f"{BUTTON} 2", f"{feather} GND", "control", "ground"),
        ]
    if parts.divider == "fitted":
        wires.append(Wire(DIVIDER_UPPER, f"{wing} terminal +", "control", "measures the voltage of the servos' battery"))
    if parts.oe_wire == "fitted":
        wires.append(Wire(f"{feather} {OE_PIN}", f"{wing} #OE", "control", "ends the pulses while the board hangs"))
    return wires


def _too_small(value: float, needed: float, what: str) -> str:
    """Return the message for a size that is smaller than ``what`` needs (mm); the need is rounded up to 0.1 mm."""
    return f"{value:g} is below the minimum {math.ceil((needed - ROUNDING) * 10) / 10:g} ({what})"
