"""Displays on a terminal how far a report's simulations are."""

from foldcar.commands.terminal_bar import TerminalBar


class ReplayBar(TerminalBar):
    """``with ReplayBar() as bar``: ``bar.plan`` adds steps, ``bar.done`` says how many more are done."""

    def __init__(self) -> None:
        super().__init__("replay", 0)
        self._planned = 0

    def plan(self, steps: int) -> None:
        """So many more steps are to be done."""
        self._planned += steps
        self.show(total=self._planned)
