"""A store's runs and trials as tables: the same cells that SQL reads from the store's views."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from foldcar.simulation.results import NUMBERS
from foldcar.store.errors import StoreError
from foldcar.store.frames import runs_frame, trials_frame
from foldcar.store.reader import Store
from foldcar.store.trial_writer import write_trials
from foldcar.store.writer import write_store
from written_study import FACTS, add_experiment, add_trial


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two experiments, of which the second varies another parameter and does not define success; trials of all kinds."""
    path = tmp_path_factory.mktemp("frames") / "s.db"
    with write_store(path) as writer:
        writer.begin_study(FACTS, "b")
        add_experiment(
            writer, "1", {"width_mm": [80.0, 95.5]}, 3, lambda d, k: "passed" if d["width_mm"] > 90 + k else "tipped", {}
        )
        undefined = {"success_defined": False, "success_rule": "success is undefined"}
        add_experiment(writer, "2", {"radius_mm": [60.0]}, 2, lambda d, k: "timeout", undefined)
    for outcome, car in (("passed", "built"), ("aborted", "built"), ("stuck", "simulated"), ("passed", None)):
        add_trial(path, {"width_mm": 95.5}, 1, outcome, car=car)
    add_trial(path, {"radius_mm": 60.0}, 0, "tipped", experiment="2")
    number = add_trial(path, {"width_mm": 80.0}, 2, "passed")
    with write_trials(path) as writer:
        writer.withdraw([number], True, "wrong tyres", "Ada")
    return path


def test_runs_are_those_of_the_result_view(store: Path) -> None:
    with Store.open(store) as opened:
        runs, second = runs_frame(opened), runs_frame(opened, "2")
    query = (
        "SELECT experiment, vehicle, environment, json_extract(parameters, '$.width_mm'), sample, outcome, "
        f"{', '.join(NUMBERS)} FROM result ORDER BY experiment_position, design_position, sample"
    )
    with closing(sqlite3.connect(store)) as connection:
        expected = connection.execute(query).fetchall()
    shown = runs[["experiment", "vehicle", "environment", "width_mm", "sample", "outcome", *NUMBERS]]
    assert [tuple(None if pd.isna(cell) else cell for cell in row) for row in shown.itertuples(index=False)] == expected
    assert list(runs.passed[:6]) == [False, False, False, True, True, True]
    assert runs.passed[6:].isna().all()
    assert runs.dtypes[["width_mm", "sample", "passed"]].astype(str).tolist() == ["float64", "int64", "boolean"]
    assert "width_mm" not in second
    assert np.array_equal(second["sample"], [0, 1])


def test_trials_count_as_the_trial_view_says(store: Path) -> None:
    with Store.open(store) as opened:
        trials = trials_frame(opened)
    with closing(sqlite3.connect(store)) as connection:
        expected = connection.execute("SELECT trial, counts FROM trial_result ORDER BY trial").fetchall()
    assert list(zip(trials.trial, trials.counts.astype(int), strict=True)) == expected
    assert trials.counts.sum() == 2
    assert [None if pd.isna(passed) else bool(passed) for passed in trials.passed] == [
        True,
        None,
        False,
        True,
        False,
        True,
    ]


def test_a_store_without_runs_has_an_empty_table_of_the_same_columns(tmp_path: Path) -> None:
    with write_trials(tmp_path / "t.db"):
        pass
    with Store.open(tmp_path / "t.db") as opened:
        runs, trials = runs_frame(opened), trials_frame(opened)
        with pytest.raises(StoreError, match='has no experiment "7"'):
            runs_frame(opened, "7")
    assert len(runs) == len(trials) == 0
    assert [*runs.columns] == ["experiment", "vehicle", "environment", "sample", "outcome", "passed", *NUMBERS]
    assert str(runs.passed.dtype) == "boolean"
