"""The settings that a module gets from its place in the car: its segment's ends, the floor beside it, the tyres next to
it.

Input: a design and the index of a module. Output: values by name, which the module's component takes beside its
parameters.
"""

import math

from foldcar.car.components.box_beam import flap_end_mm, latch_notch, wall_distance_mm
from foldcar.car.components.bridge import plug_room_mm, usb_height_mm
from foldcar.car.components.component import ROUNDING, minimum_text
from foldcar.car.components.module import BrainModule
from foldcar.car.components.mounts import button_depth_mm, servo_reach_mm, switch_depth_mm
from foldcar.car.components.rods import ROD_LAYER_MM
from foldcar.car.design import Design, DesignError, Segment

# Limit (mm) of the place of USB on a side without a tyre.
FAR_MM = 2000.0
# Minimum length (mm) of the fold of a lid's flap beside its latch.
MIN_FOLD_MM = 1.0


def switch_cap(design: Design) -> str:
    """Return the name of the cap at an end of the car that carries the switches.

    The cap that is nearer to the electronics gets them. If the electronics are in the first or the last module, there is
    no room at that end, and the cap at the other end gets the switches.
    """
    front_cap, rear_cap = "front cap 1", f"rear cap {len(design.segments)}"
    modules_in_front = design.electronics
    modules_behind = len(design.modules) - 1 - design.electronics
    if modules_in_front == 0:
        return rear_cap
    if modules_behind == 0:
        return front_cap
    return front_cap if modules_in_front <= modules_behind else rear_cap


def button_cap(design: Design) -> str:
    """Return the name of the outer cap that carries the button, if the car has one: the cap without switches."""
    return f"rear cap {len(design.segments)}" if switch_cap(design).startswith("front") else "front cap 1"


def _depth_behind_mm(design: Design, cap: str) -> float:
    """Return how far (mm) switches or the button reach into the car behind a cap; 0 if the cap has none of them."""
    if cap == switch_cap(design):
        return switch_depth_mm(design.parts)
    if cap == button_cap(design) and design.parts.button == "fitted":
        return button_depth_mm(design.parts)
    return 0.0


def settings_from_car(design: Design, module: int) -> dict[str, float]:
    """Return the settings that a module gets from its place in the car, by name. They do not exist for hinges.

    All modules have settings of their lid's flap, and wheel modules have some of their servos. The module with the
    electronics has the free length of the floor (mm) at its ends, and the limits (mm) of the place of the USB socket
    between the tyres.
    """
    settings = _flap_settings(design, module)
    if module in design.wheel_modules:
        settings |= _wheel_settings(design, module)
    if module == design.electronics:
        usb_low, usb_high = _between_tyres(design, module)
        settings |= {
            "floor_front": _free_floor_mm(design, module, -1),
            "floor_rear": _free_floor_mm(design, module, 1),
            "usb_low": usb_low,
            "usb_high": usb_high,
        }
    return settings


def _wheel_settings(design: Design, module: int) -> dict[str, float]:
    """Return the settings of a wheel module: where its servos point, and what the caps beside it need.

    The long sides of the servos point to the middle of the segment, the rigid part of the car to which the module
    belongs. ``towards_middle`` is 1 if this is forward, else -1. At the end to which they point, a cap may close the
    module; ``tab_depth`` is the depth (mm) of its tab, 0 without a cap. ``switch_depth`` is the depth (mm) of the
    switches if a cap of the module carries them, else 0.
    """
    segment = design.segment_of(module).modules
    # In a segment of several modules, another module is at the end to which the long sides point.
    is_alone = len(segment) == 1
    tab_mm = design.parts.assembly.cap_tab_mm.value if is_alone else 0.0
    module_at_cap = {
        _cap_name(design, module, "front"): segment[0],
        _cap_name(design, module, "rear"): segment[-1],
    }
    has_switches = module_at_cap.get(switch_cap(design)) == module
    return {
        "towards_middle": _towards_middle(design, module),
        "tab_depth": tab_mm,
        "switch_depth": switch_depth_mm(design.parts) if has_switches else 0.0,
    }


def _cap_name(design: Design, module: int, end: str) -> str:
    """Return the name of the cap at the front or rear end of a module's segment; caps count from 1."""
    return f"{end} cap {design.segment_at(module) + 1}"


def _towards_middle(design: Design, module: int) -> float:
    """Return 1 if the middle of its segment lies in front of the module's middle, else -1."""
    return -1.0 if design.module_centers_mm[module] > design.segment_of(module).center_mm else 1.0


def _flap_settings(design: Design, module: int) -> dict[str, float]:
    """Return the settings of a module's part of the flap, which hangs along the lid of its segment.

    There are three settings for each END of the module, ``front`` and ``rear``. ``flap_END`` is the distance (mm) of the
    flap from that end; it is 0 unless a cap closes the end. ``latch_END`` is 1 if the flap has a latch there, else 0.
    ``pull_END`` is 1 if the lid's pull tab is at this latch, else 0. Raises DesignError if the module is too short for
    its latch.
    """
    segment = design.segment_of(module)
    module_at_end = {"front": segment.modules[0], "rear": segment.modules[-1]}
    latched_ends = _latched_ends(design, segment)
    settings: dict[str, float] = {}
    for end in ("front", "rear"):
        is_at_end = module == module_at_end[end]
        has_latch = is_at_end and end in latched_ends
        has_pull_tab = has_latch and end == latched_ends[0]
        settings[f"flap_{end}"] = flap_end_mm(design.parts) if is_at_end else 0.0
        settings[f"latch_{end}"] = float(has_latch)
        settings[f"pull_{end}"] = float(has_pull_tab)
    # The flap needs some fold beside a latch. A segment of a single module has caps at both ends of this module.
    notch_mm = latch_notch(design.parts).length_mm
    min_length = notch_mm + MIN_FOLD_MM + settings["flap_front"] + settings["flap_rear"]
    length, needs_latch = design.length_of(module), settings["latch_front"] or settings["latch_rear"]
    if needs_latch and length < min_length - ROUNDING:
        key = design.of_modules[module].keys.get("length")
        reason = "the latch of a segment's lid"
        raise DesignError(key, f"{length:g} is below the minimum {minimum_text(min_length)} ({reason})")
    return settings


def _latched_ends(design: Design, segment: Segment) -> list[str]:
    """Return the ends of a segment at which its lid has a latch; the pull tab is at the first of them.

    A long flap has latches at both ends, a short one only at the end with the longer module.
    """
    flap_length_mm = segment.length_mm - 2 * flap_end_mm(design.parts)
    if flap_length_mm > design.parts.assembly.lock_distance_mm.value:
        return ["front", "rear"]
    front_module, rear_module = segment.modules[0], segment.modules[-1]
    return ["front"] if design.length_of(front_module) >= design.length_of(rear_module) else ["rear"]


def _free_floor_mm(design: Design, module: int, step: int) -> float:
    """Return how much floor (mm) is free in front of a module (``step`` -1) or behind it (``step`` 1).

    ``step`` leads from a module's index to that of the next module in this direction; indices count from the front.
    The free floor ends at the next servo or rod, at a user's module, or at the cap of the segment. A cap takes a part of
    the floor itself, because its tab lies on the floor and its switches or its button reach into the car. So the result
    is negative if a cap is next to the module.
    """
    free_mm = 0.0
    neighbour = module + step
    while neighbour in design.segment_of(module).modules:
        if neighbour in design.wheel_modules:
            to_axle_mm = design.length_of(neighbour) / 2
            return free_mm + to_axle_mm - _reach_mm(design, neighbour, step)
        if design.modules[neighbour] != BrainModule.letter:
            return free_mm
        free_mm += design.length_of(neighbour)
        neighbour += step
    cap = _cap_name(design, module, "front" if step < 0 else "rear")
    tab_mm, gap_mm = design.parts.assembly.cap_tab_mm.value, design.parts.assembly.part_gap_mm.value
    # A part must keep a gap to the switches. It may touch the tab.
    taken_by_cap_mm = max(tab_mm, _depth_behind_mm(design, cap) + gap_mm)
    return free_mm - taken_by_cap_mm


def _reach_mm(design: Design, wheel_module: int, step: int) -> float:
    """Return how far (mm) the parts on the walls of a wheel module reach from its axis towards the front (``step`` 1) or
    the rear (``step`` -1).
    """
    if not design.of(wheel_module, "driven"):
        return ROD_LAYER_MM
    servo = servo_reach_mm(design.parts)
    points_there = _towards_middle(design, wheel_module) == step
    return servo.long_mm if points_there else servo.short_mm


def _between_tyres(design: Design, module: int) -> tuple[float, float]:
    """Return the range of x (mm from the rear of the module) in which a USB plug does not touch the tyres beside it.

    Seen from the side, plug and tyre are circles with a gap between them, so their centres must be at least ``reach``
    apart. The plug is higher than the axles by ``usb_offset_mm``. The horizontal offset from an axle is the other leg
    of a right triangle. An end is at FAR_MM if no tyre limits it.
    """
    rear = design.module_centers_mm[module] - design.length_of(module) / 2
    gap = design.parts.assembly.part_gap_mm.value
    # Height of the plug over the axles.
    usb_offset_mm = usb_height_mm(design.parts) - wall_distance_mm(design.height_mm, design.parts) / 2
    low, high = -FAR_MM, FAR_MM
    for x, radius in zip(design.axles_mm, design.radii_mm, strict=True):
        reach = radius + plug_room_mm(design.parts.plugs.usb) / 2 + gap
        min_offset = math.sqrt(max(reach**2 - usb_offset_mm**2, 0.0))
        if x < rear:
            low = max(low, x + min_offset - rear)
        elif x > rear:
            high = min(high, x - min_offset - rear)
    return low, high
