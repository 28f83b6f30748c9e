"""What other rooms give to an experiment's section: recommendations, and parts with remarks, drawings and tables.

A part is laid out as it is: its title, remarks, drawings, tables. The report neither computes nor judges what is there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from foldcar.report.series import Value


@dataclass(frozen=True)
class Recommendation:
    """A design to build: the value of a varied parameter, the design's name for the reader, and why in a sentence."""

    parameter: str
    value: Value
    label: str
    why: str


@dataclass(frozen=True)
class Drawing:
    """A figure, the name of its files without suffix, its caption, and its topic, by which the page places it.

    ``draw`` makes it, wide for papers or narrow for telephones.
    """

    name: str
    caption: str
    draw: Callable[[bool], Figure]
    topic: str = ""


@dataclass(frozen=True)
class Table:
    """A table of texts: the first column names the row."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Part:
    """A titled part of a section."""

    title: str
    remarks: Sequence[str] = ()
    drawings: Sequence[Drawing] = ()
    tables: Sequence[Table] = ()


@dataclass(frozen=True)
class Slots:
    """What is given to a section: designs to build, parts in their order, sentences for the headline."""

    recommendations: Sequence[Recommendation] = ()
    parts: Sequence[Part] = ()
    sentences: Sequence[str] = ()
