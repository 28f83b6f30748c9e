"""A progress bar on a terminal, which is put away however the command ends; nothing where there is no terminal."""

from contextlib import ExitStack
from types import TracebackType
from typing import Any, TypeVar

from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

from foldcar.interrupts import held
from foldcar.shown_console import shown_console

_Bar = TypeVar("_Bar", bound="TerminalBar")


class TerminalBar:
    """A bar of ``total`` steps called ``label``, shown within ``with``."""

    def __init__(self, label: str, total: int, *, before: str = "", after: str = "") -> None:
        """``before`` and ``after`` name text fields that stand before and after the remaining time."""
        columns: list[ProgressColumn] = [TextColumn(label, markup=False), BarColumn(), MofNCompleteColumn()]
        texts = {name: TextColumn(f"{{task.fields[{name}]}}", markup=False) for name in (before, after) if name}
        columns += [texts[before]] if before else []
        columns += [TimeRemainingColumn()]
        columns += [texts[after]] if after else []
        console = shown_console(stderr=True)
        self._bar = Progress(*columns, console=console, disable=not console.is_terminal)
        self._task = self._bar.add_task(label, total=total)
        self.show(**dict.fromkeys(texts, ""))
        self._held = ExitStack()

    def __enter__(self: _Bar) -> _Bar:
        self._held.enter_context(held(self._bar.stop))
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._held.close()

    def done(self, steps: int) -> None:
        """So many more steps are done."""
        self._bar.advance(self._task, steps)

    def show(self, **values: Any) -> None:
        """Display ``completed``, ``total`` or texts by their fields' names."""
        self._bar.update(self._task, **values)

    def say(self, line: str) -> None:
        """Print a line on stderr, above the bar."""
        self._bar.console.print(line, soft_wrap=True)
