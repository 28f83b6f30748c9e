"""The wiring: servo and direction of each output of the servo driver, the supplies, the length of every lead.

Input: a FoldedCar. Output: Markdown; a drawing as SVG, in millimetres of a page, the car's front up. Outputs are numbered
from 0 as on the board, channels from 1 as in the firmware's parameter names.
"""

import math
from dataclasses import dataclass

from foldcar.car.components.bridge import BUTTON_PIN, DIVIDER_PIN, OE_PIN
from foldcar.car.components.mounts import SERVO_SWITCH
from foldcar.car.folded.model import FoldedCar
from foldcar.car.leads import Lead, leads
from foldcar.car.supply import fresh_cells_warning, supply
from foldcar.figures.page import page_template

# An optional wire to the servo driver's output enable has a pull-up that holds the enable off while the board's pin
# floats, against the wing's 10 kΩ to ground. The chip needs 0.7 of its supply.
OE_PULL_UP_OHM = 2200.0
OE_PULL_DOWN_OHM, LOGIC_V, OE_OFF_SHARE = 10e3, 3.3, 0.7
# Thin wire does not tear the pad off.
OE_WIRE_AWG = 30
# Two optional resistors from the servos' battery to an analogue pin. Four fresh alkaline cells have the highest voltage.
DIVIDER_UPPER_OHM, DIVIDER_LOWER_OHM, HIGHEST_SERVO_V = 20e3, 10e3, 6.4
CARRIES = {"signal": "signal", "supply": "supply", "stack": "plugged together", "usb": "USB", "control": "control"}
OUTPUTS = 8


def wiring_text(folded: FoldedCar, title: str) -> str:
    """Return the text on the car's wiring as Markdown."""
    parts = folded.parts
    axles = sorted((axle for axle in folded.axles if axle.driven), key=lambda axle: axle.channel)
    return page_template("foldcar.fabrication.assembly", "wiring.md").render(
        title=title,
        parts=parts,
        wing=parts.featherwing.name,
        feather=parts.feather.name,
        battery=parts.battery,
        wiring=parts.wiring,
        axles=axles,
        free=[output for output in range(OUTPUTS) if output not in {axle.channel for axle in axles}],
        switched=_is_switched(folded),
        supply=supply(folded),
        warning=fresh_cells_warning(parts),
        others=[wire for wire in folded.wires if wire.carries != "signal"],
        carries=CARRIES,
        hinges=folded.hinges,
        leads=[(lead, _lead_note(lead)) for lead in leads(folded)],
        gpio=OE_PIN,
        pull_up_ohm=OE_PULL_UP_OHM,
        off_v=LOGIC_V * OE_PULL_DOWN_OHM / (OE_PULL_DOWN_OHM + OE_PULL_UP_OHM),
        least_off_v=OE_OFF_SHARE * LOGIC_V,
        button_gpio=BUTTON_PIN,
        servo_gpio=DIVIDER_PIN,
        divider_upper_ohm=DIVIDER_UPPER_OHM,
        divider_lower_ohm=DIVIDER_LOWER_OHM,
        divider=(DIVIDER_UPPER_OHM + DIVIDER_LOWER_OHM) / DIVIDER_LOWER_OHM,
        divider_v=HIGHEST_SERVO_V * DIVIDER_LOWER_OHM / (DIVIDER_UPPER_OHM + DIVIDER_LOWER_OHM),
    )


@dataclass(frozen=True, slots=True)
class OptionalPart:
    """A part that a maker may add: its purpose, what it is, words to search a shop with."""

    purpose: str
    part: str
    search: str


def optional_parts(folded: FoldedCar) -> tuple[OptionalPart, ...]:
    """Return electronic parts that a maker may add to this car: what each is for, what it is, and what to search for.

    The text on the car's wiring says how to add them. All but the capacitor are options that a design can choose. An
    option that this design has already is left out.
    """
    capacitor_text = f"capacitor, {supply(folded).capacitor_uf} µF or more, 10 V"
    capacitor = OptionalPart("steadier servos' supply", capacitor_text, "electrolytic capacitor 10 V")
    divider = f"{DIVIDER_UPPER_OHM / 1000:g} kΩ and {DIVIDER_LOWER_OHM / 1000:g} kΩ"
    # The keys are the names of the options in the catalogue of parts. ``oe_wire`` is a wire to #OE, the input of the
    # servo driver that enables its outputs.
    by_option = {
        "oe_wire": OptionalPart(
            "no pulses while the board hangs", f"resistor, {OE_PULL_UP_OHM / 1000:g} kΩ", "resistor 1/4 W"
        ),
        "button": OptionalPart(
            "button to drive alone", folded.parts.push_button.name, "PBS-110 momentary push button 7 mm"
        ),
        "divider": OptionalPart(
            "voltage of the servos' battery", f"resistors, {divider}, 1 %", "metal film resistor 1/4 W 1 %"
        ),
    }
    missing_options = [part for option, part in by_option.items() if getattr(folded.parts, option) == "none"]
    return (capacitor, *missing_options)


def _is_switched(folded: FoldedCar) -> bool:
    return any(wire.a.startswith(SERVO_SWITCH) for wire in folded.wires)


def _lead_note(lead: Lead) -> str:
    """Return on which side a lead leaves the battery, and how it is made long enough; "" if neither is known."""
    side = f"leaves the battery on the {lead.leaves}" if lead.leaves else ""
    spare_mm = lead.available_mm - lead.needed_mm
    tight = f"only {spare_mm:.0f} mm to spare: measure it before you build" if 0 <= spare_mm < TIGHT_MM else ""
    return "; ".join(text for text in (side, lead_remedy(lead), tight) if text)


# A lead with less to spare (mm) is named: parts of other makers may be shorter than the data say.
TIGHT_MM = 10.0


def lead_remedy(lead: Lead) -> str:
    """Return the instruction that makes a lead long enough; "" if it is long enough."""
    wire_mm = wire_length_mm(lead)
    if lead.kind == "wire":
        return f"cut {wire_mm} mm of wire"
    if lead.kind == "solder":
        return f"solder {wire_mm} mm of wire to it" if wire_mm else ""
    return f"with {lead.extension}" if lead.extension else ""


def wire_length_mm(lead: Lead) -> int:
    """Return the length of wire to add to a lead, rounded up to 5 mm."""
    return math.ceil(lead.missing_mm / 5) * 5


def wiring_drawing(folded: FoldedCar, title: str) -> str:
    """Return a drawing of the car's wiring as SVG. Its coordinates are mm on a page."""
    car_leads = leads(folded)
    # The leads to which wire is soldered, so the drawing gives the length of the wire.
    wires = [lead for lead in car_leads if lead.kind == "solder" or lead.start.startswith(SERVO_SWITCH)]
    # The name of an extension ends with its length: "servo extension, 150 mm".
    extension_lengths = {lead.start: lead.extension.rpartition(", ")[2] for lead in car_leads if lead.extension}
    axles = {axle.channel: axle for axle in folded.axles if axle.driven}
    page = page_template("foldcar.fabrication.assembly", "wiring.svg").render(
        title=title,
        parts=folded.parts,
        axles=[axles.get(output) for output in range(OUTPUTS)],
        extended=extension_lengths,
        switched=_is_switched(folded),
        lengths=[(lead, f"{wire_length_mm(lead)} mm") for lead in wires if lead.missing_mm > 0],
        fuse_a=supply(folded).fuse_a,
        gpio=OE_PIN,
        pull_up_ohm=OE_PULL_UP_OHM,
    )
    return page + "\n"
