"""A store's runs as arrays; commands that need no pandas table start sooner without importing pandas."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.errors import StoreError
from foldcar.store.reader import RUN_CELLS, Store


@dataclass(frozen=True)
class RunArrays:
    """The runs of one experiment, ordered by design and sample, as arrays (runs,).

    ``design`` is the index among the store's designs, ``outcome`` the index in OUTCOMES. ``metrics`` (runs, metrics) are
    in the order of NUMBERS, NaN if unknown.
    """

    design: NDArray[np.int64]
    sample: NDArray[np.int64]
    outcome: NDArray[np.uint8]
    metrics: NDArray[np.float64]

    @property
    def counted(self) -> "RunArrays":
        """The runs that were not rejected."""
        kept = self.outcome != OUTCOMES.index(REJECTED)
        return RunArrays(self.design[kept], self.sample[kept], self.outcome[kept], self.metrics[kept])


def run_arrays(store: Store, experiment: str) -> RunArrays:
    """Return the runs of an experiment; they are read once from an open store. Raises StoreError."""
    return store.once(("arrays", experiment), lambda: _read_runs(store, experiment))


def _read_runs(store: Store, name: str) -> RunArrays:
    """Read an experiment's runs into arrays. Raises StoreError if a design is missing."""
    codes = {outcome: code for code, outcome in enumerate(OUTCOMES)}
    # Places in a row of RUN_CELLS.
    metric_columns = [RUN_CELLS.index(metric) for metric in NUMBERS]
    outcome_column = RUN_CELLS.index("outcome")
    # The empty first arrays give an experiment without runs the right shapes.
    keys, outcomes, metrics = [np.empty((0, 2), np.int64)], [np.empty(0, np.uint8)], [np.empty((0, len(NUMBERS)))]
    for positions_and_samples, cells in store.run_batches(name):
        columns = list(zip(*cells, strict=True))
        keys.append(np.array(positions_and_samples, dtype=np.int64))
        outcomes.append(np.fromiter(map(codes.__getitem__, columns[outcome_column]), np.uint8, len(cells)))
        # (runs, metrics); None becomes NaN.
        metrics.append(np.array([columns[metric] for metric in metric_columns], dtype=np.float64).T)
    position, sample = np.concatenate(keys).T
    positions = np.array(list(store.designs(name)), dtype=np.int64)
    design = np.searchsorted(positions, position)
    if len(position) and (design.max() >= len(positions) or (positions[design] != position).any()):
        raise StoreError(f"{store.path}: experiment {name} has runs of a design that is missing")
    return RunArrays(design, sample, np.concatenate(outcomes), np.concatenate(metrics))
