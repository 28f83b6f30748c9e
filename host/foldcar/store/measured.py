"""Measured values of built cars and obstacles in a store, by experiment and parameter.

Input: a store that is opened for reading or writing. Output: values of the simulator's parameters, which are then known.
"""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.store.connection import writing
from foldcar.store.reader import Store
from foldcar.store.store_connection import StoreConnection
from foldcar.store.tables import MEASURED


def measured_values(store: Store, experiment: str) -> dict[str, float]:
    """Return the values measured for an experiment's trials of built cars, by parameter name."""
    return {row["parameter"]: row["value"] for row in store.rows(MEASURED, "WHERE experiment = ?", experiment)}


def experiment_to_measure(store: Store, named: str | None) -> str:
    """Return the experiment ``named`` or, if that is None, the store's only experiment. Raises FoldcarError.

    A store's experiments are those that were swept into it and those of its trials.
    """
    experiments: list[str] = []
    if store.holds_study():
        experiments += [info.listed_id for info in store.info().experiments.values()]
    experiments += [trial.experiment for trial in store.trials()]
    # Each experiment once, in the order in which they appear.
    experiments = list(dict.fromkeys(experiments))
    if not experiments:
        raise FoldcarError(f"{store.path}: has no experiment yet: sweep a listing into it, or drive trials")
    listed = ", ".join(experiments)
    if named is None:
        if len(experiments) > 1:
            raise FoldcarError(f"{store.path}: has experiments {listed}: choose one with --experiment")
        return experiments[0]
    if named not in experiments:
        raise FoldcarError(f'{store.path}: has no experiment "{named}"; it has {listed}')
    return named


class MeasuredWriter(StoreConnection):
    """A store opened for measured values. Create it with :func:`write_measured`; its methods raise StoreError."""

    def measure(self, experiment: str, values: Mapping[str, float | None]) -> None:
        """Store measured values by parameter name, replacing earlier ones; None deletes a value."""
        with self._transaction():
            for name, value in values.items():
                self._run("DELETE FROM measured WHERE experiment = ? AND parameter = ?", experiment, name)
                if value is not None:
                    self._insert(MEASURED, [{"experiment": experiment, "parameter": name, "value": value}])


@contextlib.contextmanager
def write_measured(path: Path) -> Iterator[MeasuredWriter]:
    """Open the store at ``path`` for measured values. Raises StoreError if it is in use."""
    with writing(path) as connection:
        yield MeasuredWriter(path, connection)
