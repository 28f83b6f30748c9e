"""A store's runs and trials as pandas tables, for analysis.

Unknown values are NaN in columns of numbers and NA in columns of booleans and strings.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.errors import StoreError
from foldcar.store.reader import RUN_CELLS, Store
from foldcar.store.tables import EXPERIMENT

# String columns, and the columns of table `experiment` that they come from.
HEAD = {"experiment": "id", "vehicle": "vehicle", "environment": "environment"}
COLUMNS = (*HEAD, "sample", "outcome", "passed", *NUMBERS)


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


def runs_frame(store: Store, experiment: str | None = None) -> pd.DataFrame:
    """Return a row for each stored run of all experiments, or of one, ordered by experiment, design and sample.

    Columns: ``experiment``, ``vehicle``, ``environment`` (strings); each design parameter (``width_mm``, float64);
    ``sample`` (int64); ``outcome`` (string); ``passed`` (boolean, NA for rejected runs, and if the experiment does not
    define success); the metrics of :mod:`foldcar.simulation.results` (float64). Raises StoreError.
    """
    names = store.experiment_ids(experiment)
    if len(names) == 1:
        # A shallow copy, so that columns that a caller adds are not in the cached table.
        return store.once(("frame", names[0]), lambda: _frame(store, names[0])).copy(deep=False)
    if names:
        tables = [runs_frame(store, name) for name in names]
        frame = pd.concat(tables, ignore_index=True)
        # Keep the parameters of all experiments together, as in the table of one experiment.
        parameters = dict.fromkeys(column for table in tables for column in table if column not in COLUMNS)
        return frame[[*HEAD, *parameters, *COLUMNS[len(HEAD) :]]]
    texts, no_numbers = _strings([]), np.empty(0)
    empty = {**dict.fromkeys(HEAD, texts), "sample": no_numbers.astype(np.int64), "outcome": texts}
    return pd.DataFrame({**empty, "passed": _booleans(no_numbers, no_numbers), **dict.fromkeys(NUMBERS, no_numbers)})


def trials_frame(store: Store, experiment: str | None = None) -> pd.DataFrame:
    """Return a row for each trial, in their order, of all experiments or of one; all standings are included.

    Columns: ``trial`` (int64), ``experiment``, ``vehicle_type`` (strings); each design parameter (float64); ``sample``
    (Int64, NA if unknown); ``outcome`` (string); ``passed`` (boolean, NA if aborted); ``counts`` (bool, True for
    trials of built cars that are neither withdrawn nor aborted); ``car``, ``car_name`` (strings, NA if unknown);
    ``elapsed_time_s``. Raises StoreError.
    """
    trials = list(store.trials(experiment))
    parameters = dict.fromkeys(name for trial in trials for name in trial.design)
    completed = [trial.completed for trial in trials]
    return pd.DataFrame(
        {
            "trial": np.array([trial.id for trial in trials], dtype=np.int64),
            "experiment": _strings(trial.experiment for trial in trials),
            "vehicle_type": _strings(trial.vehicle_type for trial in trials),
            **{name: _numbers([trial.design.get(name) for trial in trials]) for name in parameters},
            "sample": pd.array([trial.sample for trial in trials], dtype="Int64"),
            "outcome": _strings(trial.outcome for trial in trials),
            "passed": _booleans(np.array([trial.outcome == "passed" for trial in trials], dtype=bool), completed),
            "counts": np.array([trial.counts for trial in trials], dtype=bool),
            "car": _strings(trial.car for trial in trials),
            "car_name": _strings(trial.car_name for trial in trials),
            "elapsed_time_s": _numbers([trial.elapsed_time_s for trial in trials]),
        }
    )


def _frame(store: Store, name: str) -> pd.DataFrame:
    """Return the table of one experiment's runs, as :func:`runs_frame` describes it."""
    (experiment,) = store.rows(EXPERIMENT, "WHERE id = ?", name)
    designs, runs = list(store.designs(name).values()), run_arrays(store, name)
    parameters = dict.fromkeys(column for design in designs for column in design)
    is_defined = (runs.outcome != OUTCOMES.index(REJECTED)) & (name in store.judged_experiments())
    columns = {
        # HEAD has the column of the experiment's row for each column of the frame.
        **{column: _strings([experiment[key]]).repeat(len(runs.design)) for column, key in HEAD.items()},
        **{column: _numbers([design.get(column) for design in designs])[runs.design] for column in parameters},
        "sample": runs.sample,
        "outcome": _strings(OUTCOMES).take(runs.outcome),
        "passed": _booleans(runs.outcome == OUTCOMES.index("passed"), is_defined),
        **{metric: runs.metrics[:, index] for index, metric in enumerate(NUMBERS)},
    }
    return pd.DataFrame(columns, copy=False)


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


def _strings(values: Iterable[str | None]) -> Any:
    """Return a string column, with NA for None."""
    return pd.array(list(values), dtype="str")


def _numbers(values: Sequence[float | str | None]) -> Any:
    """Return numbers as float64 with NaN for None, or as objects if there are strings among them."""
    texts = any(isinstance(value, str) for value in values)
    return np.array(values, dtype=object if texts else np.float64)


def _booleans(values: Any, is_known: Any) -> Any:
    """Return a boolean column, with NA where ``is_known`` is False."""
    return pd.arrays.BooleanArray(np.asarray(values, dtype=bool), ~np.asarray(is_known, dtype=bool))
