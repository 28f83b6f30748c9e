"""Success by design: the runs of each combination of the parameters that vary, counted by the store.

Input: an open Store. Output: counts by the parameters' values, and which values of many to show.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy

from foldcar.analysis import rate
from foldcar.report.axis import parameter_label, value_text
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store


@dataclass(frozen=True)
class Count:
    """Runs of one design that belong in a rate, at least one; ``stopped``: by a sweep that stopped when it knew."""

    runs: int
    passed: int
    stopped: bool = False

    @property
    def success(self) -> float:
        """Share of runs that passed, 0 to 1."""
        return self.passed / self.runs

    @cached_property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval (low, high), 0 to 1: Wilson's, or the anytime-valid one after a sweep that stopped."""
        return rate.rate_interval(self.passed, self.runs, self.stopped)


@dataclass(frozen=True)
class DesignTable:
    """``cells`` holds the designs that have runs by their values of the parameters ``names``, in that order."""

    names: tuple[str, ...]
    cells: Mapping[tuple[float, ...], Count]

    def values(self, name: str) -> list[float]:
        """The values of a parameter, ascending."""
        at = self.names.index(name)
        return sorted({values[at] for values in self.cells})

    def where(self, fixed: Mapping[str, float]) -> "DesignTable":
        """The designs with these values of some parameters, by the other parameters."""
        kept = [at for at, name in enumerate(self.names) if name not in fixed]
        cells = {
            tuple(values[at] for at in kept): count
            for values, count in self.cells.items()
            if all(values[self.names.index(name)] == value for name, value in fixed.items())
        }
        return DesignTable(tuple(self.names[at] for at in kept), cells)

    def effect(self, name: str) -> float:
        """How much success differs along a parameter: the variance of its values' mean shares."""
        at = self.names.index(name)
        groups: dict[float, list[float]] = {}
        for values, count in self.cells.items():
            groups.setdefault(values[at], []).append(count.success)
        return float(numpy.var([numpy.mean(group) for group in groups.values()]))

    @property
    def single(self) -> bool:
        """Whether every design has one run: then there are no shares, and nothing to estimate."""
        return all(count.runs == 1 for count in self.cells.values())

    @property
    def stopped(self) -> bool:
        """Whether a sweep stopped when it knew enough."""
        return any(count.stopped for count in self.cells.values())

    @property
    def interval_name(self) -> str:
        """What the intervals of single designs are called."""
        return rate.interval_name(self.stopped)


def read_table(store: Store, info: ExperimentInfo) -> DesignTable:
    """The designs of an experiment that have a rate, by the parameters that vary; StoreError."""
    counts = store.design_counts(info.id)
    designs = store.designs(info.id)
    names = tuple(info.varied)
    cells = {}
    for position, runs, passed in zip(counts.positions, counts.counted, counts.passed, strict=True):
        if runs:
            values = tuple(float(designs[position][name]) for name in names)
            cells[values] = Count(runs, passed, info.until is not None)
    return DesignTable(names, cells)


def mean_interval(counts: Sequence[Count]) -> tuple[float, float]:
    """An interval (low, high) that covers the mean rate of several designs with at least 95 %."""
    stopped = any(count.stopped for count in counts)
    return rate.mean_interval([count.passed for count in counts], [count.runs for count in counts], stopped)


def spread(values: Sequence[float], most: int) -> list[float]:
    """At most ``most`` of the values, at even distances in their order, the first and the last among them."""
    if len(values) <= most:
        return list(values)
    return [values[round(at)] for at in numpy.linspace(0, len(values) - 1, most)]


def every(values: Sequence[float], most: int) -> list[float]:
    """Every n-th value from the first on, such that they are at most ``most``: ticks of an axis."""
    return list(values[:: -(-len(values) // most)])


def assigned(name: str, value: float) -> str:
    """``wheel radius 36 mm`` of wheel_radius_mm."""
    words, _, unit = parameter_label(name).partition(" (")
    return f"{words} {value_text(value)}{' ' + unit.removesuffix(')') if unit else ''}"
