"""What a module of a car must know of the others: its segment's ends, the floor beside it, the tyres next to it.

Input: a design and a module's index. Output: values of the module's internal parameters (mm).
"""

import math

from foldcar.car.compiler.parameter import ROUNDING, at_least
from foldcar.car.components.boards import plug_room_mm
from foldcar.car.components.box_beam import flap_end_mm, latch_mm, wall_mm
from foldcar.car.components.brain_module import BrainModule
from foldcar.car.components.bridge import usb_height_mm
from foldcar.car.components.servo_mount import inside_mm
from foldcar.car.components.switch_mount import depth_mm
from foldcar.car.components.wheel_module import WheelModule
from foldcar.car.design import Design, DesignError

# As far as a floor reaches where no tyre limits the place of USB.
FAR_MM = 2000.0
# The fold of a lid's flap beside its latch is at least so long.
LEAST_FOLD_MM = 1.0


def electronics(design: Design) -> int:
    """The index of the module that carries boards and batteries: the first B."""
    return design.modules.index(BrainModule.letter)


def switch_cap(design: Design) -> str:
    """The outer cap that carries the switch: the one nearer to the electronics, but not at their own end."""
    index, last = electronics(design), len(design.modules) - 1
    rear = f"rear cap {len(design.segments)}"
    if index == 0:
        return rear
    return "front cap 1" if index == last or index <= last - index else rear


def around(design: Design, module: int) -> dict[str, float]:
    """Values of the internal parameters of a module that is no hinge; those that it lacks are left out."""
    known = _flap(design, module)
    if design.modules[module] == WheelModule.letter:
        known |= {"towards_middle": _towards_middle(design, module), "tab_there": _tab_there(design, module)}
    if module == electronics(design):
        known |= {"floor_front": _floor(design, module, -1), "floor_rear": _floor(design, module, 1)}
        known |= dict(zip(("usb_low", "usb_high"), _between_tyres(design, module), strict=True))
    return known


def _towards_middle(design: Design, module: int) -> float:
    middle = design.segments[design.segment_at(module)].center_mm
    return -1.0 if design.module_centers_mm[module] > middle else 1.0


def _tab_there(design: Design, module: int) -> float:
    """The depth of the caps' tabs (mm) if the module is a segment of its own, else 0: no cap is at its inner end."""
    alone = len(design.segments[design.segment_at(module)].modules) == 1
    return design.parts.assembly.cap_tab_mm.value if alone else 0.0


def _length(design: Design, module: int) -> float:
    return design.values[f"{design.modules[module]}.length"]


def _flap(design: Design, module: int) -> dict[str, float]:
    """Where the lid's flap ends on a module; the latches, one at each end of a long segment, and at one the pull tab."""
    segment = design.segments[design.segment_at(module)]
    end, (notch, _) = flap_end_mm(design.parts), latch_mm(design.parts)
    ends = {"front": segment.modules[0], "rear": segment.modules[-1]}
    long = segment.length_mm - 2 * end > design.parts.assembly.lock_distance_mm.value
    known = {f"flap_{at}": end if module == outer else 0.0 for at, outer in ends.items()}
    latched = list(ends) if long else [max(ends, key=lambda at: _length(design, ends[at]))]
    for at in (at for at in latched if module == ends[at]):
        both = known["flap_front"] and known["flap_rear"]
        least = notch + LEAST_FOLD_MM + end * (2 if both else 1)
        if _length(design, module) < least - ROUNDING:
            key, value = f"{design.modules[module]}.length", _length(design, module)
            raise DesignError(key, f"{value:g} is below the minimum {at_least(least)} (the latch of a segment's lid)")
        known |= {f"latch_{at}": 1.0, f"pull_{at}": float(at == latched[0])}
    return dict.fromkeys((f"{what}_{at}" for what in ("latch", "pull") for at in ends), 0.0) | known


def _floor(design: Design, module: int, step: int) -> float:
    """Free floor (mm) before (``step`` -1) or behind (1) a module, up to a servo's layer, a cap's tab or the switch."""
    modules = design.segments[design.segment_at(module)].modules
    free, i = 0.0, module + step
    while i in modules:
        if design.modules[i] == WheelModule.letter:
            long, short = inside_mm(design.parts)
            # The long side points forward if ``towards_middle`` is 1.
            return free + _length(design, i) / 2 - (long if _towards_middle(design, i) == step else short)
        if design.modules[i] != BrainModule.letter:
            return free
        free += _length(design, i)
        i += step
    end = "front" if step < 0 else "rear"
    cap = f"{end} cap {design.segment_at(module) + 1}"
    gap = design.parts.assembly.part_gap_mm.value
    depth = depth_mm(design.parts) + gap if cap == switch_cap(design) else 0.0
    return free - max(design.parts.assembly.cap_tab_mm.value, depth)


def _between_tyres(design: Design, module: int) -> tuple[float, float]:
    """Where a USB plug passes the tyres next to the module (mm from its rear)."""
    rear = design.module_centers_mm[module] - _length(design, module) / 2
    gap = design.parts.assembly.part_gap_mm.value
    reach = design.values["radius"] + plug_room_mm(design.parts.plugs.usb) / 2 + gap
    off = usb_height_mm(design.parts) - wall_mm(design.values["height"], design.parts) / 2
    need = math.sqrt(max(reach**2 - off**2, 0.0))
    axles = design.axles_mm
    low = max((x + need - rear for x in axles if x < rear), default=-FAR_MM)
    return low, min((x - need - rear for x in axles if x > rear), default=FAR_MM)
