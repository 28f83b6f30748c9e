"""A store's runs and trials as pandas tables, for analysis.

Unknown values are NaN in columns of numbers and NA in columns of booleans and strings.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.reader import Store
from foldcar.store.run_arrays import run_arrays
from foldcar.store.tables import EXPERIMENT

# String columns, and the columns of table `experiment` that they come from.
HEAD = {"experiment": "id", "vehicle": "vehicle", "environment": "environment"}
COLUMNS = (*HEAD, "sample", "outcome", "passed", *NUMBERS)


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
