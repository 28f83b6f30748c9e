"""Times to cross by a design parameter among all runs: those that never cross count with the time limit.

A mean over the runs that passed favours designs that pass only where it is easy; this one does not. A car that tipped
or got stuck would not have crossed later, so it is not censored where it ended: it takes the limit, as a time-out does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy

from foldcar.analysis.rate import limited_mean
from foldcar.report.series import Value
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.frames import RunArrays
from foldcar.store.info import ExperimentInfo


@dataclass(frozen=True)
class LimitedTime:
    """The mean time (s) with the 95 % interval."""

    mean_s: float
    low_s: float
    high_s: float


def limited_times(
    runs: RunArrays, designs: Sequence[Mapping[str, Value]], info: ExperimentInfo
) -> dict[str, dict[Value, LimitedTime]]:
    """The times by varied parameter and its value, over all values of the others.

    Rejected runs are left out. Empty where success is undefined, and where designs differ in their number of runs by
    their results.
    """
    if not info.success_defined or info.until is not None or info.searched or not len(runs.design):
        return {}
    runs = runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    # Scenic's steps may pass the limit by one.
    time_s = numpy.where(passed, numpy.nan_to_num(runs.metrics[:, NUMBERS.index("elapsed_time_s")]), 0.0)
    time_s = numpy.minimum(time_s, info.timeout_s)
    number, columns = len(designs), (None, passed, time_s, time_s**2)
    sums = numpy.array([numpy.bincount(runs.design, column, minlength=number) for column in columns])
    return {name: _by_value(name, designs, sums, info.timeout_s) for name in info.varied}


def _by_value(
    name: str, designs: Sequence[Mapping[str, Value]], sums: numpy.typing.NDArray[numpy.float64], limit_s: float
) -> dict[Value, LimitedTime]:
    by_value: dict[Value, numpy.typing.NDArray[numpy.float64]] = {}
    for design, column in zip(designs, sums.T, strict=True):
        by_value[design[name]] = by_value.get(design[name], 0.0) + column
    return {
        value: LimitedTime(*limited_mean(int(crossed), int(count), total_s, squares_s2, limit_s))
        for value, (count, crossed, total_s, squares_s2) in by_value.items()
        if count
    }
