"""Compute further measures of each design: time, energy, mass, sheet area.

``time`` is the mean over all runs. A run that did not pass counts as the time limit, so that a design gains nothing by
failing early. ``passing_time`` is the mean over the runs that passed. ``energy`` is the energy drawn in all runs, divided
by the number of runs that passed.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.car.folded.weight import film_area_cm2
from foldcar.car.folded_car import folded_columns
from foldcar.report.page_types import Measure
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.run_arrays import RunArrays
from foldcar.store.tables import BY_NAME, DESIGN

# With more designs there is no sheet area, because folding a car takes some 10 ms.
MAX_FOLDED = 300


def measures(store: Store, info: ExperimentInfo, designs: Sequence[Mapping[str, Any]], runs: RunArrays) -> list[Measure]:
    """Return the measures of designs, such as mean time and mass: each is a column with a value for every design.

    ``designs`` begin with the stored designs of the experiment, in their order. Raises StoreError.
    """
    columns: list[Measure] = []
    if info.success_defined:
        columns += _measures_of_runs(runs.counted, len(designs), info.timeout_s)
    columns.append(_measure("mass", "mass", "g", _masses_g(store, info, len(designs))))
    if len(designs) <= MAX_FOLDED:
        areas_cm2 = numpy.array([_area_cm2(info, design) for design in designs])
        columns.append(_measure("sheet_area", "sheet area", "cm²", areas_cm2))
    return columns


def _measures_of_runs(runs: RunArrays, designs: int, limit_s: float) -> list[Measure]:
    """Return the measures that come from the runs of so many ``designs``: two mean times, and the energy.

    ``limit_s`` is the time limit of a run.
    """

    def sum_by_design(values: NDArray[Any]) -> NDArray[Any]:
        """Return the sum of the values of each design's runs; unknown values count as 0."""
        return numpy.bincount(runs.design, numpy.nan_to_num(values), minlength=designs)

    time_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    energy_j = runs.metrics[:, NUMBERS.index("consumed_energy_j")]
    has_passed = runs.outcome == OUTCOMES.index("passed")
    total = sum_by_design(numpy.ones(len(has_passed)))
    passed = sum_by_design(has_passed)
    passing_time_s = sum_by_design(numpy.where(has_passed, numpy.minimum(time_s, limit_s), 0.0))
    # A run that did not pass counts as the time limit.
    time_with_failures_s = passing_time_s + (total - passed) * limit_s
    # The energy of a run that failed with an error is unknown: it counts as the mean.
    mean_energy_j = _ratio(sum_by_design(energy_j), sum_by_design(~numpy.isnan(energy_j)))
    return [
        _measure("time", "time, failures at the limit", "s", _ratio(time_with_failures_s, total)),
        _measure("passing_time", "time of passing runs", "s", _ratio(passing_time_s, passed)),
        _measure("energy", "energy per pass", "J", _ratio(mean_energy_j * total, passed)),
    ]


def _measure(key: str, label: str, unit: str, values: NDArray[Any]) -> Measure:
    """Return a column of a measure of which less is better, with five digits; None where ``values`` are not finite."""
    column = [float(f"{value:.5g}") if numpy.isfinite(value) else None for value in values]
    return {"key": key, "label": label, "unit": unit, "better": "less", "value": column}


def _ratio(numerator: NDArray[Any], denominator: NDArray[Any]) -> NDArray[Any]:
    """Return numerator / denominator; NaN where the denominator is 0."""
    unknown = numpy.full(len(numerator), numpy.nan)
    return numpy.asarray(numpy.divide(numerator, denominator, out=unknown, where=denominator > 0))


def _masses_g(store: Store, info: ExperimentInfo, design_count: int) -> NDArray[Any]:
    """Return the masses (g) of the first ``design_count`` designs, as simulated; NaN for those that were not."""
    designs = list(store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", info.id))
    body_ids = {design["body_id"] for design in designs}
    mass_g_by_body: dict[int, float] = {}
    for row in store.rows(BY_NAME["body"]):
        if row["id"] in body_ids:
            body = json.loads(row["json"])
            parts = [*body.get("segments", ()), *body.get("wheels", ())]
            mass_g_by_body[row["id"]] = 1000 * sum(part["mass_kg"] for part in parts) if parts else numpy.nan
    masses_g = numpy.full(design_count, numpy.nan)
    for index, design in enumerate(designs):
        masses_g[index] = mass_g_by_body.get(design["body_id"], numpy.nan)
    return masses_g


def _area_cm2(info: ExperimentInfo, design: Mapping[str, Any]) -> float:
    """Return the area of film (cm²) of a design's car; NaN if this foldcar cannot fold it."""
    car = folded_columns(info.vehicle_type, design)
    return numpy.nan if car is None else film_area_cm2(car)
