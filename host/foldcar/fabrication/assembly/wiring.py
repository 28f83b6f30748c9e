"""The wiring as text: servo and direction of each output of the servo driver, and the supplies.

Input: a FoldedCar. Output: Markdown. Outputs count from 0 as on the board, channels from 1 as in the firmware's
parameter names.
"""

from foldcar.car.folded.model import FoldedCar

SUPPLY_V = (4.8, 6.0)
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
    lines += [
        "",
        "## Before the first drive",
        "1. Set every servo's neutral: with pulses of 1500 µs it must stand still; turn its potentiometer until it does.",
        "2. Lift the car and drive it forward slowly: every wheel must turn forward. One that turns backward is on a "
        "wrong output.",
        "",
    ]
    return "\n".join(lines)
