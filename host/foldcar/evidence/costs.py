"""Estimate the sheets of film and the minutes of work that cars, trials and measurements take.

Both are rough on purpose: `foldcar pattern` says exactly what a car needs. The numbers and their sources are in
``costs.json``: the minutes to cut and build a car of each vehicle type, and how well pieces fill a sheet.
"""

import json
import math
from functools import lru_cache
from pathlib import Path

from foldcar.car.folded.weight import film_area_cm2
from foldcar.car.folded_car import folded_columns
from foldcar.evidence.design_evidence import DesignEvidence

_DATA = json.loads(Path(__file__).with_name("costs.json").read_text(encoding="utf-8"))
FILLING: float = _DATA["filling"]["value"]
# A sheet of 12 x 12 inch (cm²).
SHEET_CM2 = (12 * 2.54) ** 2
# Assumed time to place car and obstacles for a trial (minutes).
PLACING_MIN = 3.0


# Minutes to measure what can be measured, by the parameter's name.
MEASURE_MIN: dict[str, float] = {name: row["value"] for name, row in _DATA["measure_min"].items()}


def trial_min(drive_s: float | None) -> float:
    """Return the minutes of a trial with a drive of ``drive_s``; None counts as 0."""
    return PLACING_MIN + (drive_s or 0.0) / 60


def car_min(vehicle_type: str) -> float:
    """Return the minutes to cut and build a car of a type such as ``W_B_W``.

    The parts that may follow a type's ``+`` do not change them.
    """
    modules = vehicle_type.partition("+")[0]
    if modules in _DATA["car_min"]:
        return float(_DATA["car_min"][modules]["value"])
    return float(_DATA["module_min"]["value"] * len(modules.split("_")))


def sheets_of(design: DesignEvidence) -> int | None:
    """Return the number of sheets of a car; None if the design cannot be folded."""
    return _sheets(design.vehicle_type, tuple(design.design.items()))


@lru_cache
def _sheets(vehicle_type: str, design: tuple[tuple[str, float | str], ...]) -> int | None:
    """Return the number of sheets of a car; None if the design cannot be folded."""
    car = folded_columns(vehicle_type, dict(design))
    return None if car is None else math.ceil(film_area_cm2(car) / (SHEET_CM2 * FILLING))
