"""What a car and its trials cost: sheets of film as they are nested, and minutes on stated assumptions.

Input: a design and the trials that it needs. Output: a Cost, or none if the car cannot be cut.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from foldcar.car.design import compose
from foldcar.car.folded_car import folded_car
from foldcar.car.modules import parameters
from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import pattern

MACHINE = "silhouette"
# Assumptions, to be replaced by one's own experience: a desktop cutter in film (mm/s), folding, wiring and finding the
# neutrals of a car's servos, and placing the obstacles of a trial (minutes).
CUTTING_MM_S, ASSEMBLY_MIN, PLACING_MIN = 20.0, 90.0, 3.0
BASIS = (
    f"Sheets: 12 x 12 inch, as `foldcar pattern` nests them. Minutes assume cutting at {CUTTING_MM_S:g} mm/s, "
    f"{ASSEMBLY_MIN:g} min to fold, wire and adjust a car, {PLACING_MIN:g} min to place a trial, and the time that "
    "simulation drives."
)


@dataclass(frozen=True)
class Cost:
    """``sheets`` of film, 0 for a car that is built already; ``minutes`` for the car and its trials."""

    sheets: int
    minutes: int


def cost(
    vehicle_type: str, design: Mapping[str, float | str], trials: int, drive_s: float | None, built: bool
) -> Cost | None:
    """The cost of a car with ``trials`` of ``drive_s`` each (None: unknown, then without); None if it cannot be cut."""
    driving_min = trials * (PLACING_MIN + (drive_s or 0.0) / 60)
    if built:
        return Cost(0, math.ceil(driving_min))
    keys = {parameter.column: key for key, parameter in parameters().items()}
    try:
        composed = compose(vehicle_type, {keys[name]: float(value) for name, value in design.items()})
        cut = pattern(folded_car(composed), options(MACHINE), composed.title)
    except (FoldcarError, KeyError, ValueError):
        return None
    cutting_min = cut.cut_length_mm / CUTTING_MM_S / 60
    return Cost(len(cut.sheets), math.ceil(cutting_min + ASSEMBLY_MIN + driving_min))
