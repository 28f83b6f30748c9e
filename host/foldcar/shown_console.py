"""A rich console that escapes control characters in text, and tables of results to print on it."""

import sys
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TextIO

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from foldcar.shown_text import plain_stream, shown


def shown_console(plain_width: int | None = None, *, stderr: bool = False, file: TextIO | None = None) -> Console:
    """Return a console that prints to ``file`` or, without a file, to standard output or standard error.

    If that is not a terminal, the console is ``plain_width`` characters wide. If this is None, rich chooses the width.
    """
    if file is None:
        # Printed text is escaped by the console. The usual stream would escape rich's own sequences, too.
        file = plain_stream(sys.stderr if stderr else sys.stdout)
    width = None if file.isatty() else plain_width
    return _ShownConsole(file=file, width=width, markup=False, emoji=False, highlight=False)


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
        layout = self._layout(console.width)
        # rich is too slow for long tables, so they are printed without it.
        is_long = len(self._rows) > MAX_FRAMED
        is_too_wide_for_terminal = layout is None and console.is_terminal
        if is_long and not is_too_wide_for_terminal:
            console.file.write("".join(f"{line}\n" for line in self._lines()))
        elif layout is None:
            console.file.write("".join(f"{block}\n" for block in self._blocks(console.width)))
        else:
            self._print_framed(console, layout)

    def _print_framed(self, console: Console, layout: "_Layout") -> None:
        """Print the table by rich, on a terminal with frames."""
        table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False, show_edge=False)
        for title, shown_title, min_width in zip(self._heads, layout.titles, layout.min_widths, strict=True):
            if title in self._left:
                table.add_column(shown_title, min_width=min_width)
            else:
                table.add_column(shown_title, justify="right", no_wrap=True, min_width=min_width)
        for cells in self._rows:
            table.add_row(*cells)
        margin = "\n" if console.is_terminal else ""
        console.print(margin, table, margin, sep="", end="")

    def _layout(self, console_width: int) -> "_Layout | None":
        """Return a layout of the table that fits into a console of this width, None if there is none.

        If the table is too wide as it is, its titles are broken into several lines, and then its cells.
        """
        broken_titles = self._broken_titles()
        for may_break_cells in (False, True):
            for titles in (self._heads, broken_titles):
                min_widths = self._min_widths(titles, may_break_cells)
                gaps = FRAME_GAP * (len(min_widths) - 1)
                if sum(min_widths) + gaps <= console_width:
                    return _Layout(titles, min_widths)
        return None

    def _broken_titles(self) -> list[str]:
        """Return the titles broken into lines, as narrow as the cells and the longest word of the title allow."""
        one_word_a_line = [head.replace(" ", "\n") for head in self._heads]
        column_widths = self._min_widths(one_word_a_line, may_break_cells=False)
        broken_titles = []
        for head, column_width in zip(self._heads, column_widths, strict=True):
            broken_titles.append("\n".join(textwrap.wrap(head, column_width)))
        return broken_titles

    def _min_widths(self, titles: Sequence[str], may_break_cells: bool) -> list[int]:
        """Return the smallest width of each column in characters, with these titles, which may have several lines.

        A column is as wide as its longest line. If cells may be broken into lines, MIN_WRAPPED characters are enough for
        the columns that are aligned to the left.
        """
        widths = []
        for index, head in enumerate(self._heads):
            width = _width(titles[index])
            for cells in self._rows:
                width = max(width, _width(cells[index]))
            if may_break_cells and head in self._left:
                width = min(width, MIN_WRAPPED)
            widths.append(width)
        return widths

    def _blocks(self, width: int) -> Iterator[str]:
        """Yield each row as lines of ``title  cell``, without empty cells, in at most ``width`` characters."""
        title_width = max(cell_len(head) for head in self._heads)
        indent = " " * (title_width + 2)
        # On a very narrow console, lines are longer than the console, because cells need some space.
        line_width = max(width, len(indent) + MIN_WRAPPED)
        for row in self._rows:
            block = ""
            for title, cell in zip(self._heads, row, strict=True):
                if cell:
                    start = f"{title.ljust(title_width)}  "
                    text = textwrap.fill(cell, line_width, initial_indent=start, subsequent_indent=indent)
                    block += f"{text}\n"
            yield block

    def _lines(self) -> list[str]:
        """Return the table as lines of text with aligned columns."""
        # rich takes 2 ms a row for layout and frames.
        rows = [self._heads, *(tuple(cell.replace("\n", " ") for cell in cells) for cells in self._rows)]
        columns = [_aligned(cells, cells[0] not in self._left) for cells in zip(*rows, strict=True)]
        return ["  ".join(cells).rstrip() for cells in zip(*columns, strict=True)]


class _Layout(NamedTuple):
    """The titles of a table's columns, which may have several lines, and the smallest widths of the columns."""

    titles: Sequence[str]
    min_widths: Sequence[int]


def _width(text: str) -> int:
    """Return the width of the longest line of a text on a terminal, in characters."""
    return max(cell_len(line) for line in text.split("\n"))


def _aligned(cells: tuple[str, ...], right: bool) -> list[str]:
    """Return the cells of a column with spaces before or after them, so that all have the same width on a terminal."""
    widths = [len(cell) if cell.isascii() else cell_len(cell) for cell in cells]
    column_width = max(widths)
    if right:
        return [" " * (column_width - width) + cell for cell, width in zip(cells, widths, strict=True)]
    return [cell + " " * (column_width - width) for cell, width in zip(cells, widths, strict=True)]
