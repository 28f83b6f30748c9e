"""The agreement of two engines: pass or fail of each run, success rates of each design.

Input: a store into which a study was swept in all engines. Output: cases with their results by engine; what pairs of
results agree in, as numbers (shares 0 to 1) and as cells of a table.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.analysis.rate import wilson_interval
from foldcar.errors import FoldcarError
from foldcar.simulation.engines import ELLIPSOID, ENGINES, HALF_STEP, MUJOCO, MULTIBODY, SIDE_VIEW
from foldcar.simulation.results import NUMBERS, REJECTED
from foldcar.store.info import engine_id
from foldcar.store.reader import Store

# Those of the baseline show how far MuJoCo agrees with itself.
EVERY, BASELINE = (MULTIBODY, MUJOCO, SIDE_VIEW), (HALF_STEP, ELLIPSOID)
NAMES = {
    SIDE_VIEW: "side-view",
    MULTIBODY: "multibody",
    MUJOCO: "MuJoCo",
    HALF_STEP: "MuJoCo, half the time step",
    ELLIPSOID: "MuJoCo, ellipsoid tyres",
}
COMPARISON_HEAD = ["engines", "runs", "alike %", "95 % interval", "r of rates", "RMSE", "bias"]

Results = dict[str, list[Mapping[str, Any] | None]]


@dataclass(frozen=True)
class Case:
    """One design of a listed experiment in one sample of its environment; ``columns`` has its parameters."""

    experiment: str
    design: int
    sample: int
    columns: Mapping[str, float]


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


def comparisons(cases: Sequence[Case], results: Results, baseline: int) -> dict[str, Agreement]:
    """Multibody, the side view where it was swept, and the first ``baseline`` samples' variants, each against MuJoCo.

    By the names of both engines. FoldcarError if no run can be compared.
    """
    against = NAMES[MUJOCO]
    found = {f"{NAMES[MULTIBODY]} – {against}": agreement(pairs_of(cases, results, MULTIBODY))}
    in_plane = pairs_of(cases, results, SIDE_VIEW)
    if in_plane:
        found[f"{NAMES[SIDE_VIEW]} – {against}"] = agreement(in_plane)
    few = min(baseline, max(case.sample for case in cases) + 1)
    for engine in (MULTIBODY, *BASELINE) if few else ():
        pairs = [pair for pair in pairs_of(cases, results, engine) if pair[0].sample < few]
        found[f"{NAMES[engine]} – {against}, samples 0 to {few - 1}"] = agreement(pairs)
    return found


def pairs_of(cases: Sequence[Case], results: Results, engine: str) -> list[Pair]:
    """Results of that engine and of MuJoCo for the cases that both have run."""
    each = zip(cases, results[engine], results[MUJOCO], strict=True)
    return [(case, one, other) for case, one, other in each if one is not None and other is not None]


def comparison_row(name: str, one: Agreement) -> list[str]:
    """A comparison as the cells of COMPARISON_HEAD."""
    low, high = one.interval
    return [
        name,
        str(one.runs),
        f"{100 * one.share:.1f}",
        f"{100 * low:.1f} – {100 * high:.1f}",
        "–" if one.correlation is None else f"{one.correlation:.3f}",
        f"{100 * one.rmse:.1f}",
        f"{100 * one.bias:+.1f}",
    ]


def comparison_numbers(one: Agreement) -> Mapping[str, Any]:
    """A comparison as in summary.json; shares are 0 to 1."""
    return {
        **{key: getattr(one, key) for key in ("runs", "alike", "share", "interval", "correlation", "rmse", "bias")},
        "confusion": [[a, b, count] for (a, b), count in sorted(one.confusion.items())],
        "designs": [
            {"experiment": name, "design": number + 1, **d.columns, "runs": d.runs, "passed": [d.first, d.second]}
            for (name, number), d in one.designs.items()
        ],
    }


def column_name(engine: str) -> str:
    """How the names of an engine's columns in runs.csv begin."""
    return engine.replace("-", "_")
