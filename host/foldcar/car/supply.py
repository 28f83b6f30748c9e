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
    """Currents (A) of ``servos`` servos together, and what bears them; ``switch_a`` is the mark to ask for."""

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


def supply(car: FoldedCar) -> Supply:
    """Return the supply of a car's servos."""
    parts, servos = car.parts, sum(axle.driven for axle in car.axles)
    line = parts.servo.at_voltage(parts.cells.supply_v.value)
    stall_a = servos * line.stall_current_a
    fuse_a = next(fuse for fuse in FUSES_A if fuse >= stall_a)
    usual, strong = parts.switch.current_a.value, parts.switch.strong_current_a.value
    gauge = next(gauge for gauge in parts.wiring.gauges if gauge.current_a >= fuse_a)
    return Supply(servos, stall_a, servos * line.no_load_current_a, usual if stall_a <= usual else strong, fuse_a, gauge)


def check_supply(car: FoldedCar) -> Iterator[Finding]:
    """Yield a finding if no switch of this size bears the stalled servos' current."""
    needs = supply(car)
    if needs.stall_a > needs.switch_a:
        drawn = f"{needs.servos} stalled servos draw {needs.stall_a:.1f} A, more than its {needs.switch_a:g} A"
        yield Finding("supply", car.parts.switch.name, f"{drawn}: drive fewer axles (W.driven=0)")


def fresh_cells_warning(parts: Catalogue) -> str:
    """Return why the chosen cells harm the servos while they are fresh; "" if they do not."""
    most_v, fresh_v = parts.servo.operating_points[-1].voltage_v, parts.cells.fresh_v.value
    if fresh_v <= most_v:
        return ""
    return (
        f"{parts.cells.name} have {fresh_v:g} V when fresh, more than the {most_v:g} V that the servos may get: use NiMH"
    )
