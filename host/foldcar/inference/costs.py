"""Sheets and minutes that cars and trials take."""

import math
from dataclasses import dataclass
from functools import lru_cache

from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.inference.design_evidence import DesignEvidence
from foldcar.statistics.selection import Effort

MACHINE = "silhouette"
# Assumptions: speed of a desktop cutter in film (mm/s), time to place the obstacles of a trial (minutes), and time to
# build a car that the guide cannot fold (minutes).
CUTTING_MM_S, PLACING_MIN, UNKNOWN_ASSEMBLY_MIN = 20.0, 3.0, 60.0


@dataclass(frozen=True)
class Cost:
    """The number of ``sheets`` of film, 0 if no car is to be built; ``minutes`` of work for the cars and the trials."""

    sheets: int
    minutes: int


def trial_min(drive_s: float | None) -> float:
    """Return the minutes of a trial with a drive of ``drive_s``; None counts as 0."""
    return PLACING_MIN + (drive_s or 0.0) / 60


@lru_cache
def assembly_min(vehicle_type: str, design: tuple[tuple[str, float | str], ...]) -> float:
    """Return the minutes to build a car of the ``design``, pairs of name and value, as its guide estimates them.

    Returns UNKNOWN_ASSEMBLY_MIN for a car that cannot be cut.
    """
    # These modules take a second to import.
    from foldcar.fabrication.assembly.operations import operations
    from foldcar.fabrication.patterns.options import options
    from foldcar.fabrication.patterns.sheets import cut_car, enlarge_sheet

    try:
        folded = folded_car(compose_columns(vehicle_type, dict(design)))
        return operations(folded, cut_car(folded, enlarge_sheet(folded, options(MACHINE)))).minutes
    except (FoldcarError, ValueError):
        return UNKNOWN_ASSEMBLY_MIN


def cost(design: DesignEvidence, effort: Effort, car_min: float) -> Cost | None:
    """Return the cost of cars, ``car_min`` minutes each to assemble, and trials; None if the cars cannot be cut."""
    driving_min = effort.trials * trial_min(design.mean_time_s)
    if not effort.cars:
        return Cost(0, math.ceil(driving_min))
    cut = _cut(design.vehicle_type, tuple(design.design.items()))
    if cut is None:
        return None
    sheets, cutting_min = cut
    return Cost(effort.cars * sheets, math.ceil(effort.cars * (cutting_min + car_min) + driving_min))


@lru_cache
def _cut(vehicle_type: str, design: tuple[tuple[str, float | str], ...]) -> tuple[int, float] | None:
    """Return the number of sheets of a car and the minutes to cut them; None if the car cannot be cut."""
    # These modules take a second to import.
    from foldcar.fabrication.patterns.options import options
    from foldcar.fabrication.patterns.sheets import enlarge_sheet, pattern

    try:
        composed = compose_columns(vehicle_type, dict(design))
        folded = folded_car(composed)
        cut = pattern(folded, enlarge_sheet(folded, options(MACHINE)), composed.title)
    except (FoldcarError, ValueError):
        return None
    return len(cut.sheets), cut.cut_length_mm / CUTTING_MM_S / 60
