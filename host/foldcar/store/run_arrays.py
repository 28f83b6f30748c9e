"""A store's runs as arrays; commands that need no pandas table start sooner without importing pandas."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.errors import StoreError
from foldcar.store.reader import RUN_CELLS, Store


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


def _read_runs(store: Store, name: str) -> RunArrays:
    """Read the runs of an experiment into arrays with an entry for each run. Raises StoreError if a design is missing."""
    index_of_outcome = {outcome: index for index, outcome in enumerate(OUTCOMES)}
    # Each list has an array for each batch of runs. The empty first arrays give an experiment without runs the right
    # shapes.
    positions_and_samples = [np.empty((0, 2), np.int64)]
    outcomes = [np.empty(0, np.uint8)]
    metrics = [np.empty((0, len(NUMBERS)))]
    for batch_positions_and_samples, cells_of_runs in store.run_batches(name):
        # The values of all runs of the batch, by column of the table of runs.
        values_by_column = dict(zip(RUN_CELLS, zip(*cells_of_runs, strict=True), strict=True))
        positions_and_samples.append(np.array(batch_positions_and_samples, dtype=np.int64))
        batch_outcomes = (index_of_outcome[outcome] for outcome in values_by_column["outcome"])
        outcomes.append(np.fromiter(batch_outcomes, np.uint8, len(cells_of_runs)))
        # A missing number, None, becomes NaN.
        batch_metrics = np.array([values_by_column[metric] for metric in NUMBERS], dtype=np.float64)
        metrics.append(batch_metrics.T)
    position_of_run, sample_of_run = np.concatenate(positions_and_samples).T
    # Find the index of each run's design. In a damaged store designs may be missing.
    design_positions = np.array(list(store.designs(name)), dtype=np.int64)
    design_of_run = np.searchsorted(design_positions, position_of_run)
    if len(position_of_run):
        is_beyond_last = design_of_run.max() >= len(design_positions)
        if is_beyond_last or (design_positions[design_of_run] != position_of_run).any():
            raise StoreError(f"{store.path}: experiment {name} has runs of a design that is missing")
    return RunArrays(
        design=design_of_run,
        sample=sample_of_run,
        outcome=np.concatenate(outcomes),
        metrics=np.concatenate(metrics),
    )
