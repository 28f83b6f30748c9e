"""The instructions for the switches and the button in the caps: their wires, the fuse, which side is up.

Input: an AssemblyStep. Output: lines of text. Wires are soldered before a switch is pressed into the film, which
heat bends.
"""

from collections.abc import Iterator

from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar
from foldcar.car.leads import leads
from foldcar.car.proof.step import AssemblyStep
from foldcar.car.supply import supply
from foldcar.fabrication.assembly.operations import soldered_in
from foldcar.fabrication.assembly.wiring import lead_remedy, wire_length_mm

# The fuse protects what is behind it: it is soldered near the holder, where a hand still holds the short end.
FUSE_FROM_HOLDER_MM = 30


def switch_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for soldering a switch, while no battery is in the car."""
    if not soldered_in(car, step):
        return
    (switch,) = (added.name for added in step.adds)
    remedies = {lead.start: lead_remedy(lead) for lead in leads(car)}
    gauge = f"{supply(car).gauge.awg} AWG"
    if switch == BUTTON:
        yield (
            f"Before: cut {_wires(remedies, BUTTON)}, {gauge}, black, and solder them to its terminals, away from the "
            "film, "
            "with heat-shrink tube over the joints. Then push the button through from the printed side, and screw its "
            "nut on "
            "from outside."
        )
        return
    cap = _cap_of(car, switch)
    up = next(join.number for join in car.joins if join.kind == "tuck" and cap in (join.piece_a, join.piece_b))
    side = f"As seen from outside, with join {up} up, the {switch} is on the {_side_of(switch, car)}"
    push = "Then push the wires through the opening from the front, and press the switch in until its barbs hold"
    if switch == BOARD_SWITCH:
        yield (
            f"Before: cut {_wires(remedies, switch)}, {gauge}, black, and solder them to its terminals, away from the "
            "film, "
            f"with heat-shrink tube over the joints. {push}."
        )
        yield (
            f"{side}, its end marked O to the right. Closed (I), it turns the board off: so both switches are on with "
            "the right "
            "end pressed."
        )
        return
    yield from _servo_switch_lines(car, remedies, f"{push}. {side}, its end marked I to the right.")


def _cap_of(car: FoldedCar, switch: str) -> str:
    """Return the name of the cap that a switch is in."""
    (hole,) = next(mount.holes for mount in car.mounts if mount.name == switch)
    return next(piece.name for piece in car.pieces if any(own.name == hole for face in piece.faces for own in face.holes))


# The lead of the holder is soldered to a piece of wire at the switch, away from the film, also if it is long enough.
LEAST_WIRE_MM = 30


def _servo_switch_lines(car: FoldedCar, remedies: dict[str, str], push: str) -> Iterator[str]:
    """Yield the instructions for soldering the servos' switch and the fuse; ``push`` is how the switch goes in."""
    battery = car.parts.battery.name
    lead_of = {lead.start: lead for lead in leads(car)}
    towards_holder_mm = max(LEAST_WIRE_MM, wire_length_mm(lead_of[f"{battery} +"]))
    yield (
        f"Before: cut {towards_holder_mm} mm and {wire_length_mm(lead_of[f'{SERVO_SWITCH} 2'])} mm of red wire, "
        f"{supply(car).gauge.awg} AWG, and solder them to its terminals, away from the film. Push heat-shrink tube over "
        "each "
        "wire first, here and below, and shrink it over the joint with a hot-air gun or a lighter."
    )
    yield push
    yield (
        f"Solder now, before the {car.parts.lipo.name} is in the car and with no cells in the holder, the film covered "
        "with "
        f"cardboard: cut the + lead of the {battery} (red) {FUSE_FROM_HOLDER_MM} mm from the holder, solder the fuse, "
        f"{supply(car).fuse_a:g} A, between both ends, and the end of the lead to the wire of {towards_holder_mm} mm. "
        "Tube goes "
        "over all three joints. Mark the other wire, which stays free, with +."
    )
    if remedies.get(f"{battery} -"):
        yield f"The - lead of the {battery} (black): {remedies[f'{battery} -']}."


def _wires(remedies: dict[str, str], name: str) -> str:
    """Return "195 mm and 220 mm of wire": the lengths of the two wires of a switch or the button."""
    first, second = (remedies[f"{name} {terminal}"].removeprefix("cut ") for terminal in (1, 2))
    return f"{first.removesuffix(' of wire')} and {second}"


def _side_of(switch: str, car: FoldedCar) -> str:
    """Return on which side a switch is as seen from outside: y of the car points left to somebody who looks forwards."""
    mount = next(mount for mount in car.mounts if mount.name == switch)
    looks_forwards = mount.pose[0][3] < 0
    return "left" if (mount.pose[1][3] > 0) == looks_forwards else "right"
