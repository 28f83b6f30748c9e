"""What a design costs and how it drives, beside its success: a column for each measure.

Time counts runs that do not pass with the time limit, energy is all that was drawn per run that passed: a design that
fails at once gains nothing by it.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.car.design import compose_columns
from foldcar.errors import FoldcarError
from foldcar.search.objectives import film_area_cm2
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.frames import RunArrays
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME, DESIGN

# Folding a car takes some 10 ms: more designs have no sheet area.
MOST_FOLDED = 300


def measures(
    store: Store, info: ExperimentInfo, designs: Sequence[Mapping[str, Any]], runs: RunArrays
) -> list[dict[str, Any]]:
    """The measures of the designs, the first of which are the store's; StoreError."""
    number, found = len(designs), []
    if info.success_defined:
        counted = runs.counted
        passed = counted.outcome == OUTCOMES.index("passed")
        time_s, energy_j = (counted.metrics[:, NUMBERS.index(name)] for name in ("elapsed_time_s", "consumed_energy_j"))
        limited = numpy.where(passed, numpy.minimum(numpy.nan_to_num(time_s), info.timeout_s), info.timeout_s)
        total = numpy.bincount(counted.design, minlength=number)
        crossed = numpy.bincount(counted.design, passed, minlength=number)
        time = _ratio(numpy.bincount(counted.design, limited, minlength=number), total)
        # A failed run, whose energy is unknown, counts as the mean.
        known = numpy.bincount(counted.design, ~numpy.isnan(energy_j), minlength=number)
        drawn = _ratio(numpy.bincount(counted.design, numpy.nan_to_num(energy_j), minlength=number), known)
        found += [
            _measure("time", "time to pass", "s", time),
            _measure("energy", "energy per pass", "J", _ratio(drawn * total, crossed)),
        ]
    found.append(_measure("mass", "mass", "g", _masses_g(store, info, number)))
    if number <= MOST_FOLDED:
        found.append(_measure("sheet_area", "sheet area", "cm²", numpy.array([_area_cm2(info, one) for one in designs])))
    return found


def _measure(key: str, label: str, unit: str, values: NDArray[Any]) -> dict[str, Any]:
    column = [float(f"{value:.5g}") if numpy.isfinite(value) else None for value in values]
    return {"key": key, "label": label, "unit": unit, "better": "less", "value": column}


def _ratio(above: NDArray[Any], below: NDArray[Any]) -> NDArray[Any]:
    found: NDArray[Any] = numpy.divide(above, below, out=numpy.full(len(above), numpy.nan), where=below > 0)
    return found


def _masses_g(store: Store, info: ExperimentInfo, number: int) -> NDArray[Any]:
    """The designs' masses (g), from the bodies that were simulated; NaN for designs that were not."""
    found, known = numpy.full(number, numpy.nan), dict[int, float]()
    rows = list(store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", info.id))
    wanted = {row["body_id"] for row in rows}
    for body in store.rows(BY_NAME["body"]):
        if body["id"] in wanted:
            parts = json.loads(body["json"])
            bodies = [*parts.get("segments", ()), *parts.get("wheels", ())]
            known[body["id"]] = 1000 * sum(one["mass_kg"] for one in bodies) if bodies else numpy.nan
    for index, row in enumerate(rows):
        found[index] = known.get(row["body_id"], numpy.nan)
    return found


def _area_cm2(info: ExperimentInfo, design: Mapping[str, Any]) -> float:
    try:
        return film_area_cm2(compose_columns(info.vehicle_type, design))
    except (FoldcarError, ValueError):
        return numpy.nan
