"""Progress on a terminal, put away however the command ends; nothing where there is no terminal."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from rich import progress as rich_progress
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from foldcar.interrupts import held
from foldcar.shown_console import shown_console

if TYPE_CHECKING:
    from foldcar.search.search import Found
    from foldcar.study.experiment_runs import Progress

_Bar = TypeVar("_Bar", bound="TerminalBar")


class TerminalBar:
    """A bar of ``total`` steps called ``label``, shown within ``with``."""

    def __init__(self, label: str, total: int, *, before: str = "", after: str = "") -> None:
        """``before`` and ``after`` name text fields that stand before and after the remaining time."""
        columns: list[rich_progress.ProgressColumn] = [TextColumn(label, markup=False), BarColumn(), MofNCompleteColumn()]
        texts = {name: TextColumn(f"{{task.fields[{name}]}}", markup=False) for name in (before, after) if name}
        columns += [texts[before]] if before else []
        columns += [TimeRemainingColumn()]
        columns += [texts[after]] if after else []
        console = shown_console(stderr=True)
        self._bar = rich_progress.Progress(*columns, console=console, disable=not console.is_terminal)
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


@contextmanager
def working(on: str) -> Iterator[None]:
    """Within ``with``, a line on a terminal's stderr says what takes time."""
    with shown_console(stderr=True).status(on) as status, held(status.stop):
        yield


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


class ReplayBar(TerminalBar):
    """``with ReplayBar() as bar``: ``bar.plan`` adds steps, ``bar.done`` says how many more are done."""

    def __init__(self) -> None:
        super().__init__("replay", 0)
        self._planned = 0

    def plan(self, steps: int) -> None:
        """So many more steps are to be done."""
        self._planned += steps
        self.show(total=self._planned)


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
