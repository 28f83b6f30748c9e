"""Tables of results on standard output: framed on a terminal, elsewhere plain and so wide that no line wraps.

A long table is plain everywhere, a row a line of its own width: to lay out and frame takes rich 2 ms a row.
"""

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table

from foldcar.shown_text import shown

# Rows beyond which nobody reads a table without a pager.
MOST_FRAMED = 500


class ResultTable:
    """Rows of texts, which are shown as they are: brackets in them are no markup."""

    def __init__(self) -> None:
        self._columns: list[tuple[str, bool, bool, int | None]] = []
        self._rows: list[tuple[str, ...]] = []

    def add_column(self, head: str, right: bool = False, no_wrap: bool = False, min_width: int | None = None) -> None:
        """A column, at whose ``right`` numbers end; ``min_width`` is in characters."""
        self._columns.append((head, right, no_wrap, min_width))

    def add_row(self, *cells: str) -> None:
        """A row of as many texts as there are columns."""
        self._rows.append(tuple(map(shown, cells)))

    def print_on(self, console: Console) -> None:
        """Print it on a `shown_console`."""
        if len(self._rows) > MOST_FRAMED:
            console.file.write("".join(f"{line}\n" for line in self._lines()))
            return
        table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)
        for head, right, no_wrap, min_width in self._columns:
            table.add_column(head, justify="right" if right else "left", no_wrap=no_wrap, min_width=min_width)
        for cells in self._rows:
            table.add_row(*cells)
        console.print(table)

    def _lines(self) -> list[str]:
        heads = tuple(head for head, *_ in self._columns)
        rows = [heads, *(tuple(cell.replace("\n", " ") for cell in cells) for cells in self._rows)]
        rights = (right for _, right, *_ in self._columns)
        columns = [_aligned(cells, right) for cells, right in zip(zip(*rows, strict=True), rights, strict=True)]
        return ["  ".join(cells).rstrip() for cells in zip(*columns, strict=True)]


def _aligned(cells: tuple[str, ...], right: bool) -> list[str]:
    widths = [len(cell) if cell.isascii() else cell_len(cell) for cell in cells]
    most = max(widths)
    if right:
        return [" " * (most - width) + cell for cell, width in zip(cells, widths, strict=True)]
    return [cell + " " * (most - width) for cell, width in zip(cells, widths, strict=True)]
