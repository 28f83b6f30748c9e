"""The step of the guide in which the boards' loose parts are soldered, with its picture.

Input: a car's catalogue and leads. Output: a Step. The makers sell both boards without their pins: the Feather's sockets
are bought apart, the wing's pins, servo blocks and terminal block lie in its bag.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from markupsafe import Markup

from foldcar.car.components.bridge import (
    BUTTON_PIN,
    DIVIDER_LOWER,
    DIVIDER_PIN,
    DIVIDER_UPPER,
    OE_PIN,
    OE_PULL_UP,
    option_resistors,
)
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON
from foldcar.car.folded.model import FoldedCar, Point
from foldcar.car.leads import leads
from foldcar.car.parts.catalogue import Catalogue
from foldcar.fabrication.assembly.guide_pictures import FlatPicture, Step
from foldcar.fabrication.assembly.operations import operations_of_boards
from foldcar.fabrication.assembly.wiring import OE_WIRE_AWG, lead_remedy
from foldcar.figures.page import page_template

# The board switch's pins, as in components/wires.py, and the first pin beside EN, at the LiPo.
ENABLE_PIN, GROUND_PIN, SUPPLY_PIN, LIPO_PIN = "EN", "GND", "3V", "BAT"
# The pins to which each option's wires and resistors are soldered.
PINS_OF_OPTIONS = {"button": (BUTTON_PIN,), "divider": (DIVIDER_PIN,), "oe_wire": (OE_PIN, SUPPLY_PIN)}
# The pins at the ends of each resistor, the end nearer to USB first; "" where a wire goes on.
PINS_OF_RESISTORS = {
    DIVIDER_LOWER: (GROUND_PIN, DIVIDER_PIN),
    DIVIDER_UPPER: (DIVIDER_PIN, ""),
    OE_PULL_UP: (SUPPLY_PIN, OE_PIN),
}
RED, BLACK, BLUE = "#c2272d", "#222222", "#0072b2"


@dataclass(frozen=True, slots=True)
class _Resistor:
    """A resistor below the Feather: the middle of it in the frame of the board (mm), and the pins at its ends."""

    name: str
    at_mm: Point
    pins: tuple[str, str]


def soldering_step(car: FoldedCar) -> Step:
    """Return the step that solders the boards of a car."""
    parts = car.parts
    # The wing, the upper board, drives the servos. Its input #OE (output enable) switches them off. It is accessible at
    # two places: the pad to which a wire can be soldered, and the pin of the chip.
    enable_pad_mm, chip_pin_mm = parts.featherwing.output_enable.at_mm
    picture = page_template("foldcar.fabrication.assembly", "boards.svg").render(
        feather=parts.feather,
        wing=parts.featherwing,
        headers=parts.headers,
        wired=wired_pins(parts),
        resistors=[_Resistor(name, at, PINS_OF_RESISTORS[name]) for name, at in option_resistors(parts).items()],
        resistor_mm=parts.resistor.size_mm,
        enable_mm=enable_pad_mm if parts.oe_wire == "fitted" else None,
        chip_pin_mm=chip_pin_mm,
        zip=zip,
    )
    return Step(
        "Solder the boards",
        tuple(_lines(car)),
        (FlatPicture(Markup(picture), "what goes where"),),
        operations_of_boards(car),
    )


def wired_pins(parts: Catalogue) -> dict[str, str]:
    """Return the Feather's pins to which wires or resistors are soldered, each with its colour in the picture."""
    wired = {ENABLE_PIN: RED, GROUND_PIN: BLACK}
    for option, pins in PINS_OF_OPTIONS.items():
        if getattr(parts, option) == "fitted":
            wired |= dict.fromkeys(pins, BLUE)
    return wired


def _lines(car: FoldedCar) -> Iterator[str]:
    """Yield the instructions: sockets, pins and blocks, the wires below the Feather, the checks."""
    parts = car.parts
    at = parts.feather.pins.place_of
    feather, wing, headers, pins = parts.feather.name, parts.featherwing.name, parts.headers, parts.feather.pins
    long_row, short_row = len(pins.long_row), len(pins.short_row)
    depth_mm = headers.leg_mm.max_value - parts.feather.board_mm.value
    yield (
        f"Put the {headers.name} on the upper side of the {feather}. Turn both over, and solder the "
        f"{long_row + short_row} legs from below. The legs end at most {depth_mm:.1f} mm below the board: cut longer "
        "ones. Never use stacking headers: their legs would reach the LiPo."
    )
    yield (
        f"Break the pins of the {wing} into a row of {long_row} and a row of {short_row}. Put their long ends into the "
        f"sockets of the {feather}. Lay the wing on the short ends, and solder them from above: so they stand straight."
    )
    yield (
        "Take the wing off. Put both servo blocks and the terminal block on its upper side. The blocks' long pins stand "
        "up, the terminal block's mouths look to the edge. Hold them with adhesive tape, turn the wing over, and solder "
        "one pin of each. Look whether they stand straight; then solder the other pins."
    )
    yield (
        f"Cover the car with cardboard. Turn the {feather} over about its long edge, so that USB stays on the left: "
        "now both rows are mirrored, as the picture from below shows."
    )
    yield (
        f"Solder the free ends of the {BOARD_SWITCH}'s wires to the legs of {at(ENABLE_PIN)} and {at(GROUND_PIN)}. Pins "
        "count from USB. It does not matter which of the two wires is which."
    )
    yield from _option_lines(car)
    yield (
        "Look at every joint: it does not touch its neighbour. Measure with a multimeter: EN and GND are connected while "
        f"the {BOARD_SWITCH} is closed (I), and not while it is open. EN is never connected with {at(LIPO_PIN)}."
    )
    yield (
        f'Open the {BOARD_SWITCH}. Plug the {feather} into the computer, and load the firmware as "Load the firmware" '
        "below says: a board that does not answer is easy to change now."
    )


def _option_lines(car: FoldedCar) -> Iterator[str]:
    """Yield the instructions for the wires and resistors of the options that the car has."""
    parts, remedies = car.parts, {lead.start: lead_remedy(lead) for lead in leads(car)}
    at, feather, wing = parts.feather.pins.place_of, parts.feather.name, parts.featherwing.name
    if parts.button == "fitted":
        yield (
            f"Solder the free ends of the {BUTTON}'s wires to the legs of {at(BUTTON_PIN)} and {at(GROUND_PIN)}. If "
            "several wires go to one leg, twist their ends together first."
        )
    if parts.divider == "fitted":
        yield (
            f"Measure both resistors first: more than 3.3 V at {DIVIDER_PIN} would damage the board. Push insulating "
            f"sleeve over their leads, and lay them flat against the underside. Solder the {DIVIDER_LOWER} between the "
            f"legs of {at(DIVIDER_PIN)} and {at(GROUND_PIN)}, and one end of the {DIVIDER_UPPER} to the leg of "
            f"{DIVIDER_PIN}."
        )
        yield (
            f"Solder {_wire(remedies[DIVIDER_UPPER])} to the other end of the {DIVIDER_UPPER}, with heat-shrink tube "
            "over the joint. The wire goes into + of the terminal block later, beside the wire of the servo switch."
        )
    if parts.oe_wire == "fitted":
        yield (
            f"Push insulating sleeve over the leads of the {OE_PULL_UP}, and solder it between the legs of {at(OE_PIN)} "
            f"and {at(SUPPLY_PIN)}."
        )
        yield (
            f"Find #OE on the {wing}: two small parts lie between the chip PCA9685 and the row of 12 pins. The one "
            "nearer to USB is a 10 kΩ resistor, and its end nearer to USB is #OE. Measure before you solder, with a "
            "multimeter and without power: this end is connected with pin 23 of the chip, and the other end with GND. If "
            "they are not, the board is another one: solder to what is connected with pin 23."
        )
        yield (
            f"Solder {_wire(remedies[f'{feather} {OE_PIN}'])}, {OE_WIRE_AWG} AWG, to the leg of {OE_PIN}. Lead it around "
            f"the edge of the {wing}, solder it to that end of the resistor, and stick it to the wing with adhesive tape."
        )


def _wire(remedy: str) -> str:
    """Return the words for a piece of wire in the instruction to cut it, such as "75 mm of wire"."""
    return remedy.removeprefix("cut ")
