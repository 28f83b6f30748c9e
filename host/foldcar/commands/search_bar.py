"""Displays a search's progress on a terminal: bar of designs, runs per second, remaining time, the best so far."""

from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from foldcar.interrupts import held

if TYPE_CHECKING:
    from foldcar.search.search import Found


class SearchBar:
    """``with SearchBar(found) as bar``: call ``bar.update`` when the counts change."""

    def __init__(self, found: "Found") -> None:
        console = Console(stderr=True)
        texts = (TextColumn("{task.fields[rate]}"), TimeRemainingColumn(), TextColumn("{task.fields[state]}"))
        columns = (TextColumn("designs"), BarColumn(), MofNCompleteColumn(), *texts)
        self._bar = Progress(*columns, console=console, disable=not console.is_terminal)
        self._held = ExitStack()
        self._task = self._bar.add_task("designs", total=found.planned, rate="", state="")

    def __enter__(self) -> "SearchBar":
        self._held.enter_context(held(self._bar.stop))
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._held.close()

    def update(self, found: "Found") -> None:
        """Display the counts."""
        rate = found.new / found.seconds if found.seconds > 0 else 0.0
        state = "" if found.best_so_far is None else f"best so far {found.best_so_far:.4g}"
        if found.best:
            state = "judging the best"
        self._bar.update(self._task, completed=found.designs, rate=f"{rate:.0f} runs/s", state=state)
