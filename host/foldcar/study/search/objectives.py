"""What a search makes large or small: numbers of a design, from its runs or from its film, with intervals.

Each is defined so that a car that fails at once gains nothing by it.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from foldcar.car.design import Design
from foldcar.car.folded.weight import area_mm2
from foldcar.car.folded_car import folded_car
from foldcar.statistics.rate import limited_mean, wilson_interval
from foldcar.study.search.design_simulator import Row

Interval = tuple[float, float]
RESAMPLES = 2000
CM2 = 0.01
# No run can be better.
PERFECT = Row("passed", 0.0, 0.0)


@dataclass(frozen=True)
class Objective:
    """``value`` takes a design's rows and the time limit (s); ``interval`` the same, and gives its 95 % interval.

    The rows are at least one, and none of a rejected run.
    ``each`` takes one row, the time limit and a value of the objective: what the run loses against it, so that a design
    is as good as that value if the sum over its runs is 0 or less; NaN if unknown.
    ``unit`` is empty for shares. The functions are None for what follows from the design alone.
    """

    name: str
    unit: str
    largest: bool
    meaning: str
    value: Callable[[Sequence[Row], float], float] | None
    interval: Callable[[Sequence[Row], float], Interval] | None
    each: Callable[[Row, float, float], float] | None

    def excess(self, rows: Sequence[Row], best: Sequence[Row], limit_s: float) -> tuple[list[float], float]:
        """What each of the ``rows`` loses more than the ``best`` design's run there; by how much it could lose less.

        Rows are in the order of environments, rejected ones among them; without a result of both it is 0.
        """
        assert self.each is not None and self.value is not None
        aim = self.value([row for row in best if row.passed is not None], limit_s)
        mine, its = ([self.each(row, limit_s, aim) for row in some] for some in (rows, best))
        known = [one for one in its if math.isfinite(one)]
        found = [a - b if math.isfinite(a - b) else 0.0 for a, b in zip(mine, its[: len(mine)], strict=True)]
        return found, max(known, default=0.0) - self.each(PERFECT, limit_s, aim)


def _times_s(rows: Sequence[Row], limit_s: float) -> list[float]:
    """The times of the runs that passed."""
    return [min(row.elapsed_time_s or 0.0, limit_s) for row in rows if row.passed]


def _time(rows: Sequence[Row], limit_s: float) -> float:
    """Return the mean time of the runs (s), where a run that did not pass counts as the time limit."""
    times = _times_s(rows, limit_s)
    return math.fsum([*times, *[limit_s] * (len(rows) - len(times))]) / len(rows)


def _time_interval(rows: Sequence[Row], limit_s: float) -> Interval:
    times = _times_s(rows, limit_s)
    return limited_mean(len(times), len(rows), math.fsum(times), math.fsum(time**2 for time in times), limit_s)[1:]


def _energy(rows: Sequence[Row], limit_s: float) -> float:
    """The energy drawn in all runs, per run that passed."""
    table = _energies(rows)
    passed = table[:, 1].sum()
    return float(table[:, 0].sum() / passed) if passed else math.inf


def _energy_interval(rows: Sequence[Row], limit_s: float) -> Interval:
    """Percentiles of the ratio over resampled runs (Efron's bootstrap), with a fixed seed."""
    table = _energies(rows)
    picks = np.random.default_rng(0).integers(0, len(table), (RESAMPLES, len(table)))
    totals = table[picks].sum(axis=1)
    ratios = np.divide(totals[:, 0], totals[:, 1], out=np.full(RESAMPLES, math.inf), where=totals[:, 1] > 0)
    low, high = np.quantile(ratios, (0.025, 0.975), method="nearest")
    return float(low), float(high)


def _energies(rows: Sequence[Row]) -> Any:
    """(runs, 2): energy (J) and whether the run passed. A failed run, whose energy is unknown, counts as the mean."""
    known = [row.consumed_energy_j for row in rows if row.consumed_energy_j is not None]
    mean = math.fsum(known) / len(known) if known else math.inf
    return np.array([(mean if row.consumed_energy_j is None else row.consumed_energy_j, row.passed) for row in rows])


def film_area_cm2(design: Design) -> float:
    """The area of the car's flat pieces (cm²): the outlines of all faces, tabs included, holes not taken off."""
    pieces = folded_car(design).pieces
    return CM2 * sum(piece.count * sum(area_mm2(face.outline_mm) for face in piece.faces) for piece in pieces)


def beaten(losses: Sequence[float], others: Iterable[Sequence[float]]) -> bool:
    """Whether one of the others is as good in all objectives and better in one; less is better in ``losses``."""
    return any(
        list(other) != list(losses) and all(a <= b for a, b in zip(other, losses, strict=True)) for other in others
    )


OBJECTIVES = {
    one.name: one
    for one in (
        Objective(
            "success", "", True, "share of runs that pass",
            lambda rows, limit_s: sum(bool(row.passed) for row in rows) / len(rows),
            lambda rows, limit_s: wilson_interval(sum(bool(row.passed) for row in rows), len(rows)),
            lambda row, limit_s, aim: math.nan if row.passed is None else aim - row.passed,
        ),
        Objective(
            "time", "s", False, "mean time, failures at the limit", _time, _time_interval,
            lambda row, limit_s, aim: math.nan if row.passed is None else _time([row], limit_s) - aim,
        ),
        Objective(
            "energy", "J", False, "energy drawn in all runs, per run that passed", _energy, _energy_interval,
            lambda row, limit_s, aim: (
                math.nan if row.passed is None or row.consumed_energy_j is None
                else row.consumed_energy_j - aim * row.passed
            ),
        ),
        Objective("sheet-area", "cm²", False, "area of the car's flat pieces of film", None, None, None),
    )
}  # fmt: skip
