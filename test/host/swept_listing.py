"""Sweeps a listing as the command does, into a store, for tests of what is in it afterwards."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import Result
from foldcar.store.reader import Store
from foldcar.study.experiment_runs import Progress
from foldcar.study.experiments import read_study
from foldcar.study.sweep import Sweep

WriteListing = Callable[[Any], Path]


def swept(listing: Path, store: Path, carsim: Path, jobs: int = 2, environments: int | None = None) -> Progress:
    return Sweep(read_study(listing, environments=environments), store, Carsim(carsim), "foldcar sweep …").run(jobs)


def rows(store: Path) -> list[Result]:
    with Store.open(store) as opened:
        return list(opened.results())


def stored_runs(store: Path) -> int:
    """How many runs a store has while it is being written; 0 before it is one."""
    try:
        with Store.open(store) as opened:
            return sum(experiment.stored_runs for experiment in opened.info().experiments.values())
    except FoldcarError:
        return 0
