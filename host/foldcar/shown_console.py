"""A rich console that escapes control characters in text, and tables of results to print on it."""

import sys
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
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
# Columns that may wrap are at least this wide, so that no text becomes a column of single letters.
MIN_WRAPPED = 16
# Characters between two columns of a framed table.
FRAME_GAP = 3


class ResultTable:
    """A table with the column titles ``heads``, printed without frames if it has more than MAX_FRAMED rows.

    Cells are aligned right and never wrap; in the columns ``left`` they are aligned left and may wrap. Brackets in cells
    are not markup. A table that is wider than the console gets titles of several lines, then cells of several lines in
    the columns ``left``. If it is still too wide, each row is printed as a block with a line for each cell.
    """

    def __init__(self, *heads: str, left: Collection[str] = ()) -> None:
        self._heads, self._left = heads, left
        self._rows: list[tuple[str, ...]] = []

    def add_row(self, *cells: str) -> None:
        """Add a row with one cell for each column."""
        self._rows.append(tuple(map(shown, cells)))

    def print_on(self, console: Console) -> None:
        """Print the table on a `shown_console`.

        If it is too wide for a terminal, each row is printed as a block of lines.
        """
        heads, widths = self._layout(console.width)
        fits = bool(widths)
        # rich is too slow for long tables, so they are printed without it.
        if len(self._rows) > MAX_FRAMED and (fits or not console.is_terminal):
            console.file.write("".join(f"{line}\n" for line in self._lines()))
            return
        if not fits:
            console.file.write("".join(f"{block}\n" for block in self._blocks(console.width)))
            return
        table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False, show_edge=False)
        for title, head, width in zip(self._heads, heads, widths, strict=True):
            if title in self._left:
                table.add_column(head, min_width=width)
            else:
                table.add_column(head, justify="right", no_wrap=True, min_width=width)
        for cells in self._rows:
            table.add_row(*cells)
        margin = "\n" if console.is_terminal else ""
        console.print(margin, table, margin, sep="", end="")

    def _layout(self, width: int) -> tuple[Sequence[str], list[int]]:
        """Return titles and least widths of the columns, so that the table fits into a console of this width.

        Titles are broken into several lines if needed, and then cells. The list of widths is empty if nothing fits.
        """
        # A column of this width holds its cells, and its title with one word a line.
        titles_by_word = [head.replace(" ", "\n") for head in self._heads]
        column_widths = self._min_widths(titles_by_word, wrapping=False)
        stacked = []
        for head, column_width in zip(self._heads, column_widths, strict=True):
            stacked.append("\n".join(textwrap.wrap(head, column_width)))
        for wrapping in (False, True):
            for heads in (self._heads, stacked):
                widths = self._min_widths(heads, wrapping)
                if sum(widths) + FRAME_GAP * (len(widths) - 1) <= width:
                    return heads, widths
        return self._heads, []

    def _min_widths(self, heads: Sequence[str], wrapping: bool) -> list[int]:
        """Return the smallest width of each column in characters, if the columns have these titles.

        Without ``wrapping``, a column is as wide as its longest line. With it, the cells of columns that are aligned to
        the left may be broken into lines of MIN_WRAPPED characters.
        """
        widths = []
        columns = zip(heads, *self._rows, strict=True)
        for name, cells in zip(self._heads, columns, strict=True):
            lines = [line for cell in cells for line in cell.split("\n")]
            width = max(cell_len(line) for line in lines)
            widths.append(min(width, MIN_WRAPPED) if wrapping and name in self._left else width)
        return widths

    def _blocks(self, width: int) -> Iterator[str]:
        """Yield each row as lines of ``title  cell``, without empty cells, in at most ``width`` characters."""
        title_width = max(map(cell_len, self._heads))
        indent = " " * (title_width + 2)
        for row in self._rows:
            lines = [
                textwrap.fill(cell, max(width, len(indent) + MIN_WRAPPED), subsequent_indent=indent,
                              initial_indent=f"{title.ljust(title_width)}  ")
                for title, cell in zip(self._heads, row, strict=True)
                if cell
            ]  # fmt: skip
            yield "".join(f"{line}\n" for line in lines)

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
