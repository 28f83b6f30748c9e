"""The wires between the batteries, the switches and the boards of a car."""

from foldcar.car.components.bridge import BUTTON_PIN, DIVIDER_UPPER, OE_PIN
from foldcar.car.components.mounts import BOARD_SWITCH, BUTTON, SERVO_SWITCH
from foldcar.car.folded.model import Wire
from foldcar.car.parts.catalogue import Catalogue


def power_wires(parts: Catalogue) -> list[Wire]:
    """Return the wires between batteries, switch and boards."""
    feather, wing = parts.feather.name, parts.featherwing.name
    return [
        Wire(f"{feather} headers", f"{wing} headers", "stack", "the wing sits on the Feather: I2C on SDA 23 and SCL 22"),
        Wire(f"{parts.lipo.name}", f"{feather} JST", "supply", "3.7 V for the processor"),
        Wire(
            f"{parts.battery.name} +", f"{SERVO_SWITCH} 1", "supply", f"{parts.cells.supply_v.value:g} V for the servos"
        ),
        Wire(f"{SERVO_SWITCH} 2", f"{wing} terminal +", "supply", "switched"),
        Wire(f"{parts.battery.name} -", f"{wing} terminal -", "supply", "ground"),
        Wire(f"{BOARD_SWITCH} 1", f"{feather} EN", "control", "closed, it turns the board off"),
        Wire(f"{BOARD_SWITCH} 2", f"{feather} GND", "control", "ground"),
        *_option_wires(parts),
        Wire(f"{feather} USB", "computer", "usb", "to flash, and for trials by cable"),
    ]


def _option_wires(parts: Catalogue) -> list[Wire]:
    """Return the wires of the options that a car has."""
    feather, wing, wires = parts.feather.name, parts.featherwing.name, []
    if parts.button == "fitted":
        wires += [
            Wire(f"{BUTTON} 1", f"{feather} {BUTTON_PIN}", "control", "starts and stops a trial"),
            Wire(f"{BUTTON} 2", f"{feather} GND", "control", "ground"),
        ]
    if parts.divider == "fitted":
        wires.append(Wire(DIVIDER_UPPER, f"{wing} terminal +", "control", "measures the voltage of the servos' battery"))
    if parts.oe_wire == "fitted":
        wires.append(Wire(f"{feather} {OE_PIN}", f"{wing} #OE", "control", "ends the pulses while the board hangs"))
    return wires
