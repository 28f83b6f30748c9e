"""The objectives that a search maximises or minimises: numbers from a design's runs or pieces, with intervals.

Each is defined so that a car gains nothing by failing early. ``built`` is computed as ``success`` is, but from runs in
random realities (study/random_realities.py).
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from foldcar.statistics.rate import limited_mean, wilson_interval
from foldcar.study.search.design_simulator import RunRow

Interval = tuple[float, float]
# Number of bootstrap samples.
RESAMPLES = 2000
# The objective whose runs are in random realities.
BUILT = "built"
# A run that is at least as good as any other.
PERFECT = RunRow("passed", 0.0, 0.0)


class PairedLosses(NamedTuple):
    """How a design compares with the best design so far in the environments in which both were simulated.

    ``differences`` has for each environment the loss of the design's run minus that of the best design's run.
    ``max_gain`` is the most by which a perfect run could be better than a run of the best design.
    """

    differences: list[float]
    max_gain: float


@dataclass(frozen=True)
class Objective:
    """An objective of a search, which is maximised or minimised.

    ``value(rows, limit_s)`` is a design's value, ``interval(rows, limit_s)`` its 95 % interval; rows are results of its
    runs, at least one, without rejected runs. ``run_loss(row, limit_s, target)`` is the loss of a run against a target
    value: a design reaches the target if the losses of its runs sum to 0 or less; NaN if unknown.
    ``unit`` is empty for fractions. The functions are None if the value depends on the design only.
    """

    name: str
    unit: str
    is_maximised: bool
    meaning: str
    value: Callable[[Sequence[RunRow], float], float] | None
    interval: Callable[[Sequence[RunRow], float], Interval] | None
    run_loss: Callable[[RunRow, float, float], float] | None

    @property
    def needs_runs(self) -> bool:
        """Whether the objective is computed from runs, not from the design alone."""
        return self.value is not None

    @property
    def heading(self) -> str:
        """The heading of its column in results."""
        return self.meaning if self.name == BUILT else self.name

    def loss(self, value: float) -> float:
        """Return a value of this objective as a number that is smaller if the design is better."""
        return -value if self.is_maximised else value

    def compare(self, rows: Sequence[RunRow], best_rows: Sequence[RunRow], limit_s: float) -> PairedLosses:
        """Compare the runs of a design with those of the best design so far, environment by environment.

        ``rows`` are the results of the design in the first environments. ``best_rows`` are the results of the best design
        in all environments, in the same order. Both include rejected runs.
        """
        assert self.run_loss is not None and self.value is not None
        judged_rows = [row for row in best_rows if row.passed is not None]
        # The loss of a run says by how much it misses a target. The target is the value of the best design, so the
        # losses of this design's runs have the sum 0.
        target = self.value(judged_rows, limit_s)
        best_losses = [self.run_loss(row, limit_s, target) for row in best_rows]
        differences = []
        for row, best_loss in zip(rows, best_losses, strict=False):
            difference = self.run_loss(row, limit_s, target) - best_loss
            # The difference is unknown if one of the two runs was rejected. Then the environment favours neither design.
            differences.append(difference if math.isfinite(difference) else 0.0)
        max_best_loss = max((loss for loss in best_losses if math.isfinite(loss)), default=0.0)
        return PairedLosses(differences, max_gain=max_best_loss - self.run_loss(PERFECT, limit_s, target))


def _times_s(rows: Sequence[RunRow], limit_s: float) -> list[float]:
    """Return the times of the runs that passed (s)."""
    return [min(row.elapsed_time_s or 0.0, limit_s) for row in rows if row.passed]


def _time(rows: Sequence[RunRow], limit_s: float) -> float:
    """Return the mean time of the runs (s), where a run that did not pass counts as the time limit."""
    times = _times_s(rows, limit_s)
    return math.fsum([*times, *[limit_s] * (len(rows) - len(times))]) / len(rows)


def _time_interval(rows: Sequence[RunRow], limit_s: float) -> Interval:
    """Return the 95 % interval of the mean time (s)."""
    times = _times_s(rows, limit_s)
    return limited_mean(len(times), len(rows), math.fsum(times), math.fsum(time**2 for time in times), limit_s)[1:]


def _energy(rows: Sequence[RunRow], limit_s: float) -> float:
    """Return the energy drawn in all runs per run that passed (J)."""
    energy_j, passed = _energies(rows).sum(axis=0)
    return float(energy_j / passed) if passed else math.inf


def _energy_interval(rows: Sequence[RunRow], limit_s: float) -> Interval:
    """Return the 95 % interval of :func:`_energy`, from RESAMPLES samples of the runs (Efron's bootstrap).

    The samples have a fixed seed. The interval contains the middle 95 % of their values.
    """
    # A row for each run: its energy (J), and 1 if it passed, else 0.
    table = _energies(rows)
    runs = len(table)
    # Each of the bootstrap's samples has as many runs as there are, drawn with replacement.
    drawn_runs = np.random.default_rng(0).integers(0, runs, (RESAMPLES, runs))
    energies_j, passed = table[drawn_runs].sum(axis=1).T
    # If no run of a sample passed, its energy per passed run is infinite.
    energies_per_passed_j = np.full(RESAMPLES, math.inf)
    has_passed = passed > 0
    energies_per_passed_j[has_passed] = energies_j[has_passed] / passed[has_passed]
    # Interpolation between infinite values would give NaN.
    low, high = np.quantile(energies_per_passed_j, (0.025, 0.975), method="nearest")
    return float(low), float(high)


def _energies(rows: Sequence[RunRow]) -> Any:
    """Return (runs, 2): energy (J) and 1 if the run passed, else 0; a run of unknown energy gets the mean energy."""
    energies_j = [row.consumed_energy_j for row in rows if row.consumed_energy_j is not None]
    mean = math.fsum(energies_j) / len(energies_j) if energies_j else math.inf
    return np.array([(mean if row.consumed_energy_j is None else row.consumed_energy_j, row.passed) for row in rows])


def _success(rows: Sequence[RunRow], limit_s: float) -> float:
    """Return the fraction of the runs that passed."""
    return sum(bool(row.passed) for row in rows) / len(rows)


def _success_interval(rows: Sequence[RunRow], limit_s: float) -> Interval:
    """Return the 95 % interval of the success rate."""
    return wilson_interval(sum(bool(row.passed) for row in rows), len(rows))


def _success_loss(row: RunRow, limit_s: float, target: float) -> float:
    """Return the loss of a run against a success rate."""
    return math.nan if row.passed is None else target - row.passed


def is_dominated(losses: Sequence[float], others: Iterable[Sequence[float]]) -> bool:
    """Return whether one of ``others`` is at least as good as ``losses`` in each objective, and better in one.

    Smaller losses are better.
    """
    return any(
        list(other) != list(losses) and all(a <= b for a, b in zip(other, losses, strict=True)) for other in others
    )


OBJECTIVES = {
    objective.name: objective
    for objective in (
        Objective(BUILT, "", True, "expected success of built cars", _success, _success_interval, _success_loss),
        Objective("success", "", True, "success in simulation", _success, _success_interval, _success_loss),
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
