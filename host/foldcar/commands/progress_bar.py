"""Displays a sweep's progress on a terminal: bar, runs per second, remaining time, success rate so far."""

from typing import TYPE_CHECKING

from foldcar.commands.terminal_bar import TerminalBar

if TYPE_CHECKING:
    from foldcar.study.progress import Progress


class ProgressBar(TerminalBar):
    """``with ProgressBar(progress) as bar``: call ``bar.update`` when the counts change."""

    def __init__(self, progress: "Progress", designs: int | None = None, label: str = "sweep") -> None:
        """``designs`` is the number of those to be decided; None: there is nothing to decide."""
        super().__init__(label, progress.total, before="rate", after="success")
        self._designs = designs

    def update(self, progress: "Progress") -> None:
        """Display the counts."""
        rate = progress.new / progress.seconds if progress.seconds > 0 else 0.0
        success = ""
        # Where some experiments define no success, or runs were rejected, shares are told at the end.
        if self._designs is not None:
            success = f"{progress.decided} of {self._designs} designs decided"
        elif progress.done and progress.judged == progress.total and not progress.rejected:
            success = f"{100 * progress.passed / progress.done:.0f} % passed"
        self.show(completed=progress.done, total=progress.total, rate=f"{rate:.0f} runs/s", success=success)
