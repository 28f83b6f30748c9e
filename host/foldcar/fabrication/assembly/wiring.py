"""The wiring: servo and direction of each output of the servo driver, the supplies, the length of every lead.

Input: a FoldedCar. Output: Markdown; a drawing as SVG, in millimetres of a page, the car's front up. Outputs count from 0
as on the board, channels from 1 as in the firmware's parameter names.
"""

import html
import math

from foldcar.car.folded.model import Axle, FoldedCar
from foldcar.car.leads import Lead, leads
from foldcar.car.parts.catalogue import Catalogue
from foldcar.fabrication.assembly.drawing import COLOURS
from foldcar.page_template import page_template

# The option of a wire to the servo driver's output enable: the board's pin, as in the firmware's output_gate.h, and a
# pull-up that holds the enable off while the pin floats, against the wing's 10 kΩ to ground. The chip needs 0.7 of its
# supply.
OE_GPIO, OE_PULL_UP_OHM = 27, 2200.0
OE_PULL_DOWN_OHM, LOGIC_V, OE_OFF_SHARE = 10e3, 3.3, 0.7
CARRIES = {"signal": "signal", "supply": "supply", "stack": "plugged together", "usb": "USB"}
OUTPUTS = 8
WIDTH_MM, ROW_MM, TOP_MM = 190.0, 11.0, 26.0
BOARD_MM = (70.0, 120.0)
SERVO_MM = 50.0
# Of the terminal block, plus and minus, from the board's middle.
POLES_MM = (8.0, 16.0)
# The leads of all servos have the same colours; in the drawing each output has its own, neighbours differ in lightness.
WIRES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#a65628", "#e69f00", "#555555")
INK, PLUS = "#222222", "#c2272d"


def wiring_text(folded: FoldedCar, title: str) -> str:
    """The wiring as Markdown."""
    parts = folded.parts
    axles = sorted(folded.axles, key=lambda axle: axle.channel)
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
        others=[wire for wire in folded.wires if wire.carries != "signal"],
        carries=CARRIES,
        hinges=folded.hinges,
        leads=[(lead, _note(lead)) for lead in leads(folded)],
        gpio=OE_GPIO,
        pull_up_ohm=OE_PULL_UP_OHM,
        off_v=LOGIC_V * OE_PULL_DOWN_OHM / (OE_PULL_DOWN_OHM + OE_PULL_UP_OHM),
        least_off_v=OE_OFF_SHARE * LOGIC_V,
    )


def _is_switched(folded: FoldedCar) -> bool:
    return any(wire.a.startswith(folded.parts.switch.name) for wire in folded.wires)


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


def wiring_drawing(folded: FoldedCar, title: str) -> str:
    """The drawing's SVG file."""
    rows_end = TOP_MM + OUTPUTS * ROW_MM
    height = rows_end + 62
    body = [
        f'<rect width="{WIDTH_MM:g}" height="{height:g}" fill="#ffffff"/>',
        _text(WIDTH_MM / 2, 8, f"Wiring of {title}", 5, bold=True),
        _text(WIDTH_MM / 2, 15, "front of the car ↑", 3.6),
        *_wing(rows_end, folded.parts),
    ]
    axles, found = {axle.channel: axle for axle in folded.axles}, leads(folded)
    extended = {lead.start: lead.extension.rpartition(", ")[2] for lead in found if lead.extension}
    for output in range(OUTPUTS):
        axle = axles.get(output)
        body += _output(output, axle)
        if axle is not None and axle.servo in extended:
            body += _extension(output, axle.side == "left", extended[axle.servo])
    body += _supply(rows_end, folded.parts, _is_switched(folded))
    body += _lengths(rows_end, [lead for lead in found if lead.kind != "plug" and lead.missing_mm > 0])
    body += _enable_option(rows_end)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH_MM:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {WIDTH_MM:g} {height:g}" font-family="DejaVu Sans, Arial, Helvetica, sans-serif" fill="{INK}">'
        f"<title>Wiring of {html.escape(title)}</title>\n" + "\n".join(body) + "\n</svg>\n"
    )


def _wing(rows_end: float, parts: Catalogue) -> list[str]:
    left, right = BOARD_MM
    return [
        _box(left, TOP_MM - 6, right - left, rows_end - TOP_MM + 16, "board"),
        _text((left + right) / 2, TOP_MM - 1.5, parts.featherwing.name, 3),
        _box(left + 3, rows_end + 1, right - left - 9, 7, "other"),
        _text(left + 5, rows_end + 5.6, "terminal block", 3, "start"),
        *(_text((left + right) / 2 + x, rows_end + 5.6, sign, 3.4) for x, sign in zip(POLES_MM, "+−", strict=True)),
    ]


def _output(output: int, axle: Axle | None) -> list[str]:
    y = TOP_MM + (output + 0.5) * ROW_MM
    left, right = BOARD_MM
    middle = (left + right) / 2
    if axle is None:
        return [_pin(middle, y, "#ffffff"), _text(middle + 9, y + 1.2, f"{output}  empty", 3, "start")]
    on_left = axle.side == "left"
    edge, side = (left, -1) if on_left else (right, 1)
    near, far = (SERVO_MM + 5, 5.0) if on_left else (WIDTH_MM - SERVO_MM - 5, WIDTH_MM - 5)
    colour = WIRES[output]
    pulse = "longer" if axle.direction > 0 else "shorter"
    x = min(near, far)
    return [
        _wire(f"M{middle + side * 3:g},{y:g}H{near:g}", colour),
        _pin(middle, y, colour),
        _text(edge - side * 9, y - 1.4, f"{output} · CH{output + 1}", 3),
        _box(x, y - 6.5, SERVO_MM, 13, "servo"),
        _text(x + SERVO_MM / 2, y - 1.2, axle.servo, 3.4, bold=True),
        _text(x + SERVO_MM / 2, y + 3.6, f"forward: {pulse} pulse", 3),
    ]


def _extension(output: int, on_left: bool, length: str) -> list[str]:
    """A servo extension in the wire of an output, with its length."""
    y, x = TOP_MM + (output + 0.5) * ROW_MM, SERVO_MM + 6 if on_left else BOARD_MM[1] + 1.5
    return [_box(x, y - 2.4, 12.5, 4.8, "other"), _text(x + 6.25, y + 1, length, 2.5)]


def _lengths(rows_end: float, found: list[Lead]) -> list[str]:
    """The lengths of wire beside the lines that it is soldered into."""
    y, left = rows_end + 26, 5 + SERVO_MM
    texts = []
    for lead in found:
        text = f"{math.ceil(lead.missing_mm / 5) * 5} mm"
        if lead.kind == "wire":
            texts.append(_text((BOARD_MM[0] + BOARD_MM[1]) / 2 + POLES_MM[0] - 1.5, y - 4, text, 2.5, "end"))
        else:
            below = lead.start.endswith("-")
            texts.append(_text(left + 6, y + (5.5 if below else -3.6), f"{text} more", 2.5, "start"))
    return texts


def _supply(rows_end: float, parts: Catalogue, switched: bool) -> list[str]:
    left, right = BOARD_MM
    middle, y = (left + right) / 2, rows_end + 26
    volts = f"{parts.battery.supply_v.value:g} V, servos only"
    return [
        _box(5, y - 8, SERVO_MM, 16, "battery"),
        _text(5 + SERVO_MM / 2, y - 1, parts.battery.name, 3.4, bold=True),
        _text(5 + SERVO_MM / 2, y + 4, volts, 3),
        _wire(f"M{5 + SERVO_MM:g},{y - 2:g}H{middle + POLES_MM[0]:g}V{rows_end + 8:g}", PLUS),
        _wire(f"M{5 + SERVO_MM:g},{y + 2:g}H{middle + POLES_MM[1]:g}V{rows_end + 8:g}", INK),
        *(_switch((5 + SERVO_MM + middle) / 2 + 8, y - 2) if switched else []),
        _text(5 + SERVO_MM + 3, y - 3.4, "+", 3.4),
        _text(5 + SERVO_MM + 3, y + 5.8, "−", 3.4),
        _box(left, y + 10, right - left, 20, "board"),
        _text(middle, y + 18, parts.feather.name, 3.4, bold=True),
        _text(middle, y + 23.5, "under the wing, on its headers", 3),
        _box(5, y + 13, SERVO_MM, 14, "battery"),
        _text(5 + SERVO_MM / 2, y + 19, parts.lipo.name, 3.4, bold=True),
        _text(5 + SERVO_MM / 2, y + 24, "board only", 3),
        _wire(f"M{5 + SERVO_MM:g},{y + 20:g}H{left:g}", PLUS),
        _text((5 + SERVO_MM + left) / 2, y + 18.4, "JST", 3),
        _box(WIDTH_MM - SERVO_MM - 5, y + 13, SERVO_MM, 14, "other"),
        _text(WIDTH_MM - 5 - SERVO_MM / 2, y + 21.2, "computer", 3.4, bold=True),
        _wire(f"M{right:g},{y + 20:g}H{WIDTH_MM - SERVO_MM - 5:g}", INK),
        _text((right + WIDTH_MM - SERVO_MM - 5) / 2, y + 18.4, "USB", 3),
    ]


def _enable_option(rows_end: float) -> list[str]:
    """The optional wire from the board to the servo driver's output enable, with its pull-up."""
    x, low, high, middle = BOARD_MM[1] - 4, rows_end + 36, rows_end + 10, rows_end + 23
    resistor = f'x="{x + 7:g}" y="{middle - 1.6:g}" width="10" height="3.2"'
    return [
        _wire(f"M{x:g},{low:g}V{high:g}M{x:g},{middle:g}H{x + 24:g}", INK, dashed=True),
        f'<rect {resistor} fill="#ffffff" stroke="{INK}" stroke-width="0.4"/>',
        _text(x + 12, middle - 3, f"{OE_PULL_UP_OHM / 1000:g} kΩ", 3),
        _text(x + 25, middle + 1.1, "3V", 3, "start"),
        _text(x + 2, high + 5, "#OE (pin 23)", 3, "start"),
        _text(x + 2, low - 1.5, f"{OE_GPIO}", 3, "start"),
        _text(x + 32, high + 5, "option: see wiring.md", 3, "start"),
    ]


def _switch(x: float, y: float) -> list[str]:
    """An open switch in a line along x, as in circuit diagrams."""
    return [
        f'<rect x="{x - 6:g}" y="{y - 1:g}" width="12" height="2" fill="#ffffff"/>',
        f'<path d="M{x - 6:g},{y:g}L{x + 5:g},{y - 4.5:g}" stroke="{PLUS}" stroke-width="1.2" fill="none"/>',
        *(f'<circle cx="{x + dx:g}" cy="{y:g}" r="1.1" fill="{PLUS}"/>' for dx in (-6, 6)),
        _text(x, y - 6, "switch", 3),
    ]


def _box(x: float, y: float, width: float, height: float, material: str) -> str:
    red, green, blue = (round(255 - (255 - value) * 0.45) for value in COLOURS[material][0])
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="1.5" '
        f'fill="#{red:02x}{green:02x}{blue:02x}" stroke="{INK}" stroke-width="0.4"/>'
    )


def _pin(x: float, y: float, colour: str) -> str:
    place = f'x="{x - 3:g}" y="{y - 1.6:g}" width="6" height="3.2"'
    return f'<rect {place} fill="{colour}" stroke="{INK}" stroke-width="0.3"/>'


def _wire(path: str, colour: str, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="2.5 1.5"' if dashed else ""
    return f'<path d="{path}" stroke="{colour}" stroke-width="{0.8 if dashed else 1.2:g}" fill="none"{dashes}/>'


def _text(x: float, y: float, text: str, size: float, anchor: str = "middle", bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size:g}" text-anchor="{anchor}"{weight}>{html.escape(text)}</text>'
