"""The instructions for plugs, wires and leads: where they are plugged in, and where the rest of a long lead lies.

Input: an AssemblyStep. Output: lines of text.
"""

import math
from collections.abc import Iterator

from foldcar.car.components.bridge import DIVIDER_UPPER
from foldcar.car.components.mounts import BOARD_SWITCH, SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar, Wire
from foldcar.car.leads import leads
from foldcar.car.proof.step import AssemblyStep
from foldcar.fabrication.assembly.insertion_words import join_words
from foldcar.fabrication.assembly.operations import plugs_in

# The rest of a lead is folded to and fro to a bundle of this length, about that of a servo; a shorter rest stays loose.
BUNDLE_MM = 40.0


def plug_lines(car: FoldedCar, step: AssemblyStep) -> Iterator[str]:
    """Yield the instructions for the plugs and wires of a step. Extension cables of servos come first.

    ``a`` and ``b`` are the names of the two ends of a wire. For a servo with an extension cable, the wire for its signal
    goes from the extension to the servo. A wire ends at the LiPo battery or at a screw terminal, for example.
    """
    wires = plugs_in(car, step)
    part_of_mount = {mount.name: mount.part for mount in car.mounts}
    signals = [wire for wire in wires if wire.carries == "signal"]
    servos_by_extension: dict[str, list[str]] = {}
    for wire in (wire for wire in signals if wire.a in part_of_mount):
        servos_by_extension.setdefault(part_of_mount[wire.a], []).append(f"the {wire.b}")
    for extension, servos in servos_by_extension.items():
        each_text = ", each" if len(servos) > 1 else ""
        yield f"Plug {join_words(servos)} into a {extension}{each_text}. Tape the joints to the floor."
    if signals:
        servo_count = sum(axle.driven for axle in car.axles)
        yield (
            f"Plug {servo_count} servos in, each onto the output that its lead is marked with. Turn the plug so that its "
            "brown lead, ground, is at the pin beside which GND is printed."
        )
        if car.hinges:
            yield "Lead cables between segments through the openings of the caps, with a loop at each hinge."
        yield from _rest_lines(car)
    if any(wire.a == car.parts.lipo.name for wire in wires):
        yield (
            f"Turn the {BOARD_SWITCH} off before you plug the {car.parts.lipo.name} in. Compare the lead's red wire with "
            "the + on the board. The plugs of some sellers are crossed: never plug such a one in."
        )
    for wire in wires:
        if wire.carries != "signal":
            yield _connection(car, wire)
    if any(wire.b.startswith(f"{car.parts.featherwing.name} terminal") for wire in wires):
        if car.parts.divider == "fitted":
            yield f"Put the wire of the {DIVIDER_UPPER} into + of the terminal block too."
        yield "+ and - are printed beside the terminal block. Bare 5 mm of each wire, tighten its screw, and tug at it."


def _connection(car: FoldedCar, wire: Wire) -> str:
    """Return the instruction to plug in a wire that carries no servo's signal."""
    parts = car.parts
    if wire.carries == "stack":
        return (
            f"Press the pins of the {parts.featherwing.name} into the sockets of the {parts.feather.name}, without a pin "
            "beside its socket."
        )
    if wire.a == parts.lipo.name:
        return f"Plug the {wire.a} into the socket JST of the {parts.feather.name}."
    # All others lead to the terminal block: their ends are called "… terminal +" or "… terminal -".
    _, _, terminal = wire.b.rpartition(" ")
    if wire.a.startswith(SERVO_SWITCH):
        start = f"free wire of the {SERVO_SWITCH}"
    else:
        # The leads of the battery are called "battery +" and "battery -".
        battery, _, sign = wire.a.rpartition(" ")
        start = f"{sign} lead of the {battery}"
    return f"Put the {start} into {terminal} of the terminal block: it carries {NOTES[terminal]}."


# What the terminals carry.
NOTES = {"+": "the voltage for the servos", "-": "ground"}


def rests_mm(car: FoldedCar) -> dict[str, float]:
    """Return how much of each servo's lead is left over (mm), by servo.

    A short rest, which needs no bundle, is left out.
    """
    servos = {axle.servo for axle in car.axles}
    rests = {lead.start: lead.available_mm - lead.needed_mm for lead in leads(car) if lead.start in servos}
    return {name: rest for name, rest in rests.items() if rest >= BUNDLE_MM}


def _rest_lines(car: FoldedCar) -> Iterator[str]:
    """Yield what to do with servo leads that are much longer than they need to be; nothing if there are none."""
    excess_lengths = []
    for servo, excess_mm in rests_mm(car).items():
        rounded_down_mm = math.floor(excess_mm / 10) * 10
        excess_lengths.append(f"{servo} {rounded_down_mm} mm")
    if excess_lengths:
        yield (
            f"Some leads are longer than they need to be: {join_words(excess_lengths)}. Fold this rest to and fro in "
            f"lengths of {BUNDLE_MM:g} mm, and tie it with a cable tie. Lay it on the floor below its servo, beside the "
            "wall: no wheel, lid or battery meets it there."
        )
