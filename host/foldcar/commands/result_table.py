"""Tables of results on standard output: framed on a terminal, elsewhere plain and so wide that no line wraps."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table


def result_table(plain_width: int) -> tuple[Console, Table]:
    """A console and an empty table for it; ``plain_width`` is the width (characters) where the output is no terminal."""
    console = Console(highlight=False)
    if console.is_terminal:
        return console, Table(box=SIMPLE_HEAD, pad_edge=False)
    return Console(highlight=False, width=plain_width), Table(box=None, pad_edge=False)
