"""A study in Python: what a store holds, as tables, and the success of its designs with intervals."""

from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from foldcar.analysis.intervals import jeffreys_interval, wilson_interval
from foldcar.analysis.rate import Rate
from foldcar.api.names import columns_named
from foldcar.errors import FoldcarError
from foldcar.store.frames import runs_frame, trials_frame
from foldcar.store.reader import ExperimentInfo, Store

if TYPE_CHECKING:
    import pandas

T = TypeVar("T")


class Study:
    """A store, as the commands sweep and log write it. Tables are read once; `reload` reads them again.

    FoldcarError if there is no such store, or it is damaged.
    """

    def __init__(self, store: str | Path) -> None:
        self.path = Path(store)
        self._read(lambda opened: None)

    def __repr__(self) -> str:
        return f"Study({str(self.path)!r})"

    def reload(self) -> None:
        """Read what has been stored since."""
        for name in ("runs", "trials", "experiments"):
            self.__dict__.pop(name, None)

    @cached_property
    def runs(self) -> "pandas.DataFrame":
        """A row for each simulated run, as :func:`foldcar.store.frames.runs_frame` describes."""
        return self._read(runs_frame)

    @cached_property
    def trials(self) -> "pandas.DataFrame":
        """A row for each trial, as :func:`foldcar.store.frames.trials_frame` describes."""
        return self._read(trials_frame)

    @cached_property
    def experiments(self) -> Mapping[str, ExperimentInfo]:
        """The experiments that were swept, by id, with environment, settings and rule of success."""
        return self._read(lambda store: store.info().experiments if store.holds_study() else {})

    def rate(
        self,
        *,
        experiment: str | None = None,
        source: Literal["simulation", "trials"] = "simulation",
        confidence: float = 0.95,
        **design: float,
    ) -> Rate:
        """The share of one design's runs, or of its counted trials, that passed, with its interval.

        Parameters are named as columns (``width_mm=95``), or without unit if that is clear (``width=95``). As many as
        tell the design from the others are enough. FoldcarError if they leave several or none, if success is undefined,
        or if there are no runs (trials).
        """
        if source not in ("simulation", "trials"):
            raise FoldcarError(f'source: {source!r} is neither "simulation" nor "trials"')
        table = self.runs if source == "simulation" else self.trials[self.trials["counts"]]
        chosen = self._of_design(self._of_experiment(table, experiment, source), design, source)
        passed = chosen["passed"]
        if passed.isna().any():
            raise FoldcarError(self.experiments[str(chosen["experiment"].iloc[0])].success_rule)
        count, runs = int(passed.sum()), len(passed)
        interval, name = (wilson_interval, "Wilson") if source == "simulation" else (jeffreys_interval, "Jeffreys")
        low, high = interval(count, runs, confidence)
        what = "simulated runs" if source == "simulation" else "trials of built cars"
        return Rate(count / runs, low, high, confidence, f"{name} interval of {count} of {runs} {what} that passed")

    def _of_experiment(self, table: "pandas.DataFrame", experiment: str | None, source: str) -> "pandas.DataFrame":
        known = list(dict.fromkeys(table["experiment"]))
        if not known:
            what = "runs" if source == "simulation" else "trials of built cars that count"
            raise FoldcarError(f"{self.path}: has no {what}")
        if experiment is None and len(known) > 1:
            raise FoldcarError(f"{self.path}: has several experiments; choose with experiment=: {', '.join(known)}")
        if experiment is not None and experiment not in known:
            raise FoldcarError(f'{self.path}: has no "{experiment}" with {source}; it has {", ".join(known)}')
        return table if experiment is None else table[table["experiment"] == experiment]

    def _of_design(
        self, table: "pandas.DataFrame", design: Mapping[str, float], source: str
    ) -> "pandas.DataFrame":
        parameters = _parameters(table)
        found = table
        for column, value in columns_named(design, parameters, "rate").items():
            values = sorted(found[column].dropna().unique())
            found = found[found[column] == value]
            if found.empty:
                shown = ", ".join(f"{one:g}" for one in values)
                raise FoldcarError(f"{self.path}: no {source} with {column} {value:g}; there are {shown}")
        for column in parameters:
            values = sorted(found[column].dropna().unique())
            if len(values) > 1:
                shown = ", ".join(f"{one:g}" for one in values[:5])
                more = f", … {values[-1]:g}" if len(values) > 5 else ""
                raise FoldcarError(f"rate: {column} has several values ({shown}{more}): choose one")
        return found

    def _read(self, read: Callable[[Store], T]) -> T:
        with Store.open(self.path) as store:
            return read(store)


def _parameters(table: "pandas.DataFrame") -> list[str]:
    """The columns of design parameters: those between ``environment`` or ``vehicle_type`` and ``sample``."""
    columns: list[Any] = list(table.columns)
    first = max(columns.index(name) for name in ("environment", "vehicle_type") if name in columns)
    return [str(name) for name in columns[first + 1 : columns.index("sample")]]
