"""The servos' supply: the current of stalled servos, and the switch, fuse, wire and capacitor that suit it.

Input: a FoldedCar. Output: a Supply; findings. The largest current flows while all servos are stalled at the cells'
voltage without load.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.placed import Finding
from foldcar.car.parts.bought import Gauge
from foldcar.car.parts.catalogue import Catalogue

# Ratings of blade fuses (ISO 8820-3).
FUSES_A = (1.0, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0)
# Adafruit's guide to the 8-channel Servo FeatherWing asks for so much a servo, in the board's place for a capacitor.
CAPACITOR_UF = 100


@dataclass(frozen=True, slots=True)
class Supply:
    """The currents (A) of all servos of a car together, and the switch, fuse and wire that bear them.

    ``switch_a`` is the current that must be marked on the switch.
    """

    servos: int
    stall_a: float
    free_a: float
    switch_a: float
    fuse_a: float
    gauge: Gauge

    @property
    def capacitor_uf(self) -> int:
        """Capacity (µF) that keeps the voltage up while servos start."""
        return self.servos * CAPACITOR_UF


def stall_current_a(car: FoldedCar) -> float:
    """Return the current (A) of all servos of a car while they are stalled at the cells' voltage without load."""
    line = car.parts.servo.at_voltage(car.parts.cells.supply_v.value)
    return sum(axle.driven for axle in car.axles) * line.stall_current_a


def supply(car: FoldedCar) -> Supply:
    """Return the currents of a car's servos, and the switch, fuse and wire that bear them."""
    parts = car.parts
    servo_count = sum(axle.driven for axle in car.axles)
    no_load_a = servo_count * parts.servo.at_voltage(parts.cells.supply_v.value).no_load_current_a
    stall_a = stall_current_a(car)
    fuse_a = next(fuse for fuse in FUSES_A if fuse >= stall_a)
    # Switches of this size are sold for two currents.
    weak_switch_a, strong_switch_a = parts.switch.current_a.value, parts.switch.strong_current_a.value
    switch_a = weak_switch_a if stall_a <= weak_switch_a else strong_switch_a
    # The wire must bear the current at which the fuse blows. Gauges are ordered from the thinnest wire on.
    gauge = next(gauge for gauge in parts.wiring.gauges if gauge.current_a >= fuse_a)
    return Supply(servo_count, stall_a, free_a=no_load_a, switch_a=switch_a, fuse_a=fuse_a, gauge=gauge)


def check_supply(car: FoldedCar) -> Iterator[Finding]:
    """Yield a finding if no switch of this size bears the stalled servos' current."""
    currents = supply(car)
    if currents.stall_a > currents.switch_a:
        excess = f"{currents.servos} stalled servos draw {currents.stall_a:.1f} A, more than its {currents.switch_a:g} A"
        yield Finding("supply", car.parts.switch.name, f"{excess}: drive fewer axles (W.driven=0)")


def fresh_cells_warning(parts: Catalogue) -> str:
    """Return a warning if the voltage of the fresh cells exceeds the servos' limit, else ""."""
    limit_v, fresh_v = parts.servo.operating_points[-1].voltage_v, parts.cells.fresh_v.value
    if fresh_v <= limit_v:
        return ""
    return (
        f"{parts.cells.name} have {fresh_v:g} V when fresh, more than the {limit_v:g} V that the servos may get: use NiMH"
    )
