"""Displays on a terminal how far a report's simulations are."""

from contextlib import ExitStack
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from foldcar.interrupts import held


class ReplayBar:
    """``with ReplayBar() as bar``: ``bar.plan`` adds steps, ``bar.done`` says how many more are done."""

    def __init__(self) -> None:
        console = Console(stderr=True)
        columns = (TextColumn("replay"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=console, disable=not console.is_terminal)
        self._task = self._bar.add_task("replay", total=0)
        self._planned = 0
        self._held = ExitStack()

    def __enter__(self) -> "ReplayBar":
        self._held.enter_context(held(self._bar.stop))
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._held.close()

    def plan(self, steps: int) -> None:
        """So many more steps are to be done."""
        self._planned += steps
        self._bar.update(self._task, total=self._planned)

    def done(self, steps: int) -> None:
        """So many more steps are done."""
        self._bar.advance(self._task, steps)
