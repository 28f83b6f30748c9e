"""A store's runs and trials as pandas tables, for analysis.

Unknown values are NaN in columns of numbers and NA in columns of booleans and strings.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.other_drives import trials_unlike_runs
from foldcar.store.reader import Store
from foldcar.store.run_arrays import run_arrays
from foldcar.store.tables import EXPERIMENT

# String columns, and the columns of table `experiment` that they come from.
# The first columns, each with the column of the table of experiments that it comes from.
HEAD = {"experiment": "id", "vehicle": "vehicle", "environment": "environment"}
COLUMNS = (*HEAD, "sample", "outcome", "passed", *NUMBERS)


def runs_frame(store: Store, experiment: str | None = None) -> pd.DataFrame:
    """Return a row for each stored run of all experiments, or of one, ordered by experiment, design and sample.

    Columns: ``experiment``, ``vehicle``, ``environment`` (strings); each design parameter (``width_mm``, float64);
    ``sample`` (int64); ``outcome`` (string); ``passed`` (boolean, NA for rejected runs, and if the experiment does not
    define success); the metrics of :mod:`foldcar.simulation.results` (float64). Raises StoreError.
    """
    names = store.experiment_ids(experiment)
    if not names:
        return _frame_without_runs()
    if len(names) == 1:
        # A shallow copy, so that columns that a caller adds are not in the cached table.
        return store.once(("frame", names[0]), lambda: _frame(store, names[0])).copy(deep=False)
    frames = [runs_frame(store, name) for name in names]
    frame = pd.concat(frames, ignore_index=True)
    # pandas appends the parameters that only later experiments have at the end: move them to the other parameters.
    parameters = [column for column in frame if column not in COLUMNS]
    columns_after_parameters = COLUMNS[len(HEAD) :]
    return frame[[*HEAD, *parameters, *columns_after_parameters]]


def _frame_without_runs() -> pd.DataFrame:
    """Return the table of a store without experiments: no rows, and the columns that every store's table has."""
    no_strings, no_numbers = _strings([]), np.empty(0)
    columns = dict.fromkeys(HEAD, no_strings)
    columns["sample"] = no_numbers.astype(np.int64)
    columns["outcome"] = no_strings
    columns["passed"] = _booleans(no_numbers, no_numbers)
    columns.update(dict.fromkeys(NUMBERS, no_numbers))
    return pd.DataFrame(columns)


def trials_frame(store: Store, experiment: str | None = None) -> pd.DataFrame:
    """Return a row for each trial of all experiments, or of one, in the order of their numbers.

    Trials of simulated cars, and withdrawn and aborted ones, are included.

    Columns: ``trial`` (int64), ``experiment``, ``vehicle_type`` (strings); each design parameter (float64); ``sample``
    (Int64, NA if unknown); ``outcome`` (string); ``passed`` (boolean, NA if aborted); ``counts`` (bool, True for
    trials of built cars that are neither withdrawn nor aborted); ``unlike_runs`` (string: what differs if the trial was
    driven otherwise than the runs of its experiment, NA if nothing does); ``car``, ``car_name`` (strings, NA if unknown);
    ``elapsed_time_s``. Raises StoreError.
    """
    trials = list(store.trials(experiment))
    differences = trials_unlike_runs(store)
    parameters = dict.fromkeys(name for trial in trials for name in trial.design)
    passed = np.array([trial.outcome == "passed" for trial in trials], dtype=bool)
    completed = [trial.completed for trial in trials]
    return pd.DataFrame(
        {
            "trial": np.array([trial.id for trial in trials], dtype=np.int64),
            "experiment": _strings(trial.experiment for trial in trials),
            "vehicle_type": _strings(trial.vehicle_type for trial in trials),
            **{name: _numbers([trial.design.get(name) for trial in trials]) for name in parameters},
            "sample": pd.array([trial.sample for trial in trials], dtype="Int64"),
            "outcome": _strings(trial.outcome for trial in trials),
            "passed": _booleans(passed, is_known=completed),
            "counts": np.array([trial.counts for trial in trials], dtype=bool),
            "unlike_runs": _strings(differences.get(trial.id) for trial in trials),
            "car": _strings(trial.car for trial in trials),
            "car_name": _strings(trial.car_name for trial in trials),
            "elapsed_time_s": _numbers([trial.elapsed_time_s for trial in trials]),
        }
    )


def _frame(store: Store, name: str) -> pd.DataFrame:
    """Return the table of the experiment ``name`` with a row for each run; :func:`runs_frame` describes its columns."""
    (experiment,) = store.rows(EXPERIMENT, "WHERE id = ?", name)
    designs = list(store.designs(name).values())
    runs = run_arrays(store, name)
    columns: dict[str, Any] = {}
    for column, experiment_column in HEAD.items():
        # The same text in every row.
        columns[column] = _strings([experiment[experiment_column]]).repeat(len(runs.design))
    # The parameters of all designs, each once, in the order of the designs.
    parameters = dict.fromkeys(parameter for design in designs for parameter in design)
    for parameter in parameters:
        values_by_design = _numbers([design.get(parameter) for design in designs])
        columns[parameter] = values_by_design[runs.design]
    columns["sample"] = runs.sample
    # ``runs.outcome`` has the index of each run's outcome in OUTCOMES.
    columns["outcome"] = _strings(OUTCOMES).take(runs.outcome)
    is_judged = (runs.outcome != OUTCOMES.index(REJECTED)) & (name in store.judged_experiments())
    columns["passed"] = _booleans(runs.outcome == OUTCOMES.index("passed"), is_known=is_judged)
    for index, metric in enumerate(NUMBERS):
        columns[metric] = runs.metrics[:, index]
    return pd.DataFrame(columns, copy=False)


def _strings(values: Iterable[str | None]) -> Any:
    """Return a string column, with NA for None."""
    return pd.array(list(values), dtype="str")


def _numbers(values: Sequence[float | str | None]) -> Any:
    """Return numbers as float64 with NaN for None, or as objects if there are strings among them."""
    has_strings = any(isinstance(value, str) for value in values)
    return np.array(values, dtype=object if has_strings else np.float64)


def _booleans(values: Any, is_known: Any) -> Any:
    """Return a boolean column, with NA where ``is_known`` is False."""
    return pd.arrays.BooleanArray(np.asarray(values, dtype=bool), ~np.asarray(is_known, dtype=bool))
