"""A bar of finished runs on a terminal, for commands that simulate without storing runs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from foldcar.interrupts import held


@contextmanager
def run_bar(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Gives a function that is told of finished runs; ``total`` is how many there will be."""
    console = Console(stderr=True)
    columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TextColumn("runs"), TimeRemainingColumn())
    bar = Progress(*columns, console=console, disable=not console.is_terminal)
    task = bar.add_task(label, total=total)
    with held(bar.stop), bar:
        yield lambda runs: bar.advance(task, runs)
