"""The step of the guide in which the boards' loose parts are soldered, with its picture.

Input: a car's catalogue and leads. Output: a Step. The makers sell both boards without their pins: the Feather's sockets
are bought apart, the wing's pins, servo blocks and terminal block lie in its bag.
"""

from collections.abc import Iterator

from markupsafe import Markup

from foldcar.car.components.bridge import BUTTON_PIN, DIVIDER_LOWER, DIVIDER_PIN, DIVIDER_UPPER, OE_PIN, OE_PULL_UP
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON
from foldcar.car.folded.model import FoldedCar
from foldcar.car.leads import leads
from foldcar.fabrication.assembly.guide_pictures import FlatPicture, Step
from foldcar.fabrication.assembly.operations import operations_of_boards
from foldcar.fabrication.assembly.wiring import lead_remedy
from foldcar.figures.page import page_template


def soldering_step(car: FoldedCar) -> Step:
    """Return the step that solders the boards of a car."""
    parts = car.parts
    template = page_template("foldcar.fabrication.assembly", "boards.svg")
    # The pins at which wires are soldered, each with the colour of its wire in the picture.
    wired = {"EN": "#c2272d", "GND": "#222222"}
    for option, pins in (("button", (BUTTON_PIN,)), ("divider", (DIVIDER_PIN,)), ("oe_wire", (OE_PIN, "3V"))):
        if getattr(parts, option) == "fitted":
            wired |= dict.fromkeys(pins, "#0072b2")
    picture = template.render(feather=parts.feather, wing=parts.featherwing, headers=parts.headers, wired=wired, zip=zip)
    return Step(
        "Solder the boards",
        tuple(_lines(car)),
        (FlatPicture(Markup(picture), "what goes where"),),
        operations_of_boards(car),
    )


def _lines(car: FoldedCar) -> Iterator[str]:
    parts, remedies = car.parts, {lead.start: lead_remedy(lead) for lead in leads(car)}
    at = parts.feather.pins.place_of
    feather, wing, headers, pins = parts.feather.name, parts.featherwing.name, parts.headers, parts.feather.pins
    long_row, short_row = len(pins.long_row), len(pins.short_row)
    depth_mm = headers.leg_mm.max_value - parts.feather.board_mm.value
    yield (
        f"The {feather}: put the {headers.name} on its upper side, and solder their {long_row + short_row} legs from "
        f"below. They end at most {depth_mm:.1f} mm below the board: cut longer ones. Never use stacking headers: their "
        "legs would reach "
        "the LiPo."
    )
    yield (
        f"The {wing}: break its strip of pins into {long_row} and {short_row}. Put their long ends into the "
        f"{feather}'s sockets, lay the wing on the short ends, and solder them from above: so they stand straight."
    )
    yield (
        "Take the wing off. Put both servo blocks and the terminal block on its upper side, the blocks' long pins up, "
        "the terminal block's mouths to the edge. Hold them with tape, turn the wing over, and solder one pin of each; "
        "look whether they stand straight; solder the others."
    )
    yield (
        f"Solder the free ends of the {BOARD_SWITCH}'s wires to the legs of EN and GND, below the {feather}: EN is the "
        "second of the 12 pins, GND the fourth of the 16, counted from USB. It does not matter which of the two wires is "
        "which. Cover the car below with cardboard."
    )
    if parts.button == "fitted":
        yield (
            f"Solder the free ends of the {BUTTON}'s wires to the legs of {at(BUTTON_PIN)} and GND, in the same way: "
            "twist what "
            "goes to GND together first."
        )
    if parts.divider == "fitted":
        yield (
            f"Below the {feather}, flat against the board, insulating sleeve over all bare leads: solder the "
            f"{DIVIDER_LOWER} "
            f"between the legs of {at(DIVIDER_PIN)} and GND, and one end of the {DIVIDER_UPPER} to the leg of "
            f"{DIVIDER_PIN}. Solder "
            f"{_wire(remedies[DIVIDER_UPPER])} to its other end; it goes into + of the terminal block, with the wire "
            "that is there. More than 3.3 V at the pin would damage it: measure both resistors first."
        )
    if parts.oe_wire == "fitted":
        yield (
            f"Below the {feather}: solder the {OE_PULL_UP}, in insulating sleeve, between the legs of {at(OE_PIN)} and "
            f"{at('3V')}. Solder "
            f"{_wire(remedies[f'{feather} {OE_PIN}'])} to the leg of {OE_PIN}, lead it around the edge of the {wing}, "
            "and solder it to #OE: pin 23 of the PCA9685, or that end of its 10 kΩ resistor to ground, which is larger. "
            "Take thin wire (30 AWG) and tape it to the board."
        )
    yield (
        f"Look at every joint: it does not touch its neighbour. With a multimeter: EN and GND are connected while the "
        f"{BOARD_SWITCH} is closed (I) and not while it is open, and EN is never connected with BAT, the first of the 12."
    )
    yield (
        f'Plug the {feather} into the computer and load the firmware, as "Load the firmware" below says: a board '
        f"that does not answer is easy to change now. The {BOARD_SWITCH} must be open."
    )


def _wire(remedy: str) -> str:
    """Return "75 mm of wire" of the instruction to cut it."""
    return remedy.removeprefix("cut ")
