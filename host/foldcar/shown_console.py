"""A rich console that escapes control characters in text, and tables of results to print on it."""

import sys
from collections.abc import Collection, Iterable
from typing import Any, TextIO

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from foldcar.shown_text import plain_stream, shown


def shown_console(plain_width: int | None = None, *, stderr: bool = False, file: TextIO | None = None) -> Console:
    """Return a console on ``file``, else on standard error or output.

    If that is not a terminal, the console is ``plain_width`` characters wide (None: rich decides).
    """
    # Bypass the stream that escapes control characters: it would escape rich's own sequences.
    stream = plain_stream(sys.stderr if stderr else sys.stdout) if file is None else file
    width = None if stream.isatty() else plain_width
    return _ShownConsole(file=stream, width=width, markup=False, emoji=False, highlight=False)


class _ShownConsole(Console):
    """A console that escapes control characters in all text."""

    def render_str(self, text: str, **options: Any) -> Text:
        # rich measures the columns by what this returns.
        return super().render_str(shown(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else shown(text), style, control)


# Longer tables are printed plainly, because rich is slow.
MAX_FRAMED = 500


class ResultTable:
    """A table with the column titles ``heads``, printed without frames if it has more than MAX_FRAMED rows.

    Cells are aligned right and never wrap; in the columns ``left`` they are aligned left and may wrap. Brackets in cells
    are not markup.
    """

    def __init__(self, *heads: str, left: Collection[str] = ()) -> None:
        self._heads, self._left = heads, left
        self._rows: list[tuple[str, ...]] = []

    def add_row(self, *cells: str) -> None:
        """Add a row with one cell for each column."""
        self._rows.append(tuple(map(shown, cells)))

    def print_on(self, console: Console) -> None:
        """Print the table on a `shown_console`."""
        # rich is too slow for long tables.
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
        """Return the table as lines of text with aligned columns."""
        # rich takes 2 ms a row for layout and frames.
        rows = [self._heads, *(tuple(cell.replace("\n", " ") for cell in cells) for cells in self._rows)]
        columns = [_aligned(cells, cells[0] not in self._left) for cells in zip(*rows, strict=True)]
        return ["  ".join(cells).rstrip() for cells in zip(*columns, strict=True)]


def _aligned(cells: tuple[str, ...], right: bool) -> list[str]:
    """Return the cells of a column with spaces before or after them, so that all have the same width on a terminal."""
    widths = [len(cell) if cell.isascii() else cell_len(cell) for cell in cells]
    column_width = max(widths)
    if right:
        return [" " * (column_width - width) + cell for cell, width in zip(cells, widths, strict=True)]
    return [cell + " " * (column_width - width) for cell, width in zip(cells, widths, strict=True)]
