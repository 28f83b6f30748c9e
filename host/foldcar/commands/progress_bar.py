"""Displays a sweep's progress on a terminal: bar, runs per second, remaining time, success rate so far."""

from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress

from foldcar.interrupts import held

if TYPE_CHECKING:
    from foldcar.study.progress import Progress


class ProgressBar:
    """``with ProgressBar(progress) as bar``: call ``bar.update`` when the counts change."""

    def __init__(self, progress: "Progress", designs: int | None = None) -> None:
        """``designs`` is the number of those to be decided; None: there is nothing to decide."""
        self._designs = designs
        console = Console(stderr=True)
        self._bar = RichProgress(
            TextColumn("sweep"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[success]}"),
            console=console,
            disable=not console.is_terminal,
        )
        self._held = ExitStack()
        self._task = self._bar.add_task("sweep", total=progress.total, rate="", success="")

    def __enter__(self) -> "ProgressBar":
        self._held.enter_context(held(self._bar.stop))
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._held.close()

    def update(self, progress: "Progress") -> None:
        """Display the counts."""
        rate = progress.new / progress.seconds if progress.seconds > 0 else 0.0
        success = ""
        # Where some experiments define no success, the shares of the others are told at the end.
        if self._designs is not None:
            success = f"{progress.decided} of {self._designs} designs decided"
        elif progress.done and progress.judged == progress.total:
            success = f"{100 * progress.passed / progress.done:.0f} % passed"
        self._bar.update(
            self._task, completed=progress.done, total=progress.total, rate=f"{rate:.0f} runs/s", success=success
        )

    def say(self, line: str) -> None:
        """Print a line on stderr, above the bar."""
        self._bar.console.print(line, soft_wrap=True, markup=False, highlight=False)
