"""A store's runs as arrays; commands that need no pandas table start sooner without importing pandas."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.errors import StoreError
from foldcar.store.reader import RUN_CELLS, RunBatch, Store

INDEX_OF_OUTCOME = {outcome: index for index, outcome in enumerate(OUTCOMES)}


@dataclass(frozen=True)
class RunArrays:
    """The runs of one experiment as arrays with one entry for each run, ordered by design and sample.

    ``design`` is the index of the run's design in the experiment's order, ``outcome`` the index in OUTCOMES. ``metrics``
    (runs, metrics) has a column for each of NUMBERS; unknown ones are NaN.
    """

    design: NDArray[np.int64]
    sample: NDArray[np.int64]
    outcome: NDArray[np.uint8]
    metrics: NDArray[np.float64]

    @property
    def counted(self) -> "RunArrays":
        """The runs that were not rejected."""
        is_counted = self.outcome != OUTCOMES.index(REJECTED)
        return RunArrays(
            design=self.design[is_counted],
            sample=self.sample[is_counted],
            outcome=self.outcome[is_counted],
            metrics=self.metrics[is_counted],
        )


def run_arrays(store: Store, experiment: str) -> RunArrays:
    """Return the runs of an experiment; they are read once from an open store. Raises StoreError."""
    return store.once(("arrays", experiment), lambda: _read_runs(store, experiment))


class _BatchArrays(NamedTuple):
    """Some runs as arrays with one entry for each run; ``position`` is that of the run's design in the family."""

    position: NDArray[np.int64]
    sample: NDArray[np.int64]
    outcome: NDArray[np.uint8]
    metrics: NDArray[np.float64]


def _read_runs(store: Store, name: str) -> RunArrays:
    """Read the runs of an experiment into arrays with an entry for each run. Raises StoreError if a design is missing."""
    # The empty first batch gives an experiment without runs arrays of the right types and shapes.
    batches = [
        _BatchArrays(
            position=np.empty(0, np.int64),
            sample=np.empty(0, np.int64),
            outcome=np.empty(0, np.uint8),
            metrics=np.empty((0, len(NUMBERS))),
        )
    ]
    for batch in store.run_batches(name):
        batches.append(_batch_arrays(batch))
    position_of_run = np.concatenate([batch.position for batch in batches])
    design_positions = np.array(list(store.designs(name)), dtype=np.int64)
    # In a damaged store designs may be missing.
    if not np.isin(position_of_run, design_positions).all():
        raise StoreError(f"{store.path}: experiment {name} has runs of a design that is missing")
    return RunArrays(
        design=np.searchsorted(design_positions, position_of_run),
        sample=np.concatenate([batch.sample for batch in batches]),
        outcome=np.concatenate([batch.outcome for batch in batches]),
        metrics=np.concatenate([batch.metrics for batch in batches]),
    )


def _batch_arrays(batch: RunBatch) -> _BatchArrays:
    """Return the runs of a batch as arrays."""
    values_by_column = dict(zip(RUN_CELLS, zip(*batch.cells, strict=True), strict=True))
    outcomes = [INDEX_OF_OUTCOME[outcome] for outcome in values_by_column["outcome"]]
    # An array of floating-point numbers has NaN for a missing number (None).
    metrics = np.array([values_by_column[metric] for metric in NUMBERS], dtype=np.float64)
    return _BatchArrays(
        position=np.array(batch.positions, dtype=np.int64),
        sample=np.array(batch.samples, dtype=np.int64),
        outcome=np.array(outcomes, dtype=np.uint8),
        metrics=metrics.T,
    )
