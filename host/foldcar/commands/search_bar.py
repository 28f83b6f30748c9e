"""Displays a search's progress on a terminal: bar of designs, runs per second, remaining time, the best so far."""

from typing import TYPE_CHECKING

from foldcar.commands.terminal_bar import TerminalBar

if TYPE_CHECKING:
    from foldcar.search.search import Found


class SearchBar(TerminalBar):
    """``with SearchBar(found) as bar``: call ``bar.update`` when the counts change."""

    def __init__(self, found: "Found") -> None:
        super().__init__("designs", found.planned, before="rate", after="state")

    def update(self, found: "Found") -> None:
        """Display the counts."""
        rate = found.new / found.seconds if found.seconds > 0 else 0.0
        state = "" if found.best_so_far is None else f"best so far {found.best_so_far:.4g}"
        if found.best:
            state = "judging the best"
        self.show(completed=found.designs, rate=f"{rate:.0f} runs/s", state=state)
