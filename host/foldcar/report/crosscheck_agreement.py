"""The agreement of two engines: pass or fail of each run, success rates of each design.

Input: a store into which a study was swept in all engines. Output: cases with their results by engine; numbers of pairs
of results, shares between 0 and 1.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.analysis.rate import wilson_interval
from foldcar.errors import FoldcarError
from foldcar.simulation.engines import ENGINES
from foldcar.simulation.results import NUMBERS, REJECTED
from foldcar.store.info import engine_id
from foldcar.store.reader import Store

Results = dict[str, list[Mapping[str, Any] | None]]


@dataclass(frozen=True)
class Case:
    """One design of a listed experiment in one sample of its environment; ``columns`` has its parameters."""

    experiment: str
    design: int
    sample: int
    columns: Mapping[str, float]

    @property
    def label(self) -> str:
        """The case as messages name it."""
        return f"experiment {self.experiment}, design {self.design + 1}, sample {self.sample}"


def stored_name(experiment: str, engine: str) -> str:
    """What the store calls a listed experiment in that engine, a key of ENGINES."""
    return engine_id(experiment, ENGINES[engine].title)


def read_cases(store: Store, experiments: Sequence[str], engines: Iterable[str]) -> tuple[list[Case], Results]:
    """All cases of listed experiments; a result has ``outcome``, the metrics, and of a failed run its ``message``."""
    cases: list[Case] = []
    results: Results = {engine: [] for engine in engines}
    swept = store.info().experiments
    for experiment in experiments:
        names = {engine: stored_name(experiment, engine) for engine in results}
        found = {engine: _results(store, name) if name in swept else {} for engine, name in names.items()}
        designs = store.designs(next(iter(names.values())))
        for design, sample in sorted(set().union(*found.values()), key=lambda key: (key[1], key[0])):
            columns = {key: float(value) for key, value in designs[design].items() if not isinstance(value, str)}
            cases.append(Case(experiment, design, sample, columns))
            for engine, by_key in found.items():
                results[engine].append(by_key.get((design, sample)))
    return cases, results


def _results(store: Store, name: str) -> dict[tuple[int, int], Mapping[str, Any]]:
    return {
        (design, sample): {"outcome": row["outcome"], "message": row["message"], **{key: row[key] for key in NUMBERS}}
        for design, sample, row in store.run_rows(name)
    }


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
