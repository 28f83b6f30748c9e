"""The instructions for the switches and the button in the caps: their wires, the fuse, which side is up.

Input: an AssemblyStep. Output: lines of text. Wires are soldered before a switch is pressed into the film, which
heat bends.
"""

from typing import NamedTuple

from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar
from foldcar.car.leads import leads
from foldcar.car.proof.step import AssemblyStep
from foldcar.car.supply import supply
from foldcar.fabrication.assembly.operations import soldered_in
from foldcar.fabrication.assembly.wiring import lead_remedy, wire_length_mm

# The fuse protects what is behind it: it is soldered near the holder, where a hand still holds the short end.
FUSE_FROM_HOLDER_MM = 30
# The lead of the holder is soldered to a piece of wire at the switch, away from the film, also if it is long enough.
LEAST_WIRE_MM = 30
TUBE = (
    "Push heat-shrink tube over each wire before you solder it. Shrink it over the joint with a hot-air gun or a lighter."
)


class LinesAround(NamedTuple):
    """The instructions before and after a part is put in."""

    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()


def switch_lines(car: FoldedCar, step: AssemblyStep) -> LinesAround:
    """Return the lines before a switch or the button is put in, and the lines after it; none for other steps.

    All this is done while no battery is in the car.
    """
    if not soldered_in(car, step):
        return LinesAround()
    (switch,) = (added.name for added in step.adds)
    before = (
        f"Cut {_wires_of(car, switch)}. Solder them to the terminals of the {switch}, away from the film.",
        TUBE,
    )
    if switch == BUTTON:
        return LinesAround(before, after=("Screw the button's nut on from outside.",))
    position = _position_line(car, switch)
    if switch == SERVO_SWITCH:
        return LinesAround(before, after=(position, *_fuse_lines(car)))
    return LinesAround(before, after=(position,))


def _wires_of(car: FoldedCar, switch: str) -> str:
    """Return the two wires of a switch or the button in words: their lengths, colour and gauge."""
    lead_of = {lead.start: lead for lead in leads(car)}
    second_mm = wire_length_mm(lead_of[f"{switch} 2"])
    if switch == SERVO_SWITCH:
        first_mm, colour = _towards_holder_mm(car), "red"
    else:
        first_mm, colour = wire_length_mm(lead_of[f"{switch} 1"]), "black"
    return f"{first_mm} mm and {second_mm} mm of {colour} wire, {supply(car).gauge.awg} AWG"


def _position_line(car: FoldedCar, switch: str) -> str:
    """Return the instruction for pressing a switch into a *cap*, the piece that closes an end of the car.

    It says on which side of the cap the switch lies, and which of its marked ends, I or O, is on the right.
    """
    cap = _cap_of(car, switch)
    # The cap has one join of this kind, with the lid. Its number is printed at the cap's upper edge.
    upper_join = next(join.number for join in car.joins if join.kind == "tuck" and cap in (join.piece_a, join.piece_b))
    mark, effect = "I", ""
    if switch == BOARD_SWITCH:
        mark = "O"
        effect = (
            " This switch works the other way round: pressed at the end marked I, it turns the board off. Mounted like "
            "this, both switches are on when their right ends are pressed."
        )
    return (
        "Push the wires through the opening first, and press the switch in until its barbs hold. As seen from outside, "
        f"with join {upper_join} at the top, the {switch} is on the {_side_of(switch, car)}, its end marked {mark} to "
        f"the right.{effect}"
    )


def _cap_of(car: FoldedCar, switch: str) -> str:
    """Return the name of the cap that a switch is in."""
    (hole,) = next(mount.holes for mount in car.mounts if mount.name == switch)
    return next(piece.name for piece in car.pieces if any(own.name == hole for face in piece.faces for own in face.holes))


def _towards_holder_mm(car: FoldedCar) -> int:
    """Return the length (mm) of the wire from the switch to the lead of the battery's holder."""
    lead_of = {lead.start: lead for lead in leads(car)}
    return max(LEAST_WIRE_MM, wire_length_mm(lead_of[f"{car.parts.battery.name} +"]))


def _fuse_lines(car: FoldedCar) -> tuple[str, ...]:
    """Return the instructions for soldering the fuse and the leads of the battery's holder."""
    battery = car.parts.battery.name
    lead_of = {lead.start: lead for lead in leads(car)}
    lines = [
        f"Solder now, before the {car.parts.lipo.name} is in the car and with no cells in the holder. Cover the film "
        "with cardboard.",
        f"First cut the + lead of the {battery} (red) {FUSE_FROM_HOLDER_MM} mm from the holder. Then solder the fuse, "
        f"{supply(car).fuse_a:g} A, between both ends, and the end of the lead to the wire of {_towards_holder_mm(car)} "
        "mm. Heat-shrink tube goes over all three joints. Mark the other wire, which stays free, with +.",
    ]
    # What makes the negative lead long enough, if it is too short.
    remedy = lead_remedy(lead_of[f"{battery} -"])
    if remedy:
        lines.append(f"The - lead of the {battery} (black): {remedy}, with heat-shrink tube over the joint.")
    return tuple(lines)


def _side_of(switch: str, car: FoldedCar) -> str:
    """Return on which side of its cap a switch lies, "left" or "right", as seen from outside the car."""
    mount = next(mount for mount in car.mounts if mount.name == switch)
    # x points forwards and y to the left. Somebody who looks at the rear cap looks forwards, so the left of the car is on
    # the left; at the front cap it is on the right.
    is_in_rear_cap = mount.pose[0][3] < 0
    is_left_in_car = mount.pose[1][3] > 0
    return "left" if is_left_in_car == is_in_rear_cap else "right"
