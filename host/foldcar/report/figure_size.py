"""Two sizes of every figure: for papers and wide screens, and for telephones, with the same size of letters.

Input: whether it is narrow. Output: a figure, a title and a number of columns that fit.
"""

import textwrap
from collections.abc import Iterable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

WIDE_IN, NARROW_IN = 7.2, 3.6
NARROW_TITLE = 44
# Letters of a legend's line in the wide and the narrow figure, those for an entry's line and gaps among them.
WIDE_LEGEND, NARROW_LEGEND, ENTRY = 110, 54, 10


def sized_figure(narrow: bool, height_in: float = 3.7) -> Figure:
    """An empty figure."""
    return Figure(figsize=(NARROW_IN if narrow else WIDE_IN, height_in), layout="constrained")


def set_title(axes: Axes, title: str, narrow: bool) -> None:
    """The title, in several lines where one does not fit; it begins at the figure's edge."""
    axes.set_title(textwrap.fill(title, NARROW_TITLE) if narrow else title)


def legend_columns(narrow: bool, wide: int) -> int:
    """Columns of a legend that has ``wide`` of them in the wide figure."""
    return min(2, wide) if narrow else wide


def fitting_columns(labels: Iterable[str], narrow: bool) -> int:
    """Columns of a legend with these labels that are not wider than the figure."""
    lengths = [len(label) + ENTRY for label in labels]
    return max(1, min(len(lengths), (NARROW_LEGEND if narrow else WIDE_LEGEND) // max(lengths, default=1)))
