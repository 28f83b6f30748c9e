"""`--scheduler`: simulate on other machines, through Dask (docs/cluster.md)."""

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.processors import usable_processors

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.simulators import Simulators

Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Simulate at the workers of a Dask scheduler, as tcp://10.0.0.1:8786; local:4 starts 4 workers here.",
    ),
]


def check_scheduler_option(scheduler: str | None, jobs: int | None) -> None:
    """FoldcarError if the option's value is none, or stands beside ``--jobs``."""
    if scheduler is not None:
        from foldcar.cluster.connection import check_scheduler

        check_scheduler(scheduler, jobs)


@contextlib.contextmanager
def simulators(
    scheduler: str | None, jobs: int | None, carsim: "Carsim", say: Callable[[str], None]
) -> "Iterator[Simulators | int]":
    """Where the command simulates: at the scheduler's workers, or in ``jobs`` simulators here. FoldcarError."""
    if scheduler is None:
        yield jobs or usable_processors()
        return
    from foldcar.cluster.connection import open_cluster

    with open_cluster(scheduler, carsim, say) as cluster:
        yield cluster
