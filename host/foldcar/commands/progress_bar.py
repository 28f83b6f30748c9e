"""Progress bars on a terminal's stderr. They are removed when the command ends; without a terminal nothing is shown."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from foldcar.shown_console import shown_console

if TYPE_CHECKING:
    from foldcar.study import experiment_runs as study
    from foldcar.study.reality_runs import RealityCounts
    from foldcar.study.search.search import SearchResult

_Bar = TypeVar("_Bar", bound="TerminalBar")


class TerminalBar:
    """A progress bar of ``total`` steps, shown during a `with` block.

    It shows the ``label``, a rate of runs, the remaining time and a state.
    """

    def __init__(self, label: str, total: int) -> None:
        rate = TextColumn("{task.fields[rate]}", markup=False)
        state = TextColumn("{task.fields[state]}", markup=False)
        console = shown_console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), rate,
            TimeRemainingColumn(), state, console=console, disable=not console.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task(label, total=total, rate="", state="")
        self._total = total

    def __enter__(self: _Bar) -> _Bar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def done(self, steps: int) -> None:
        """Advance the bar by ``steps``."""
        self._bar.advance(self._task, steps)

    def plan(self, steps: int) -> None:
        """Add ``steps`` to the total number of steps."""
        self._total += steps
        self._bar.update(self._task, total=self._total)

    def show(self, completed: int, new: int, seconds: float, state: str) -> None:
        """Display ``completed`` steps, the rate of ``new`` runs in ``seconds``, and the ``state``."""
        self._show(self._task, completed, new, seconds, state)

    def _show(self, task: TaskID, completed: int, new: int, seconds: float, state: str) -> None:
        """Display the progress of one of the bar's tasks."""
        rate = new / seconds if seconds > 0 else 0.0
        self._bar.update(task, completed=completed, rate=f"{rate:.0f} runs/s", state=state)

    def print_line(self, line: str) -> None:
        """Print a line on stderr, above the bar."""
        self._bar.console.print(line, soft_wrap=True)


@contextmanager
def working(message: str) -> Iterator[None]:
    """Show a message, which says what takes time, on a terminal's stderr during the block."""
    with shown_console(stderr=True).status(message):
        yield


class ProgressBar(TerminalBar):
    """``with ProgressBar(progress) as bar``: call ``bar.update`` when the counts change.

    A second bar appears below it when runs in other realities begin.
    """

    def __init__(self, progress: "study.Progress", designs: int | None = None, label: str = "sweep") -> None:
        """``designs`` is how many designs the stopping rule has to decide; None without a stopping rule."""
        super().__init__(label, progress.total)
        self._designs_to_decide = designs
        self._realities: TaskID | None = None

    def update(self, progress: "study.Progress") -> None:
        """Display the sweep's counts, with a text on its state at the end of the bar.

        With a stopping rule, the text says how many designs are decided; without one, how many of the runs have passed.
        """
        from foldcar.statistics.words import percent

        all_have_rates = progress.judged == progress.total and not progress.rejected
        state = ""
        if self._designs_to_decide is not None:
            state = f"{progress.decided} of {self._designs_to_decide} designs decided"
        elif progress.done and all_have_rates:
            # A rate of only some of the runs could mislead, so it is printed at the end.
            state = f"{percent(progress.passed / progress.done)} passed"
        self.show(progress.done, progress.new, progress.seconds, state)
        self._show_realities(list(progress.realities.values()))

    def _show_realities(self, counts: "list[RealityCounts]") -> None:
        """Display how many runs in other realities are done, in a bar of its own; each experiment has its ``counts``.

        A *reality* is a set of values of what the simulator does not know exactly, such as friction. Without such runs
        there is no bar.
        """
        total = sum(count.total for count in counts)
        if not total:
            return
        if self._realities is None:
            self._realities = self._bar.add_task("realities", total=total, rate="", state="")
        self._bar.update(self._realities, total=total)
        self._show(
            self._realities,
            completed=sum(count.done for count in counts),
            new=sum(count.new for count in counts),
            seconds=sum(count.seconds for count in counts),
            state="",
        )


class SearchBar(TerminalBar):
    """``with SearchBar("designs", n) as bar``: call ``bar.update`` when the search has progressed."""

    def update(self, progress: "SearchResult") -> None:
        """Display the search's counts and its best value so far."""
        state = "" if progress.best_so_far is None else f"best so far {progress.best_so_far:.4g}"
        self.show(progress.designs, progress.new, progress.seconds, "judging the best" if progress.best else state)
