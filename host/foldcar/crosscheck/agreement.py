"""The agreement of two engines: pass or fail of each run, success rates of each design.

Input: pairs of results of the same cases. Output: numbers; shares are between 0 and 1.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.analysis.rate import wilson_interval
from foldcar.crosscheck.stored import Case
from foldcar.errors import FoldcarError
from foldcar.simulation.results import REJECTED

Pair = tuple[Case, Mapping[str, Any], Mapping[str, Any]]
DesignId = tuple[str, int]


@dataclass(frozen=True)
class DesignRates:
    """A design's number of runs, and the numbers that passed in the first and in the second engine."""

    columns: Mapping[str, float]
    runs: int
    first: int
    second: int


@dataclass(frozen=True)
class Agreement:
    """The number of compared ``runs``, and of those ``alike`` in pass or fail; ``designs`` by experiment and number.

    ``confusion`` counts (first outcome, second outcome), and alone has runs that were rejected in either engine.
    ``correlation`` of the designs' success rates is None where either engine has one rate for all; ``rmse`` and ``bias``
    (first minus second) are shares.
    """

    runs: int
    alike: int
    designs: Mapping[DesignId, DesignRates]
    confusion: Mapping[tuple[str, str], int]
    correlation: float | None
    rmse: float
    bias: float

    @property
    def share(self) -> float:
        """The share of runs that agree in pass or fail, 0 to 1."""
        return self.alike / self.runs

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval (low, high) of the share."""
        return wilson_interval(self.alike, self.runs)

    @property
    def kinds(self) -> list[tuple[tuple[str, str], int]]:
        """Disagreements of pass and fail by their outcomes, the most frequent first."""
        found = [
            (pair, n)
            for pair, n in self.confusion.items()
            if REJECTED not in pair and (pair[0] == "passed") != (pair[1] == "passed")
        ]
        return sorted(found, key=lambda entry: (-entry[1], entry[0]))


def agreement(pairs: Sequence[Pair]) -> Agreement:
    """The agreement of pairs; FoldcarError if no run of one engine can be compared with the other's."""
    confusion = Counter((first["outcome"], second["outcome"]) for _, first, second in pairs)
    pairs = [pair for pair in pairs if REJECTED not in (pair[1]["outcome"], pair[2]["outcome"])]
    if not pairs:
        raise FoldcarError("nothing to compare: no run that was not rejected in either engine")
    tallies: dict[DesignId, list[int]] = {}
    columns: dict[DesignId, Mapping[str, float]] = {}
    for case, first, second in pairs:
        tally = tallies.setdefault((case.experiment, case.design), [0, 0, 0])
        columns[case.experiment, case.design] = case.columns
        for place, passed in enumerate((True, passes(first), passes(second))):
            tally[place] += passed
    designs = {key: DesignRates(columns[key], *tally) for key, tally in sorted(tallies.items())}
    rates = numpy.array([(d.first / d.runs, d.second / d.runs) for d in designs.values()])
    differences = rates[:, 0] - rates[:, 1]
    varied = len(rates) > 1 and bool(numpy.all(numpy.ptp(rates, axis=0) > 0))
    return Agreement(
        runs=len(pairs),
        alike=sum(passes(first) == passes(second) for _, first, second in pairs),
        designs=designs,
        confusion=dict(confusion),
        correlation=float(numpy.corrcoef(rates.T)[0, 1]) if varied else None,
        rmse=float(numpy.sqrt(numpy.mean(differences**2))),
        bias=float(numpy.mean(differences)),
    )


def passes(result: Mapping[str, Any]) -> bool:
    """Whether a run passed."""
    return bool(result["outcome"] == "passed")
