"""Rich's console for texts that come from files, names and cars, and tables of results on it."""

import sys
from collections.abc import Collection, Iterable
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from foldcar.shown_text import plain_stream, shown


def shown_console(plain_width: int | None = None, *, stderr: bool = False) -> Console:
    """A console; where its output is no terminal it has ``plain_width`` characters (None: as rich chooses)."""
    # Past the stream that would write out rich's own escape sequences.
    stream = plain_stream(sys.stderr if stderr else sys.stdout)
    width = None if stream.isatty() else plain_width
    return _ShownConsole(file=stream, width=width, markup=False, emoji=False, highlight=False)


class _ShownConsole(Console):
    def render_str(self, text: str, **options: Any) -> Text:
        # Columns are measured by what this returns.
        return super().render_str(shown(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else shown(text), style, control)


# Rows beyond which nobody reads a table without a pager.
MAX_FRAMED = 500


class ResultTable:
    """Rows of texts under ``heads``, shown as they are: brackets in them are no markup. Long ones are plain everywhere.

    Cells end at the right, as numbers do, and never wrap, but for the columns of ``left``.
    """

    def __init__(self, *heads: str, left: Collection[str] = ()) -> None:
        self._heads, self._left = heads, left
        self._rows: list[tuple[str, ...]] = []

    def add_row(self, *cells: str) -> None:
        """A row of as many texts as there are columns."""
        self._rows.append(tuple(map(shown, cells)))

    def print_on(self, console: Console) -> None:
        """Print it on a `shown_console`."""
        if len(self._rows) > MAX_FRAMED:
            console.file.write("".join(f"{line}\n" for line in self._lines()))
            return
        table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)
        for head in self._heads:
            if head in self._left:
                table.add_column(head)
            else:
                table.add_column(head, justify="right", no_wrap=True, min_width=len(head))
        for cells in self._rows:
            table.add_row(*cells)
        console.print(table)

    def _lines(self) -> list[str]:
        # To lay out and frame takes rich 2 ms a row.
        rows = [self._heads, *(tuple(cell.replace("\n", " ") for cell in cells) for cells in self._rows)]
        columns = [_aligned(cells, cells[0] not in self._left) for cells in zip(*rows, strict=True)]
        return ["  ".join(cells).rstrip() for cells in zip(*columns, strict=True)]


def _aligned(cells: tuple[str, ...], right: bool) -> list[str]:
    widths = [len(cell) if cell.isascii() else cell_len(cell) for cell in cells]
    most = max(widths)
    if right:
        return [" " * (most - width) + cell for cell, width in zip(cells, widths, strict=True)]
    return [cell + " " * (most - width) for cell, width in zip(cells, widths, strict=True)]
