"""The runs of a study in all engines, read from the store into which they were swept.

Input: a store. Output: cases, and by engine the results in their order, None where that engine was not asked.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from foldcar.simulation.engines import ENGINES
from foldcar.simulation.results import NUMBERS
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
