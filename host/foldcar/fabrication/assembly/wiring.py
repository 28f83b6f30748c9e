"""The wiring as text: servo and direction of each output of the servo driver, the supplies, the length of every lead.

Input: a FoldedCar. Output: Markdown. Outputs count from 0 as on the board, channels from 1 as in the firmware's
parameter names.
"""

import math

from foldcar.car.folded.model import FoldedCar
from foldcar.car.leads import Lead, leads

SUPPLY_V = (4.8, 6.0)
# The option of a wire to the servo driver's output enable: the board's pin, as in the firmware's output_gate.h, and a
# pull-up that holds the enable off while the pin floats, against the wing's 10 kΩ to ground. The chip needs 0.7 of its
# supply.
OE_GPIO, OE_PULL_UP_OHM = 27, 2200.0
OE_PULL_DOWN_OHM, LOGIC_V, OE_OFF_SHARE = 10e3, 3.3, 0.7
CARRIES = {"signal": "signal", "supply": "supply", "stack": "plugged together", "usb": "USB"}


def wiring_text(folded: FoldedCar, title: str) -> str:
    """The wiring as Markdown."""
    parts = folded.parts
    wing, feather, battery, switch = parts.featherwing.name, parts.feather.name, parts.battery, parts.switch.name
    switched = any(wire.a.startswith(switch) for wire in folded.wires)
    lines = [
        f"# Wiring of {title}",
        "",
        f"## Servos on the {wing}",
        "| output | channel | servo | side | forward is | plug |",
        "|---|---|---|---|---|---|",
    ]
    for axle in sorted(folded.axles, key=lambda axle: axle.channel):
        pulse = "a longer pulse" if axle.direction > 0 else "a shorter pulse"
        lines.append(
            f"| {axle.channel} | CH{axle.channel + 1} | {axle.servo} | {axle.side} | {pulse} "
            f"(CH{axle.channel + 1}_DIRECTION {axle.direction:+d}) | brown lead to GND, orange to the signal pin |"
        )
    used = {axle.channel for axle in folded.axles}
    free = [str(output) for output in range(8) if output not in used]
    if free:
        lines += ["", f"Outputs {', '.join(free)} stay empty."]
    lines += [
        "",
        "## Supply",
        f"- Servos: {battery.name} ({battery.supply_v.value:g} V) to the terminal block of the {wing}, and to "
        f"nothing else; {SUPPLY_V[0]:g} to {SUPPLY_V[1]:g} V, so one LiPo cell is too low. Mind the polarity.",
        *(
            [
                f"- The {switch} breaks the + lead between battery and terminal block: solder both ends to it. It turns "
                "off the servos alone; the board runs as long as its LiPo or USB is plugged in."
            ]
            if switched
            else []
        ),
        f"- Board: {parts.lipo.name} to the JST socket of the {feather}, or USB, which also charges it. Check the LiPo's "
        "polarity against the board's print: plugs of other sellers may be crossed.",
        "- Ground is common through the boards' headers.",
    ]
    others = [wire for wire in folded.wires if wire.carries != "signal"]
    if others:
        lines += ["", "## All other connections", "| from | to | what | |", "|---|---|---|---|"]
        lines += [f"| {wire.a} | {wire.b} | {CARRIES[wire.carries]} | {wire.note} |" for wire in others]
    lines += _leads(folded)
    lines += _output_enable(wing, feather)
    lines += [
        "",
        "## Before the first drive",
        "1. Set every servo's neutral: with pulses of 1500 µs it must stand still; turn its potentiometer until it does.",
        "2. Lift the car and drive it forward slowly: every wheel must turn forward. One that turns backward is on a "
        "wrong output.",
        "",
    ]
    return "\n".join(lines)


def _leads(folded: FoldedCar) -> list[str]:
    """What every lead needs along its way and what there is."""
    wiring, found = folded.parts.wiring, leads(folded)
    if not found:
        return []
    limits = ", hinges at their limits" if folded.hinges else ""
    loop = f", {wiring.hinge_slack_mm.value:g} mm at each hinge," if folded.hinges else ""
    return [
        "",
        "## Leads",
        "Lengths in mm. Needed is the way along floor and walls at its longest (the battery lifted out of the "
        f"car{limits}) with {wiring.slack_share.value * 100:.0f} % slack{loop} and the plug with "
        f"{wiring.slack_mm.value:g} mm to hold it by, or {wiring.joint_mm.value:g} mm for each joint. What is there is "
        "the least that the parts' data promise: measure yours.",
        "",
        "| from | to | way | needed | there | |",
        "|---|---|---:|---:|---:|---|",
        *(
            f"| {lead.start} | {lead.end} | {lead.way_mm:.0f} | {lead.needed_mm:.0f} "
            f"| {f'{lead.there_mm:.0f}' if lead.there_mm else ''} | {_note(lead)} |"
            for lead in found
        ),
    ]


def _note(lead: Lead) -> str:
    side = f"leaves the battery on the {lead.leaves}" if lead.leaves else ""
    return "; ".join(text for text in (side, remedy(lead)) if text)


def remedy(lead: Lead) -> str:
    """What is done so that a lead is long enough, "" for nothing."""
    length = math.ceil(lead.missing_mm / 5) * 5
    if lead.kind == "wire":
        return f"cut {length} mm of wire"
    if lead.kind == "solder":
        return f"solder {length} mm of wire to it" if length else ""
    return f"with {lead.extension}" if lead.extension else ""


def _output_enable(wing: str, feather: str) -> list[str]:
    off_v = LOGIC_V * OE_PULL_DOWN_OHM / (OE_PULL_DOWN_OHM + OE_PULL_UP_OHM)
    return [
        "",
        "## Option: no pulses while the board hangs or restarts",
        "The servo driver repeats its last pulses by itself until the board turns them off. Its output enable (#OE) can "
        f"end them; the {wing} has it on no header, so this needs soldering. Not tried on a car.",
        f"1. A wire from {OE_GPIO} of the {feather} to #OE: pin 23 of the PCA9685, or that end of its 10 kΩ resistor to "
        "ground.",
        f"2. A resistor of {OE_PULL_UP_OHM / 1000:g} kΩ from the same point to 3V. Against the 10 kΩ it holds #OE at "
        f"{off_v:.1f} V while the board's pin floats; off is above {OE_OFF_SHARE * LOGIC_V:.1f} V.",
        "3. Now no wheel turns. Set the parameter OE_WIRED to 1 and restart the board: now they do.",
    ]
